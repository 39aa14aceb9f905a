"""Bodies that overlap: what lies inside others is left out, nothing else is."""

import numpy as np
import pytest

from refusals import refused
from shapes.bodies import box, turned
from signedheat import Grid, PointCloud, SourceError, TriangleMesh, samples, unite
from signedheat.errors import UnsupportedTypeError
from signedheat.extensions.uniting import union_of
from signedheat.geometry.edges import edge_table


def volume(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("gap", [0.3, 1.0, 1.5])
def test_two_spheres(gap):
    """Area of the union: each keeps 2π(1 + gap/2). What is less than a cell inside the other may stay: at a slope of
    gap / 2 that is a strip 2 cells / gap wide around a circle, of which winding numbers still see half."""
    united = unite(samples.union(samples.sphere(4), samples.sphere(4, center=(gap, 0, 0))), resolution=64)
    assert united.face_areas.sum() == pytest.approx(4 * np.pi * (1 + gap / 2), rel=0.01 + 0.01 / gap)
    first = np.linalg.norm(united.vertices[united.faces].mean(axis=1), axis=1)
    assert first.min() > 1 - 0.07  # nothing deeper than a cell is left inside


def test_ball_in_ball_and_cavity():
    outer, inner = samples.sphere(3), samples.sphere(2, radius=0.5)
    found = union_of(samples.union(outer, inner), resolution=48)
    assert (found.left_out.covered_faces, found.left_out.cut_faces) == (inner.n_faces, 0)
    assert np.array_equal(found.shape.faces, outer.faces)
    shell = samples.union(outer, turned(inner))
    assert unite(shell, resolution=48) is shell


def test_faces_far_larger_than_a_cell_are_cut():
    """A cross of two bars, twelve faces each: the union's volume and area are known."""
    cross = samples.union(box((-2, -0.5, -0.5), (2, 0.5, 0.5)), box((-0.4, -2, -0.4), (0.4, 2, 0.4)))
    united = unite(cross, resolution=80)
    # two 1 × 1 ends and 4 × 4 walls less two 0.8 × 0.8 windows; two .8 × .8 ends and eight .8 × 1.5 walls
    area = 2 + 16 - 2 * 0.64 + 2 * 0.64 + 8 * 0.8 * 1.5
    assert united.face_areas.sum() == pytest.approx(area, rel=0.01)
    assert volume(united) == pytest.approx(4 + 2 * 0.64 * 1.5, rel=0.01)
    inside = np.abs(united.vertices[united.faces].mean(axis=1))
    assert not ((inside < [2, 0.5, 0.5]) & (inside < [0.4, 2, 0.4])).all(axis=1).any()


def test_pieces_of_one_face_share_their_vertices():
    """The only boundary is where bodies enter each other: no crack between faces that were cut and others."""
    found = union_of(samples.union(box((-1, -1, -1), (1, 1, 1)), box((-0.3, -0.3, 0.2), (0.3, 0.3, 2))), resolution=48)
    mesh = found.shape
    table = edge_table(mesh.faces)
    rim = mesh.vertices[table.vertices[table.face_counts == 1]].mean(axis=1)
    cell = 3 * 1.4 / 47
    assert found.left_out.cut_faces > 0
    assert np.abs(np.abs(rim[:, :2]).max(axis=1) - 0.3).max() < cell
    assert np.abs(rim[:, 2] - 1).max() < cell


def test_coincident_faces_count_once():
    ball = samples.sphere(3)
    found = union_of(samples.union(ball, ball), resolution=40)
    assert found.left_out.merged_faces == ball.n_faces
    assert np.array_equal(found.shape.faces, ball.faces)


def test_doubled_walls_stay_unless_they_are_buried():
    sheet = TriangleMesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    wall = samples.union(sheet, turned(sheet))
    found = union_of(wall, resolution=24)
    assert (found.shape, found.left_out.doubled_walls) == (wall, 2)
    halves = samples.union(box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1)))
    assert unite(halves, resolution=40).face_areas.sum() == pytest.approx(10)


def test_gaps_narrower_than_a_cell_stay():
    plates = samples.union(box((0, 0, 0), (1, 1, 0.3)), box((0, 0, 0.305), (1, 1, 0.6)))
    assert unite(plates, resolution=48) is plates


def test_noise_is_no_overlap():
    soup = samples.soup(samples.sphere(4), jitter=0.01)
    assert unite(soup, resolution=48) is soup


def test_points():
    ball, other = (samples.oriented_points(samples.sphere(3, center=(x, 0, 0)), 4000, seed=2) for x in (0.0, 1.0))
    both = PointCloud(np.concatenate([ball.points, other.points]), np.concatenate([ball.normals, other.normals]))
    left = unite(both, resolution=40).points
    depth = 1 - np.minimum(np.linalg.norm(left, axis=1), np.linalg.norm(left - [1.0, 0, 0], axis=1))
    assert depth.max() < 0.1
    assert len(left) == pytest.approx(0.75 * 8000, rel=0.03)


def test_refusals():
    with refused(UnsupportedTypeError, "shape"):
        unite(Grid((0, 0, 0), 1.0, (2, 2, 2)), Grid((0, 0, 0), 1.0, (8, 8, 8)))
    with refused(SourceError, "source 0"):
        unite(samples.sphere(1), Grid((0, 0), 1.0, (8, 8)))
