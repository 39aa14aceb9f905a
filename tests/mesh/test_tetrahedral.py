"""Tet meshes, their operators, clipping, and conjugate gradients."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from refusals import refused
from shapes.tet_cases import boxes, rectangle, sphere
from signedheat.linear import factorize
from signedheat.linear.incomplete_cholesky import IncompleteCholesky, outward_order
from signedheat.tets.tet_clipping import Planes, barycentric, clip_triangles, containing_tets


def dihedral_cotangents(corners: np.ndarray) -> dict[tuple[int, int], float]:
    """|e| cot θ at the edge between each two corners of a tet, from first principles."""
    found = {}
    for i in range(4):
        for j in range(i):
            k, m = (c for c in range(4) if c not in (i, j))
            edge = corners[j] - corners[i]
            length = np.linalg.norm(edge)
            a, b = (x - x @ edge * edge / length**2 for x in (corners[k] - corners[i], corners[m] - corners[i]))
            found[i, j] = found[j, i] = length * (a @ b) / np.linalg.norm(np.cross(a, b))
    return found


def test_laplacians_are_cotangents_of_dihedral_angles():
    corners = np.vstack([np.zeros(3), np.eye(3)]) + np.random.default_rng(3).uniform(-0.2, 0.2, (4, 3))
    mesh = sh.TetMesh(corners, [[0, 1, 2, 3]])
    cotangents = dihedral_cotangents(mesh.vertices[mesh.tets[0]])
    stiffness = mesh.geometry.vertex_laplacian(np.arange(4)[None], 4).toarray()
    faces = mesh.geometry.face_laplacian().toarray()
    for i in range(4):
        for j in range(i):
            k, m = (c for c in range(4) if c not in (i, j))
            assert stiffness[i, j] == pytest.approx(-cotangents[k, m] / 6, rel=1e-9)
            assert faces[i, j] == pytest.approx(-1.5 * cotangents[k, m], rel=1e-9)


def test_operators_know_linear_functions():
    mesh = boxes((4, 3, 3), 0.5, jitter=0.15)
    slope = np.array([0.3, -1.2, 0.7])
    at_vertices = mesh.vertices @ slope
    at_faces = mesh.vertices[mesh.faces.vertices].mean(axis=1) @ slope
    interior = mesh.faces.tet_counts == 2
    assert np.abs(mesh.geometry.face_laplacian() @ at_faces)[interior].max() < 1e-12
    stiffness = mesh.geometry.vertex_laplacian(mesh.tets, mesh.n_vertices)
    flux = mesh.geometry.divergence(np.tile(slope, (mesh.n_tets, 1)), mesh.tets, mesh.n_vertices)
    assert np.abs(stiffness @ at_vertices - flux).max() < 1e-12
    assert mesh.geometry.gradients(at_vertices[mesh.tets]) == pytest.approx(np.tile(slope, (mesh.n_tets, 1)))
    assert mesh.geometry.face_mass().sum() == pytest.approx(mesh.tet_volumes.sum())


def test_tets_given_inside_out_are_turned_and_listed():
    mesh = boxes((2, 2, 2), 1.0)
    tets = mesh.tets.copy()
    tets[[3, 7]] = tets[[3, 7]][:, [1, 0, 2, 3]]
    turned = sh.TetMesh(mesh.vertices, tets)
    assert turned.reoriented.tolist() == [3, 7]
    assert (turned.tet_volumes > 0).all()


def test_boundary_faces_outward():
    mesh = boxes((3, 2, 2), 1.0, jitter=0.1)
    boundary = mesh.boundary
    centers = boundary.vertices[boundary.faces].mean(axis=1)
    flux = np.einsum("fi,fi->", boundary.face_area_vectors, centers) / 3
    assert flux == pytest.approx(12.0)  # Gauss: the volume
    assert (boundary.edges.face_counts == 2).all()


@pytest.mark.parametrize(
    ("vertices", "tets", "element"),
    [
        (np.zeros((4, 3)), [[0, 1, 2, 3]], "vertices"),
        (np.eye(4, 3), [[0, 1, 2, 4]], "number 0"),
        (np.eye(4, 3), np.empty((0, 4), dtype=int), "tets"),
        (np.eye(4, 3), [[0, 1, 2]], "tets"),
        (np.eye(4, 3) * np.nan, [[0, 1, 2, 3]], "number 0"),
        (np.eye(4, 3), [[0.0, 1.0, 2.0, 3.0]], "tets"),
    ],
)
def test_bad_meshes_are_named(vertices, tets, element):
    with refused(sh.errors.GeometryError, element):
        sh.TetMesh(vertices, tets)


def test_clipping_conserves_area_vectors():
    mesh = boxes((4, 4, 4), 0.5, jitter=0.15)
    triangles = np.random.default_rng(5).uniform(0.05, 1.95, (300, 3, 3))
    pieces = clip_triangles(mesh.geometry, Planes.of(mesh.geometry), triangles)
    sums = np.zeros((300, 3))
    np.add.at(sums, pieces.parents, pieces.area_vectors)
    whole = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.abs(sums - whole).max() < 1e-13
    centers = np.einsum("pk,pki->pi", pieces.barycentric, mesh.vertices[mesh.tets[pieces.tets]])
    normals = whole / np.linalg.norm(whole, axis=1, keepdims=True)
    heights = np.einsum("pi,pi->p", centers - triangles[pieces.parents, 0], normals[pieces.parents])
    assert np.abs(heights).max() < 1e-12  # pieces lie in their triangles


def test_clipping_leaves_out_what_is_outside():
    mesh = boxes((2, 2, 2), 0.5)
    big = rectangle([-1, -1, 0.3], [3, 0, 0], [0, 3, 0])
    pieces = clip_triangles(mesh.geometry, Planes.of(mesh.geometry), big.vertices[big.faces])
    assert pieces.area_vectors.sum(axis=0) == pytest.approx([0, 0, 1], abs=1e-14)


def test_faces_of_the_mesh_are_recognised():
    mesh = boxes((3, 3, 3), 1.0, jitter=0.1)
    faces = mesh.faces.vertices
    pieces = clip_triangles(mesh.geometry, Planes.of(mesh.geometry), mesh.vertices[faces])
    assert (mesh.faces.tet_faces[pieces.tets, pieces.in_face] == pieces.parents).all()
    sums = np.bincount(pieces.parents, pieces.areas)
    exact = sh.TriangleMesh(mesh.vertices, faces).face_areas
    assert sums == pytest.approx(exact, rel=1e-12)


def test_sources_in_lattice_planes_count_once():
    mesh = boxes((4, 4, 4), 0.25)
    plane = rectangle([0, 0, 0.5], [1, 0, 0], [0, 1, 0])
    pieces = clip_triangles(mesh.geometry, Planes.of(mesh.geometry), plane.vertices[plane.faces])
    assert (pieces.in_face >= 0).all()
    assert pieces.areas.sum() == pytest.approx(1.0, rel=1e-13)


def test_points_are_located():
    mesh = boxes((3, 3, 3), 1.0, jitter=0.15)
    points = np.random.default_rng(1).uniform(-1, 4, (2000, 3))
    tets = containing_tets(mesh.geometry, Planes.of(mesh.geometry), points)
    inside = ((points >= 0) & (points <= 3)).all(axis=1)
    assert ((tets >= 0) == inside).all()
    weights = barycentric(mesh.geometry, tets[inside], points[inside])
    again = np.einsum("pk,pki->pi", weights, mesh.vertices[mesh.tets[tets[inside]]])
    assert again == pytest.approx(points[inside], abs=1e-12)


def heat_system(mesh: sh.TetMesh, spacings: float = 1.0) -> tuple[sparse.csr_matrix, np.ndarray, np.ndarray]:
    from signedheat.discretization import discretize

    discretization = discretize(mesh)
    source = discretization.lower([sphere(2, 0.4)], spacings)
    return discretization._heat_system(source.time).matrix, source.vectors, mesh.faces.tet_faces


def test_conjugate_gradients_keep_the_far_field():
    mesh = boxes((14, 14, 14), 0.25, jitter=0.1)
    mesh = sh.TetMesh(mesh.vertices - 0.6, mesh.tets)  # the source in a corner: far away X is 1e-14 of its maximum
    matrix, loads, tet_faces = heat_system(mesh)
    order = outward_order(matrix, np.flatnonzero(loads.any(axis=1)))
    iterated = IncompleteCholesky.of(matrix, order).solve(loads, relative=0.0, componentwise=1e-3)
    direct = factorize(matrix).solve(loads)
    sizes = np.abs(direct).max(axis=1)
    assert sizes.min() < 1e-12 * sizes.max()
    a, b = (x[tet_faces].mean(axis=1) for x in (iterated, direct))
    cosine = np.einsum("mi,mi->m", a, b) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine.min(), -1, 1))) < 0.1


def test_conjugate_gradients_solve_what_factors_solve():
    mesh = boxes((6, 6, 6), 1.0, jitter=0.2)
    stiffness = mesh.geometry.vertex_laplacian(mesh.tets, mesh.n_vertices)
    matrix = sparse.csr_matrix(stiffness + 0.1 * sparse.eye_array(mesh.n_vertices))
    rhs = np.random.default_rng(0).normal(size=mesh.n_vertices)
    iterated = IncompleteCholesky.of(matrix, np.arange(mesh.n_vertices)).solve(rhs, relative=1e-12)
    assert iterated == pytest.approx(factorize(matrix).solve(rhs), abs=1e-9)
