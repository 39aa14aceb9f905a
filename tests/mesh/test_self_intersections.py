"""Pairs of faces that pass through each other."""

import numpy as np
import pytest

from signedheat import samples
from signedheat.mesh import self_intersections as crossings
from signedheat.mesh.box_tree import BoxTree


def double_cone(n, depth):
    """Two fans around the ends of an axis."""
    angle, i = 2 * np.pi * np.arange(n) / n, np.arange(n)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    j = (i + 1) % n
    faces = np.concatenate([np.stack([i, j, 0 * i + n], axis=1), np.stack([j, i, 0 * i + n + 1], axis=1)])
    return np.concatenate([rim, [[0, 0, 1], [0, 0, -depth]]]), faces


def shaken_cone():
    points, faces = double_cone(200, 1.0)
    return points + np.random.default_rng(0).normal(scale=0.05, size=points.shape), faces


def faces_at_random(height):
    rng = np.random.default_rng(1)
    faces = np.array([rng.permutation(40)[:3] for _ in range(250)])
    points = rng.normal(size=(40, 3)) * [1, 1, height]
    return points, faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]


@pytest.mark.parametrize("shape", [double_cone(200, 0.0), shaken_cone(), faces_at_random(1.0), faces_at_random(0.0)])
def test_faces_around_a_vertex_are_found_around_it_as_they_are_in_space(shape, monkeypatch):
    around = []
    for crowd in (8, 10**9):
        monkeypatch.setattr(crossings, "CROWD", crowd)
        around.append(crossings.self_intersections(*shape))
    np.testing.assert_array_equal(*around)


def test_few_faces_of_a_fan_are_near_each_other():
    points, faces = double_cone(2000, 0.0)
    corners = points[faces]
    hubs = crossings._hubs(faces, len(points))
    tree = crossings.BoxTree.over(corners, crossings._order(corners, points, hubs), hubs)
    assert len(tree.meeting(corners, 1e-8, hubs)[1]) < 20 * len(faces)


def test_long_thin_faces_meet_few_others():
    """Those of a cylinder and its round caps: their boxes overlap far from where they are."""
    n = 1000
    angle, side = 2 * np.pi * np.arange(n) / n, np.arange(n)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    below, after = ring - [0, 0, 1], np.roll(ring, -1, axis=0)
    walls = np.stack([ring, below, after], axis=1)
    cap = np.stack([ring, after, np.zeros((n, 3))], axis=1)
    triangles = np.concatenate([walls, cap])
    order = np.concatenate([side, n + side])
    starts, _ = BoxTree.over(triangles, order).meeting(walls, 1e-9)
    assert np.diff(starts).max() < 40


def test_faces_on_fewer_than_three_places_overlap_nothing():
    """Neither beside flat neighbours, which may seem to be folded, nor across others."""
    rng = np.random.default_rng(0)
    n = 5
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = ids[:-1, :-1].ravel(), ids[1:, :-1].ravel(), ids[1:, 1:].ravel(), ids[:-1, 1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    flat = np.column_stack([*(axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n))), np.zeros(n * n)])
    points = np.concatenate([flat, flat[:1]])
    ends = rng.integers(0, n * n, (40, 2))
    degenerate = np.concatenate([ends[:, [0, 0, 1]], ends[:, [1, 0, 1]], [[0, n * n, 7]]])
    whole = np.concatenate([faces, degenerate])
    for _ in range(4):
        assert not len(crossings.self_intersections(points, whole[rng.permutation(len(whole))]))
    bent = points + rng.normal(scale=1.0, size=points.shape)
    bent[-1] = bent[0]
    order = rng.permutation(len(whole))
    found = np.sort(order[crossings.self_intersections(bent, whole[order])], axis=1)
    expected = crossings.self_intersections(bent, faces)
    assert len(expected) and set(map(tuple, found.tolist())) == set(map(tuple, expected.tolist()))


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_pairs_of_some_faces_are_those_of_all_that_have_one_of_them_in_any_order(share):
    rng = np.random.default_rng(5)
    mesh = samples.sphere(2)
    points = mesh.vertices + 0.3 * rng.normal(size=mesh.vertices.shape)
    order = rng.permutation(len(mesh.faces))
    asked = rng.random(len(order)) < share
    pairs = crossings.self_intersections(points, mesh.faces)
    assert len(pairs) > 50
    expected = {tuple(pair) for pair in pairs[asked[pairs].any(axis=1)].tolist()}
    found = np.sort(order[crossings.self_intersections(points, mesh.faces[order], asked[order])], axis=1)
    assert {tuple(pair) for pair in found.tolist()} == expected
