"""Shortest paths: closed forms, the distance that the search gives, other subdivisions, and where there is none."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box, finer
from signedheat import samples


def length(surface, curve):
    return float(np.linalg.norm(np.diff(surface.positions(curve), axis=0), axis=1).sum())


@pytest.mark.parametrize("times", [0, 1, 3])
def test_between_opposite_corners_of_a_box(times):
    solid = box((0, 0, 0), (1, 2, 3))
    vertices, faces = solid.vertices, solid.faces
    for _ in range(times):
        vertices, faces = finer(vertices, faces)
    mesh = sh.TriangleMesh(vertices, faces)
    path = mesh.shortest_path((0, 0, 0), (1, 2, 3))
    assert length(mesh, path) == pytest.approx(np.hypot(3, 3), rel=1e-9)
    ends = mesh.positions(path)[[0, -1]]
    assert ends == pytest.approx(np.array([[0, 0, 0], [1, 2, 3]]))


def test_around_the_corner_of_a_notch():
    """In an L-shaped plane the path bends at the inner corner."""
    squares = [[0, 0], [1, 0], [0, 1]]
    vertices, faces = [], []
    for x, y in squares:
        faces += [[len(vertices) + k for k in corners] for corners in ([0, 1, 2], [0, 2, 3])]
        vertices += [[x, y, 0], [x + 1, y, 0], [x + 1, y + 1, 0], [x, y + 1, 0]]
    mesh = sh.TriangleMesh(vertices, faces)  # its seams are joined
    path = mesh.shortest_path((2.0, 0.8, 0.0), (0.8, 2.0, 0.0))
    assert length(mesh, path) == pytest.approx(2 * np.hypot(1, 0.2))
    assert np.abs(mesh.positions(path) - [1, 1, 0]).sum(axis=1).min() < 1e-12


def random_surface(seed):
    rng = np.random.default_rng(seed)
    ball = samples.sphere(3)
    bumps = 1 + 0.3 * np.sin(3 * ball.vertices @ rng.normal(size=3)) + 0.05 * rng.normal(size=ball.n_vertices)
    return sh.TriangleMesh(bumps[:, None] * ball.vertices, ball.faces)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_is_as_long_as_the_distance_and_straight(seed):
    mesh = random_surface(seed)
    vertices = np.random.default_rng(seed).integers(mesh.n_vertices, size=8)
    near = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.points_at(vertices[0]))
    exact = sh.sharpen(near, method=sh.methods.Geodesic(tolerance=0.0))
    for vertex in vertices[1:]:
        if vertex != vertices[0]:
            path = mesh.shortest_path(int(vertices[0]), int(vertex))
            assert length(mesh, path) == pytest.approx(exact.values[vertex], rel=1e-7)
            back = mesh.shortest_path(int(vertex), int(vertices[0]))
            assert length(mesh, back) == pytest.approx(exact.values[vertex], rel=1e-7)


def test_from_curves_and_places_in_faces_to_the_nearest_of_several():
    mesh = samples.torus(1.0, 0.4, n_around=40, n_across=20)
    rim = mesh.level_set(mesh.vertices[:, 0], 0.35)
    ends = sh.SurfacePoints([3, 411], [[0.2, 0.3, 0.5], [0.6, 0.3, 0.1]])
    path = mesh.shortest_path(rim, ends)
    alone = [
        length(mesh, mesh.shortest_path(rim, sh.SurfacePoints([f], [w])))
        for f, w in zip(ends.faces, ends.barycentric, strict=True)
    ]
    assert length(mesh, path) == pytest.approx(min(alone), rel=1e-12)
    assert mesh.positions(path)[0, 0] == pytest.approx(0.35, abs=1e-9)
    field = sh.signed_distance(rim, mesh)
    assert min(alone) == pytest.approx(float(np.abs(field(ends)).min()), rel=0.02)


def test_paths_go_with_the_surface():
    mesh, turn = random_surface(5), np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    moved = sh.TriangleMesh(1e3 * mesh.vertices @ turn.T + 1e6, mesh.faces)
    shuffled = sh.TriangleMesh(mesh.vertices, np.roll(mesh.faces[::-1], 1, axis=1))
    first = length(mesh, mesh.shortest_path(5, 400))
    assert length(moved, moved.shortest_path(5, 400)) == pytest.approx(1e3 * first, rel=1e-6)
    assert length(shuffled, shuffled.shortest_path(5, 400)) == pytest.approx(first, rel=1e-9)
    far = samples.union(mesh, samples.sphere(1, center=(9, 0, 0)))
    assert length(far, far.shortest_path(5, 400)) == pytest.approx(first, rel=1e-9)


def test_paths_that_are_none():
    two = samples.union(samples.sphere(1), samples.sphere(1, center=(9, 0, 0)))
    with refused(sh.errors.SourceError):
        two.shortest_path(0, two.n_vertices - 1)
    with refused(sh.errors.SourceError, element="end"):
        two.shortest_path(0, 0)
    with refused(sh.errors.SourceError, element="end"):
        two.shortest_path(0, two.path([1, 2]))
    with refused(sh.errors.SourceError):
        two.shortest_path(0, 10_000)
    with refused(sh.errors.SignedHeatError):
        two.shortest_path([np.nan, 0, 0], 1)
