"""Hypothesis strategies: triangle meshes of every kind, curves and points on them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.spatial import Delaunay

import signedheat as sh

from .surface_cases import band, book, sphere, square

seeds = st.integers(0, 2**32 - 1)


@st.composite
def sheared_squares(draw: st.DrawFn) -> sh.TriangleMesh:
    """A jittered square, sheared and stretched by up to a hundred."""
    mesh = square(draw(st.integers(3, 7)), jitter=0.3, seed=draw(seeds))
    stretch, shear = draw(st.floats(1.0, 100.0)), draw(st.floats(-5.0, 5.0))
    x, y, z = mesh.vertices.T
    return sh.TriangleMesh(np.stack([stretch * x + shear * y, y, z], axis=1), mesh.faces)


@st.composite
def terrains(draw: st.DrawFn) -> sh.TriangleMesh:
    """A Delaunay triangulation of random points in the plane, lifted by random heights."""
    rng = np.random.default_rng(draw(seeds))
    points = rng.random((draw(st.integers(6, 40)), 2))
    heights = draw(st.floats(0.0, 2.0)) * rng.random(len(points))
    return sh.TriangleMesh(np.column_stack([points, heights]), Delaunay(points).simplices)


@st.composite
def turned(draw: st.DrawFn, meshes: st.SearchStrategy[sh.TriangleMesh]) -> sh.TriangleMesh:
    """A mesh with some faces turned over."""
    mesh = draw(meshes)
    over = np.random.default_rng(draw(seeds)).random(mesh.n_faces) < draw(st.sampled_from([0.0, 0.3, 1.0]))
    return sh.TriangleMesh(mesh.vertices, np.where(over[:, None], mesh.faces[:, ::-1], mesh.faces))


fixed = st.sampled_from([sphere(2), band(12, 3, True), band(12, 3, False), book(3, 4), book(4, 3)])
meshes = turned(st.one_of(sheared_squares(), terrains(), fixed))


@st.composite
def surface_points(draw: st.DrawFn, mesh: sh.TriangleMesh, least: int = 1, most: int = 12) -> sh.SurfacePoints:
    """Points in faces, on edges and at vertices."""
    rng, n = np.random.default_rng(draw(seeds)), draw(st.integers(least, most))
    weights = rng.dirichlet(np.ones(3), n)
    weights[rng.random((n, 3)) < 0.2] = 0.0
    weights[weights.sum(axis=1) == 0, 0] = 1.0
    return sh.SurfacePoints(rng.integers(0, mesh.n_faces, n), weights / weights.sum(axis=1, keepdims=True))


def in_space(mesh: sh.TriangleMesh, points: sh.SurfacePoints | sh.Curve) -> np.ndarray:
    """(n, 3) positions."""
    return np.einsum("ik,ikj->ij", points.barycentric, mesh.vertices[mesh.faces[points.faces]])
