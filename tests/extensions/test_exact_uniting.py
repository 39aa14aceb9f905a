"""What lies inside other bodies, where no node of a grid tells."""

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples
from signedheat.extensions.exact_uniting import Overlaps, exactly_without_covered
from signedheat.extensions.uniting import merge_duplicates


def left_of(mesh, apart, finest):
    return exactly_without_covered(Overlaps(merge_duplicates(mesh), apart, finest))


@pytest.mark.parametrize("gap", [1.0, 1.9, 1.99])
def test_two_spheres_keep_what_is_outside_the_other(gap):
    """Each keeps 2π (1 + gap / 2), however thin the lens in which they overlap; facets are 0.2 % smaller."""
    found = left_of(samples.union(samples.sphere(4), samples.sphere(4, center=(gap, 0, 0))), 0.2, 0.01)
    assert found.shape.face_areas.sum() == pytest.approx(4 * np.pi * (1 + gap / 2), rel=0.003)
    assert found.left_out.covered_faces > 0
    middles = found.shape.vertices[found.shape.faces].mean(axis=1)
    assert np.linalg.norm(middles, axis=1).min() > 1 - 0.005
    assert np.linalg.norm(middles - [gap, 0, 0], axis=1).min() > 1 - 0.005


def test_few_large_faces_are_cut_where_they_enter():
    cross = samples.union(box((-2, -0.5, -0.5), (2, 0.5, 0.5)), box((-0.4, -2, -0.4), (0.4, 2, 0.4)))
    found = left_of(cross, 0.1, 0.02)
    area = 2 + 16 - 2 * 0.64 + 2 * 0.64 + 8 * 0.8 * 1.5
    assert found.shape.face_areas.sum() == pytest.approx(area, rel=0.005)
    assert found.shape.n_faces < 20_000


def test_bodies_that_touch_and_bodies_apart_are_left_as_they_are():
    for shift in (1.0, 1.2):
        pair = samples.union(box((0, 0, 0), (1, 1, 1)), box((shift, 0.2, 0.2), (shift + 1, 0.8, 0.8)))
        assert left_of(pair, 0.1, 0.02).shape is pair


@pytest.mark.parametrize("radius", [0.02, 0.05])
def test_a_rod_far_thinner_than_a_face_is_found_in_its_middle(radius):
    """Half of a rod is in a plate of large faces: it covers its section of them, up to the pieces at its rim."""
    plate = box((-1, -1, -0.5), (1, 1, 0))
    angle = 2 * np.pi * np.arange(32) / 32
    ring = np.stack([radius * np.cos(angle) + 0.31, radius * np.sin(angle) + 0.17], axis=1)
    vertices = np.concatenate([np.column_stack([ring, np.full(32, z)]) for z in (-0.2, 0.2)])
    i, j = np.arange(32), (np.arange(32) + 1) % 32
    fan = np.stack([np.zeros(30, dtype=int), np.arange(1, 31), np.arange(2, 32)], axis=1)
    sides = np.concatenate([np.stack([i, j, 32 + j], axis=1), np.stack([i, 32 + j, 32 + i], axis=1)])
    rod = sh.TriangleMesh(vertices, np.concatenate([sides, fan[:, ::-1], 32 + fan]))
    found = left_of(samples.union(plate, rod), 0.04, 0.01)
    upper = (np.abs(found.shape.vertices[found.shape.faces][:, :, 2]) < 1e-9).all(axis=1)
    disc = 16 * radius**2 * np.sin(2 * np.pi / 32)
    assert found.shape.face_areas[upper].sum() == pytest.approx(4 - disc, abs=0.005 * 2 * np.pi * radius)


def test_large_faces_end_where_they_enter_other_bodies():
    """Where some faces are left out, the others end on a face of the other body, far nearer than a piece is large."""
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    bar, rod = box((-2, -0.5, -0.5), (2, 0.5, 0.5)), box((-0.41, -1.9, -0.37), (0.41, 2.1, 0.43))
    rod = sh.TriangleMesh(rod.vertices @ turn.T, rod.faces)
    finest = 0.05
    left = left_of(samples.union(bar, rod), 0.1, finest).shape
    edges = np.sort(left.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(edges, axis=0, return_counts=True)
    rim = left.vertices[np.unique(edges[counts == 1])]
    on_bar = np.abs(np.abs(rim) - [2, 0.5, 0.5]).min(axis=1)
    own = rim @ turn
    on_rod = np.minimum(np.abs(own - [-0.41, -1.9, -0.37]), np.abs(own - [0.41, 2.1, 0.43])).min(axis=1)
    assert len(rim) > 100
    assert np.percentile(np.maximum(on_bar, on_rod), 95) < 0.05 * finest
    assert np.maximum(on_bar, on_rod).max() < 0.5 * finest  # beside corners
