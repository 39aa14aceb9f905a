"""Single steps on surfaces, on input so small that their results are known."""

from __future__ import annotations

import numpy as np

from signedheat import Curve, samples
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh
from signedheat.surfaces.cotan import assemble, cotan_matrix
from signedheat.surfaces.digital_surface import boundary_surfels, corrected_normals, smoothed_corners
from signedheat.surfaces.local_triangulations import hole_fillings
from signedheat.surfaces.normal_orientation import sign_links, spread_out
from signedheat.surfaces.plane_fits import MERGED_SHARE, noisy_sizes, share_of_two_sides
from signedheat.surfaces.source_segments import segments_of_each
from signedheat.surfaces.vector_heat import extrapolated, nonmanifold_frames


def test_cotan_matrix_of_a_right_triangle():
    flat = IntrinsicMesh.from_lengths(np.array([[0, 1, 2]]), np.array([[1.0, 2**0.5, 1.0]]), 3)
    upper = [[1.0, -0.5, -0.5], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]
    np.testing.assert_allclose(cotan_matrix(flat).toarray(), upper, atol=1e-15)


def test_hermitian_sums_keep_their_upper_triangle():
    matrix = assemble(np.array([[0, 2, 1]]), np.ones((1, 3)), np.array([[1j, 2.0, 3.0]]), 3).toarray()
    assert matrix.tolist() == [[1, 3, 1j], [0, 1, 2], [0, 0, 1]]


def test_a_step_of_one_voxel_in_a_slope_becomes_straight():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [2, 0, 1.0]])
    vertices = np.concatenate([vertices, vertices + np.array([0, 1, 0])])
    corners = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])
    normals = np.tile([-(0.5**0.5), 0, 0.5**0.5], (3, 1))
    smooth = smoothed_corners(vertices, corners, normals)
    assert np.abs((smooth[:4] - smooth[0]) @ normals[0]).max() < 0.25  # 0.7 before


def test_normals_in_the_middle_of_a_plate():
    solid = np.ones((9, 9, 3), dtype=bool)
    surfels = boundary_surfels(solid)
    top = (surfels.signs > 0) & (surfels.axes == 2) & (surfels.voxels[:, :2] == 4).all(axis=1)
    np.testing.assert_allclose(corrected_normals(solid, surfels, np.ones(3), 2.0)[top], [[0, 0, 1]], atol=1e-6)


def test_a_hole_of_three_sides_is_filled():
    points = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [1, 1, 0], [1.5, 1, 0], [1, 1.5, 0]])
    ring = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]])
    assert hole_fillings(points, np.tile([0.0, 0, 1], (6, 1)), ring).tolist() in ([[3, 4, 5]], [[4, 5, 3]], [[5, 3, 4]])


def test_links_on_a_ball_agree_with_its_normals():
    ball = samples.sphere(1).vertices
    assert (sign_links(ball, ball, np.ones(len(ball)))[0].weights >= 0).all()


def test_points_within_the_radius_of_an_earlier_one_are_left_out():
    points = np.array([[0.0, 0, 0], [0.4, 0, 0], [0.8, 0, 0]])
    assert spread_out(points, np.full(3, 0.5)).tolist() == [0, 2]


def test_noise_calls_for_large_neighbourhoods():
    points = np.random.default_rng(0).random((2000, 3)) * (1, 1, 0.1)
    assert noisy_sizes(points)[-1] == 192
    assert noisy_sizes(points * (1, 1, 0)) == []


def test_two_sides_are_told_from_noise():
    random = np.random.default_rng(0)
    points, up = random.random((2000, 3)) * (1, 1, 0), np.tile([0.0, 0, 1], (2000, 1))
    sides, noise = 0.005 * random.choice([-1, 1], 2000), 0.005 * random.normal(size=2000)
    assert share_of_two_sides(points + up * sides[:, None], up) > MERGED_SHARE
    assert share_of_two_sides(points + up * noise[:, None], up) < MERGED_SHARE


def test_extrapolation_cancels_an_error_like_1_over_t():
    change = 0.01 / 4.0  # X = exp(i a/t): its angle is an error of exponent −1
    x = np.exp(1j * change)
    first, second = -1j * change * x, (1j * change - change**2) * x  # t d/dt, once and twice
    once = first + x
    assert abs(np.angle(extrapolated(np.array([[x, once, (second - x + 3 * once) / 2]]))[0])) < 1e-5


def test_the_first_face_of_a_nonmanifold_edge_is_that_with_the_curve():
    three = IntrinsicMesh.from_lengths(np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]]), np.ones((3, 3)), 5)
    on_the_last = segments_of_each([Curve([2, 2], [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])], three)
    assert nonmanifold_frames(three, on_the_last)[0].first_halfedges.tolist() == [6, 1, 2, 4, 5, 7, 8]
