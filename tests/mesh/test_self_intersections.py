"""Pairs of faces that pass through each other."""

import time

import numpy as np
import pytest

from signedheat import samples
from signedheat.mesh import self_intersections as crossings


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


def tube(n):
    """Long thin faces of a cylinder, and its round caps."""
    angle, side = 2 * np.pi * np.arange(n) / n, np.arange(n)
    after, top, bottom = (side + 1) % n, np.full(n, 2 * n), np.full(n, 2 * n + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    points = np.concatenate([ring, ring - [0, 0, 3], [[0, 0, 0], [0, 0, -3]]])
    walls = [[side, side + n, after], [after, side + n, after + n], [side, after, top], [side + n, bottom, after + n]]
    return points, np.concatenate([np.stack(corners, axis=1) for corners in walls])


def seconds_to_search(points, faces):
    """Least of three measurements."""
    seconds = []
    for _ in range(3):
        begin = time.process_time()
        assert not len(crossings.self_intersections(points, faces))
        seconds.append(time.process_time() - begin)
    return min(seconds)


@pytest.mark.parametrize("shape", [double_cone(10_000, 1.0), double_cone(10_000, 0.0), tube(5_000)])
def test_long_thin_faces_take_as_long_as_others(shape):
    """Their boxes overlap far from where they are; all pairs of them would take a hundred times as long."""
    points, faces = shape
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    ball = samples.sphere(5)
    usual = seconds_to_search(ball.vertices, ball.faces) / len(ball.faces)
    assert seconds_to_search(points @ turn, faces) / len(faces) < 10 * usual


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


def brute_force(points, faces):
    """All pairs, one by one."""
    ways, slack = np.empty((10, 3)), crossings.tolerances(points, faces, crossings.TOUCHING_DEPTH)
    pairs = []
    for f in range(len(faces)):
        for g in range(f + 1, len(faces)):
            shared = len(set(faces[f].tolist()) & set(faces[g].tolist()))
            depth = slack[f] if shared else -slack[f]
            if shared > 1:
                met = crossings._overlapping(points[faces].reshape(-1, 9), faces, slack, f, g, ways)
            else:
                met = crossings.overlap(points[faces[f]].ravel(), points[faces[g]].ravel(), slack[f], depth, ways)
            if met:
                pairs.append((f, g))
    return pairs


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("turned", [0.0, 0.3])
def test_pairs_are_those_of_all_comparisons(noise, turned):
    rng = np.random.default_rng(2)
    ball = samples.sphere(1)
    points, faces = ball.vertices + noise * rng.normal(size=ball.vertices.shape), ball.faces.copy()
    chosen = rng.random(len(faces)) < turned
    faces[chosen] = faces[chosen][:, ::-1]
    faces = np.concatenate([faces, np.where(faces == 0, 0, faces + len(points))])  # two balls with a common vertex
    points = np.concatenate([points, points + np.array([0.9, 0.1, 0.2])])
    assert crossings.self_intersections(points, faces).tolist() == [list(pair) for pair in brute_force(points, faces)]


def test_a_fan_that_surrounds_its_vertex_twice_is_compared():
    angle = 4 * np.pi * np.arange(14) / 14
    rim = np.stack([np.cos(angle), np.sin(angle), 0.02 * np.arange(14)], axis=1)
    points, side = np.concatenate([rim, [[0, 0, 0.5]]]), np.arange(14)
    faces = np.stack([side, (side + 1) % 14, np.full(14, 14)], axis=1)
    assert len(crossings.self_intersections(points, faces)) == len(brute_force(points, faces)) > 0
