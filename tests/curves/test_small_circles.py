"""Many small broken circles on one surface, of which pieces are turned: distance, directions and closing."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.surfaces import disk
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.errors import InexactWarning
from signedheat.samples import sphere


def centers_on_sphere(n: int, apart: float) -> np.ndarray:
    rng, found = np.random.default_rng(3), []
    while len(found) < n:
        p = rng.normal(size=3)
        p /= np.linalg.norm(p)
        if all(np.arccos(np.clip(p @ q, -1, 1)) > apart for q in found):
            found.append(p)
    return np.array(found)


def circle_on_sphere(center: np.ndarray, radius: float, angles: np.ndarray) -> np.ndarray:
    u = np.cross(center, [0.3, 0.5, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(center, u)
    return np.cos(radius) * center + np.sin(radius) * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v)


def arcs(pieces: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Angles of pieces of a circle, of which a fifth is lost."""
    start = rng.uniform(0, 2 * np.pi)
    return [start + 2 * np.pi * (k + np.linspace(0, 0.8, 24 // pieces)) / pieces for k in range(pieces)]


def circles(mesh: sh.TriangleMesh, centers: np.ndarray, radius: float, pieces: int, turned: float):
    """Pieces of circles on a sphere, and which of them run the wrong way."""
    rng = np.random.default_rng(1)
    points = [circle_on_sphere(c, radius, angles) for c in centers for angles in arcs(pieces, rng)]
    wrong = np.isin(np.arange(len(points)), rng.permutation(len(points))[: round(turned * len(points))])
    return [mesh.polyline(p[::-1] if w else p) for p, w in zip(points, wrong, strict=True)], wrong


@pytest.mark.parametrize(("radius", "pieces"), [(0.05, 4), (0.05, 1), (0.16, 2)])
def test_all_circles_face_the_same_way(radius, pieces):
    """Of circles with radii of a third of an edge length to one, a quarter of the pieces is turned, in some circles
    half of them or all: only the other circles tell."""
    mesh = sphere(3)
    centers = centers_on_sphere(12, 3 * radius)
    given, wrong = circles(mesh, centers, radius, pieces, 0.25)
    assert (np.bincount(np.repeat(np.arange(12), pieces), wrong) >= pieces / 2).any()
    phi = sh.signed_distance(given, mesh)
    assert phi.diagnostics.note(CurvesTaken).turned == np.flatnonzero(wrong).tolist()
    out = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    exact = radius - np.arccos(np.clip(out @ centers.T, -1, 1)).min(axis=1)
    clear = np.abs(exact) > 0.25 * radius
    # where a fifth of so small a circle is lost at once, a vertex beyond the gap may lie within what closes it
    assert (np.sign(phi.values) != np.sign(exact))[clear].sum() <= (pieces == 1)
    assert np.abs(phi.values - exact).max() < (1.4 if pieces == 1 else 0.3) * radius


def test_each_is_turned_and_closed_by_one_loop():
    mesh, radius = sphere(3), 0.06
    centers = centers_on_sphere(8, 3 * radius)
    given, wrong = circles(mesh, centers, radius, 4, 0.3)
    assert (sh.orientation(given, mesh).turned == wrong).all()
    found = sh.close_curves(given, mesh)
    assert len(found) == 8 and all(curve.closed for curve in found)
    for curve in found:
        at = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
        away = np.linalg.norm(at - centers[np.linalg.norm(at.mean(axis=0) - centers, axis=1).argmin()], axis=1)
        assert np.abs(away / radius - 1).max() < 0.35


@pytest.mark.parametrize("pieces", [1, 4])
def test_the_fewer_of_circles_that_face_either_way_are_turned(pieces):
    """Four of nine circles in a plane are complete; of the five broken ones all pieces face the other way: a guess."""
    mesh = disk(24)
    centers = np.array([[x, y, 0] for x in (-0.5, 0, 0.5) for y in (-0.4, 0, 0.4)])
    angle, rng = 2 * np.pi * np.arange(24) / 24, np.random.default_rng(0)
    ring = 0.12 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    whole = [mesh.polyline(c + ring, closed=True) for c in centers[:4]]
    broken = []
    for c in centers[4:]:
        for angles in arcs(pieces, rng):
            broken.append(
                mesh.polyline(c + 0.12 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)[::-1])
            )
    found = sh.orientation([*whole, *broken], mesh)
    assert found.turned.tolist() == [True] * 4 + [False] * len(broken)
    with pytest.warns(InexactWarning, match="ran against about as much of the others"):
        phi = sh.signed_distance([*whole, *broken], mesh)
    exact = 0.12 - np.linalg.norm(mesh.vertices[:, None] - centers[None], axis=2).min(axis=1)
    assert np.abs(phi.values + exact).max() < 0.06


def test_a_large_broken_curve_among_small_ones():
    """A circle of five pieces round eight, each smaller than a triangle, that are holes of what it bounds."""
    mesh, radius = sphere(3), 0.05
    centers = centers_on_sphere(12, 0.35)
    centers = centers[np.arccos(np.clip(centers[:, 2], -1, 1)) < 1.2]
    holes, _ = circles(mesh, centers, radius, 3, 0.0)
    rng = np.random.default_rng(5)
    outer = [circle_on_sphere(np.array([0, 0, 1.0]), 1.4, angles) for angles in arcs(5, rng)]
    given = [mesh.polyline(p) for p in outer] + [hole.reversed() for hole in holes]
    wrong = np.isin(np.arange(len(given)), [1, 5, 6, 9])
    given = [c.reversed() if w else c for c, w in zip(given, wrong, strict=True)]
    phi = sh.signed_distance(given, mesh)
    assert phi.diagnostics.note(CurvesTaken).turned == np.flatnonzero(wrong).tolist()
    out = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    exact = np.minimum(
        1.4 - np.arccos(np.clip(out[:, 2], -1, 1)), np.arccos(np.clip(out @ centers.T, -1, 1)).min(axis=1) - radius
    )
    assert np.abs(phi.values - exact).max() < 0.06
