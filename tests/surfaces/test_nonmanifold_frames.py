"""Edges with more than two faces: heat that leaves one of them enters all others, whatever their order and sense."""

import numpy as np
import pytest

import signedheat as sh
from shapes.surface_cases import book, flipped


def loose_book(pages, n=12, seed=0):
    """A book whose pages are triangulated each in its own way, Delaunay."""
    mesh = book(pages, n)
    away = np.linalg.norm(mesh.vertices[:, :2], axis=1)
    along = mesh.vertices[:, 2]
    inner = (away > 1e-9) & (away < 1 - 1e-9) & (along > 1e-9) & (along < 1 - 1e-9)
    moved = np.random.default_rng(seed).uniform(-0.2 / n, 0.2 / n, (mesh.n_vertices, 2)) * inner[:, None]
    outward = np.where(away[:, None] > 1e-9, mesh.vertices / np.maximum(away, 1e-9)[:, None], 0) * [1, 1, 0]
    vertices = mesh.vertices + outward * moved[:, :1] + [0, 0, 1] * moved[:, 1:]
    page = np.round(np.arctan2(vertices[:, 1], vertices[:, 0]) * pages / (2 * np.pi)).astype(int) % pages
    return sh.TriangleMesh(vertices, mesh.faces), np.linalg.norm(vertices[:, :2], axis=1), page


@pytest.mark.parametrize("pages", [3, 4, 5])
@pytest.mark.parametrize("number", [0, 1, -1])
def test_distance_on_every_page_of_a_book(pages, number):
    mesh, away, page = loose_book(pages)
    exact = np.where(page == number % pages, away, -away) - 0.51
    exact[away < 1e-9] = -0.51
    beside = exact + 0.51 - 0.03  # in the very faces at the spine
    values = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.level_set(beside), sh.constraints.Free()).values
    assert np.sqrt(np.mean((values - beside) ** 2)) < 1e-9
    values = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.level_set(exact)).values
    assert np.sqrt(np.mean((values - exact) ** 2)) < 2e-3
    better = sh.intrinsic_delaunay(mesh, keep=mesh.level_set(exact), refine=True)
    values = sh.SignedHeatSolver(better, intrinsic=False).distance(mesh.level_set(exact)).restrict().values
    assert np.sqrt(np.mean((values - exact) ** 2)) < 2e-3


@pytest.mark.parametrize("seed", range(3))
def test_the_order_and_sense_of_faces_do_not_matter(seed):
    mesh, away, page = loose_book(3)
    exact = np.where((page == seed) & (away > 1e-9), away, -away) - 0.51
    order = np.random.default_rng(seed).permutation(mesh.n_faces)
    other = flipped(sh.TriangleMesh(mesh.vertices, mesh.faces[order]), seed=seed)
    one, two = (
        sh.SignedHeatSolver(m, intrinsic=False).distance(m.level_set(exact), sh.constraints.Free()).values
        for m in (mesh, other)
    )
    np.testing.assert_allclose(one, two, atol=1e-9)


def test_sources_on_different_pages_share_what_is_factorised():
    mesh, away, page = loose_book(3)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    curves = [mesh.level_set(np.where((page == k) & (away > 1e-9), away, -away) - 0.51) for k in (2, 2, 1)]
    one, two, three = (solver.discretization.adapt(c)[0] for c in curves)
    assert one is two is not solver.discretization and three.integration is solver.discretization.integration
    many = solver.distance_many(curves)
    for field, curve in zip(many, curves, strict=True):
        np.testing.assert_allclose(field.values, solver.distance(curve).values, atol=1e-12)


def test_a_curve_along_the_spine_keeps_its_left():
    mesh = book(3, 8)
    spine = mesh.path(np.arange(9))
    adapted = sh.SignedHeatSolver(mesh, intrinsic=False).discretization.adapt([spine])[0]
    assert adapted.triangles.leading_sides is None
    values = sh.SignedHeatSolver(mesh, intrinsic=False).distance(spine).values
    np.testing.assert_allclose(np.abs(values), np.linalg.norm(mesh.vertices[:, :2], axis=1), atol=1e-9)
