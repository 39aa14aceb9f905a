"""Exact distance in Delaunay triangles is that in the triangles given, with far fewer windows on slivers."""

from __future__ import annotations

from itertools import chain

import numpy as np
import pytest

import signedheat as sh
from signedheat.discretization import discretize
from signedheat.geodesics import exact_distance as exact
from signedheat.geodesics.exact_distance import in_delaunay_triangles, share_to_flip
from signedheat.geodesics.geodesic_sources import PlacedSegments, as_curve, zero_line
from signedheat.samples import sphere, torus


def zigzag(n: int) -> sh.TriangleMesh:
    """A disc of slivers with corners on its rim, each split in four."""
    angles = 2 * np.pi * np.arange(n) / n
    strip = np.stack([np.arange(n // 2), np.arange(n - 1, n // 2 - 1, -1)], axis=1).ravel()
    faces = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    faces[::2] = faces[::2, ::-1]
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    edges, which = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    (a, b, c), (ab, bc, ca) = faces.T, which.reshape(-1, 3).T + n
    finer = np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return sh.TriangleMesh(np.concatenate([rim, rim[edges].mean(axis=1)]), finer)


def wave(mesh: sh.TriangleMesh) -> np.ndarray:
    x, y, _ = mesh.vertices.T
    return y - 0.2 * np.sin(9 * x) - 0.1003


def awful(seed: int) -> sh.TriangleMesh:
    """A torus squeezed and shaken."""
    rng = np.random.default_rng(seed)
    mesh = torus(n_around=20, n_across=8)
    points = mesh.vertices * [1.0, 0.1, 3.0] + 0.02 * rng.normal(size=mesh.vertices.shape)
    return sh.TriangleMesh(points, mesh.faces)


def placed(mesh: sh.TriangleMesh, kind: str) -> PlacedSegments:
    triangles = discretize(mesh).triangles
    if kind == "zero line":
        return zero_line(triangles, wave(mesh))
    sources = {
        "curves": lambda: mesh.level_set(wave(mesh), 0.0),
        "edges": lambda: [mesh.polyline(mesh.vertices[mesh.faces[7]])],
        "points": lambda: [sh.SurfacePoints([3, 40, 41], [[0.2, 0.5, 0.3], [1, 0, 0], [0.5, 0.5, 0]])],
    }
    parts = list(chain.from_iterable(discretize(mesh).segments(sources[kind]())))
    return PlacedSegments.of(triangles, parts)


@pytest.mark.parametrize("kind", ["zero line", "curves", "edges", "points"])
@pytest.mark.parametrize("mesh", [zigzag(60), awful(0), awful(1)], ids=["zigzag", "torus 0", "torus 1"])
def test_distances_are_those_in_the_triangles_given(mesh, kind):
    triangles, sources = discretize(mesh).triangles, placed(mesh, kind)
    before = exact.PausedSearch.start(triangles, sources, 0.0).until(10**7)
    flipped, moved = in_delaunay_triangles(triangles, sources)
    after = exact.PausedSearch.start(flipped, moved, 0.0).until(10**7)
    assert share_to_flip(flipped) < 0.2 * share_to_flip(triangles)
    assert np.abs(after.distance()[: mesh.n_vertices] - before.distance()).max() < 1e-10


@pytest.mark.parametrize("kind", ["zero line", "curves", "edges"])
def test_segments_as_a_curve_are_placed_alike(kind):
    mesh = awful(2)
    triangles, before = discretize(mesh).triangles, placed(mesh, kind)
    after = PlacedSegments.of(triangles, [as_curve(triangles, before)])
    assert after.lengths.sum() == pytest.approx(before.lengths.sum(), rel=1e-12)
    assert sorted(zip(after.faces, after.along_edge, strict=True)) == sorted(
        zip(before.faces, before.along_edge, strict=True)
    )


@pytest.mark.parametrize("seed", [112, 126])
def test_lines_through_vertices_of_awful_triangles(seed):
    """Lines that passed vertices at 10⁻⁷ edges lost windows: some distances were too long by 2 % of the largest."""
    rng = np.random.default_rng(seed)
    mesh = torus(rng.uniform(6, 30), rng.uniform(4, 12))
    points = mesh.vertices * rng.uniform(0.05, 3, size=3)
    points = points + rng.choice([0, 0.02, 0.1]) * np.ptp(points) * rng.normal(size=points.shape)
    triangles = discretize(sh.TriangleMesh(points, mesh.faces)).triangles
    values = rng.integers(-1, 2, size=len(points)).astype(float)
    distance, _ = exact.distance_to_zero_line(triangles, values, 0.0)
    moved = exact.cleared(triangles, values, 1e-7 * triangles.lengths_of_edges.mean())
    flipped = exact.PausedSearch.start(*in_delaunay_triangles(triangles, zero_line(triangles, moved)), 0.0)
    bound = flipped.until(10**7).distance()[: len(points)]
    assert np.abs(distance - bound).max() < 1e-7 * distance.max()


def test_slivers_are_not_cut_short():
    """A search in the triangles given is: every segment is seen through every edge across the disc."""
    mesh = zigzag(1000)
    triangles, heights = discretize(mesh).triangles, wave(mesh)
    limit = exact.window_limit(triangles)
    given = exact.PausedSearch.start(triangles, zero_line(triangles, heights), 1e-4).until(limit)
    assert not given.has_ended
    distance, windows = exact.distance_to_zero_line(triangles, heights)
    assert windows < limit

    (curve,) = mesh.level_set(heights, 0.0)
    crossings = (curve.barycentric[:, :, None] * mesh.vertices[mesh.faces[curve.faces]]).sum(axis=1)[:, :2]
    starts, steps = crossings[:-1], np.diff(crossings, axis=0)
    for i in np.random.default_rng(0).choice(mesh.n_vertices, 100, replace=False):
        from_start = mesh.vertices[i, :2] - starts
        along = np.clip((from_start * steps).sum(axis=1) / (steps**2).sum(axis=1), 0, 1)
        straight = np.linalg.norm(from_start - along[:, None] * steps, axis=1).min()
        assert distance[i] == pytest.approx(straight, abs=1e-3)


def test_good_triangles_stay():
    mesh = sphere(3)
    triangles = discretize(mesh).triangles
    assert in_delaunay_triangles(triangles, zero_line(triangles, mesh.vertices[:, 2] + 0.01)) is None
