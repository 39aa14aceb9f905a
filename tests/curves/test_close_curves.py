"""Completion of curves on meshes whose triangles are larger than the curves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import signedheat as sh
from shapes.bodies import box
from shapes.surface_cases import sphere
from signedheat.mesh.surface_points import VERTEX


def circle(radius: float, begin: float = 0.0, end: float = 2 * np.pi, n: int = 40) -> np.ndarray:
    angle = np.linspace(begin, end, n, endpoint=end - begin < 6)
    return np.stack([3.4 + radius * np.cos(angle), 1.9 + radius * np.sin(angle), np.ones(n)], axis=1)


@pytest.mark.parametrize("radius", [0.3, 1.2])
def test_closed_curves_smaller_than_the_triangles_come_back(radius):
    mesh = box((0, 0, 0), (6, 4, 1))
    found = sh.close_curves(mesh.polyline(circle(radius), closed=True), mesh)
    assert len(found) == 1 and found[0].closed
    places = np.einsum("ij,ijk->ik", found[0].barycentric, mesh.vertices[mesh.faces[found[0].faces]])
    assert np.abs(np.linalg.norm(places - [3.4, 1.9, 1.0], axis=1) - radius).max() < 0.01 * radius


def test_a_gap_is_closed():
    mesh = box((0, 0, 0), (6, 4, 1))
    found = sh.close_curves(mesh.polyline(circle(1.2, 0.4, 6.0)), mesh)
    assert len(found) == 1 and found[0].closed
    places = np.einsum("ij,ijk->ik", found[0].barycentric, mesh.vertices[mesh.faces[found[0].faces]])
    assert np.abs(np.linalg.norm(places - [3.4, 1.9, 1.0], axis=1) - 1.2).max() < 0.3


def test_the_finer_solution_is_used():
    """Values at points and contours come from the refined triangles, until the values change."""
    mesh = box((0, 0, 0), (6, 4, 1))
    phi = sh.SignedHeatSolver(mesh, intrinsic=True).distance(mesh.polyline(circle(0.8), closed=True))
    assert phi.finest.domain.n_vertices > 50
    assert phi([[3.4, 1.9, 1.0]])[0] > 0.3
    assert len(phi.contour(0.3)) == 1
    shifted = sh.Field(mesh, phi.values + 1.0, finer=phi.finer)
    assert shifted.finest is shifted


@pytest.mark.parametrize("radius", [0.05, 0.1])
@pytest.mark.parametrize("seed", [2, 3])
def test_gaps_of_curves_far_smaller_than_the_triangles_are_closed(radius, seed):
    """Of 28 points on a circle, in uneven steps, pieces of five are left: completed beside the circle."""
    mesh, center = box((0, 0, 0), (6, 4, 1)), np.array([3.4, 1.9, 1.0])
    angle = np.sort(np.random.default_rng(seed).uniform(0, 2 * np.pi, 28))
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + center
    found = sh.close_curves([mesh.polyline(ring[7 * k : 7 * k + 5]) for k in range(4)], mesh)
    assert len(found) == 1 and found[0].closed
    places = np.einsum("ij,ijk->ik", found[0].barycentric, mesh.vertices[mesh.faces[found[0].faces]])
    assert np.abs(np.linalg.norm(places - center, axis=1) / radius - 1).max() < 0.8


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # half of the ring gone is a guess
@pytest.mark.parametrize(("n", "gap"), [(9, 0.6), (9, 3.1), (13, 0.0)])
def test_rounding_chooses_between_no_equals(n, gap):
    """Strokes along a great circle of symmetric triangles, of which many are mirrored: paths, cuts, refinements tie."""
    ball, noise = sphere(1), np.random.default_rng(0)
    angles = np.linspace(0, 2 * np.pi - gap, n)
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    counts, values = [], []
    for size in (0.0, *4 * [1.2e-16]):
        mesh = sh.TriangleMesh(ball.vertices * (1 + size * noise.choice([-1, 0, 1], ball.vertices.shape)), ball.faces)
        stroke = mesh.polyline(ring)
        counts.append([len(stroke.faces), *(curve.n_points for curve in sh.close_curves(stroke, mesh))])
        values.append(sh.SignedHeatSolver(mesh, intrinsic=True).distance(stroke).values)
    assert counts[1:] == counts[:-1]
    np.testing.assert_allclose(values[1:], values[:-1], rtol=0, atol=1e-11)


def test_curves_along_edges_stay_on_them():
    """Refinement only adds vertices to them, however the sphere is turned: no points between, which rounding makes."""
    angles = np.linspace(0, 5.7, 9)
    ring = np.stack([np.cos(angles), np.sin(angles), 0.3 + 0 * angles], axis=1)
    for turn in Rotation.random(12, random_state=0).as_matrix():
        mesh = sh.TriangleMesh(sphere(2).vertices @ turn.T, sphere(2).faces)
        stroke = mesh.polyline(ring @ turn.T)
        refined = sh.intrinsic_delaunay(mesh, [stroke], refine=True)
        assert (refined.transfer(stroke).nodes.kinds == VERTEX).all()
