"""The published implementation, side by side: the same numbers where the definitions are the same."""

from dataclasses import replace

import numpy as np
import potpourri3d as pp3d
import pytest
from scipy import sparse

import signedheat as sh
from shapes.surface_cases import sphere, square
from shapes.surfaces import surface_of_revolution
from signedheat.linear import factorize, whole
from signedheat.mesh.edges import edge_table
from signedheat.method import diffuse, normalize
from signedheat.surfaces.surface_source import oriented_vectors


def bumpy():
    mesh = sphere(3)
    x, y, z = mesh.vertices.T
    return sh.TriangleMesh(mesh.vertices * (1 + 0.2 * np.sin(5 * x + y) * np.cos(4 * y + z))[:, None], mesh.faces)


MESHES = {
    "sphere": (bumpy(), [0.0, 0.1, 1.0], 0.2),
    "square": (square(17, jitter=0.25), [0.9, 0.3, 0.0], 0.1),
    "frustum": (surface_of_revolution(lambda z: 1 + 0.3 * z, 2.0, 40, 14), [0.0, 0.3, 1.0], 0.9),
}
every_mesh = pytest.mark.parametrize("name", MESHES)
CONSTRAINTS = {
    "None": sh.constraints.Free(),
    "ZeroSet": sh.constraints.ZeroSet(hard=True),
    "Multiple": sh.constraints.EachComponent(hard=True),
}


def nodes(mesh, curve):
    """A curve as potpourri3d takes it: (vertex, []), (edge, [t]) or (face, barycentric)."""
    ends = {tuple(sorted(edge)): k for k, edge in enumerate(mesh.edges.vertices.tolist())}
    result = []
    for face, weights in zip(curve.faces, curve.barycentric, strict=True):
        inside = np.flatnonzero(weights > 1e-14)
        ids = mesh.faces[face][inside]
        if len(inside) == 1:
            result.append((int(ids[0]), []))
        elif len(inside) == 2:
            edge = ends[tuple(sorted(ids.tolist()))]
            result.append((edge, [float(weights[inside][ids == mesh.edges.vertices[edge, 1]][0])]))
        else:
            result.append((int(face), weights.tolist()))
    return [*result, result[0]] if curve.closed else result


def peer(mesh, curves, constraint="None", tau=1.0, **options):
    solver = pp3d.MeshSignedHeatSolver(np.array(mesh.vertices), np.array(mesh.faces), t_coef=tau)
    return np.asarray(
        solver.compute_distance([nodes(mesh, c) for c in curves], level_set_constraint=constraint, **options)
    )


def level_curves(name):
    mesh, direction, level = MESHES[name]
    return mesh, mesh.level_set(mesh.vertices @ direction, level)


@every_mesh
def test_edges_have_the_same_numbers(name):
    mesh = MESHES[name][0]
    assert np.array_equal(pp3d.edges(mesh.vertices, mesh.faces), edge_table(mesh.faces).vertices)


@every_mesh
@pytest.mark.parametrize("constraint", ["None", "ZeroSet"])
@pytest.mark.parametrize("tau", [1.0, 25.0])
def test_curves_across_faces(name, constraint, tau):
    mesh, curves = level_curves(name)
    theirs = peer(mesh, curves, constraint, tau)
    ours = sh.SignedHeatSolver(mesh, tau, intrinsic=False).distance(curves, CONSTRAINTS[constraint]).values
    np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.ptp(theirs))


@every_mesh
@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_curves_along_edges(name, constraint):
    mesh, direction, level = MESHES[name]
    height = mesh.vertices @ direction
    above = height[mesh.faces].mean(axis=1)
    curves = mesh.region_boundary(above > level) + mesh.region_boundary(above > level + 0.45)
    curves = [c for c in curves if c.n_points > 8][:2]
    theirs = peer(mesh, curves, constraint)
    ours = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curves, CONSTRAINTS[constraint])
    shift = (
        ours.source.weights @ (ours.source.interpolation @ theirs) / ours.source.weights.sum()
    )  # theirs is centred otherwise
    if constraint == "Multiple":
        theirs = theirs - shift
    np.testing.assert_allclose(ours.values, theirs, atol=1e-9 * np.ptp(theirs))


@every_mesh
def test_soft_constraint_of_the_published_code_from_our_matrices(name):
    """It pulls all nodes to the FIRST one, whatever their spacing; our C and b, so penalised, give its numbers."""
    mesh, curves = level_curves(name)
    surface = sh.SignedHeatSolver(mesh, intrinsic=False).discretization
    source = surface.lower(surface.adapt(curves[:1])[1], 1.0)
    load = surface.divergence(normalize(surface, diffuse(surface, source)))
    to_first = source.interpolation[1:] - source.interpolation[np.zeros(source.interpolation.shape[0] - 1, dtype=int)]
    ground = sparse.csr_matrix(([1.0], ([0], [0])), shape=surface.stiffness.shape)
    for weight in (0.5, 50.0):
        theirs = peer(mesh, curves[:1], "ZeroSet", soft_level_set_weight=weight)
        matrix = whole(surface.stiffness) + weight * (to_first.T @ to_first) + ground
        assert np.ptp(factorize(matrix).solve(load) - theirs) < 1e-9 * np.ptp(theirs)


def test_our_soft_constraint_keeps_its_meaning_when_scaled():
    """λ has unit 1/length; the published code's answer changes with the unit, and with where a loop starts."""
    mesh, curves = level_curves("sphere")
    curve, scale = curves[0], 1000.0
    large = sh.TriangleMesh(scale * mesh.vertices, mesh.faces)
    turned = sh.Curve(np.roll(curve.faces, 20), np.roll(curve.barycentric, 20, axis=0), closed=True)
    phi = sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(curve, sh.constraints.Soft(10.0)).values
    scaled = sh.SignedHeatSolver(large, 1.0, intrinsic=False).distance(curve, sh.constraints.Soft(10.0 / scale)).values
    np.testing.assert_allclose(scaled, scale * phi, atol=1e-9 * scale)
    np.testing.assert_allclose(
        sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(turned, sh.constraints.Soft(10.0)).values,
        phi,
        atol=1e-10,
    )
    theirs = peer(mesh, [curve], "ZeroSet", soft_level_set_weight=10.0)
    theirs_scaled = peer(large, [curve], "ZeroSet", soft_level_set_weight=10.0 / scale)
    assert np.abs(theirs_scaled - scale * theirs).max() > 1e-4 * np.ptp(theirs_scaled)


def test_segments_inside_faces_weigh_as_much_as_those_on_edges():
    """A line partly on edges, moved off them by a hair: with three times the weight inside, as published, φ jumps."""
    mesh = square(33)
    solver = sh.SignedHeatSolver(mesh, intrinsic=False)
    surface = solver.discretization
    x = np.linspace(-1, 1, 65)

    def fields(shift):
        line = np.stack([x, np.where(x < 0, 0.0, 0.025) + shift, np.zeros_like(x)], axis=1)
        (((piece,),),) = [surface.adapt([mesh.polyline(line, closed=False)])[1]]
        source = surface.lower([[piece]], 1.0)
        heavier = np.where(piece.edges < 0, 3, 1) * piece.vectors
        for vectors in (piece.vectors, heavier):
            sums = oriented_vectors(surface.triangles, [replace(piece, vectors=vectors)])
            directions = normalize(surface, diffuse(surface, replace(source, vectors=sums)))
            yield surface.integration.solve(surface.divergence(directions), source)

    (ours, theirs), (ours_moved, theirs_moved) = fields(0.0), fields(1e-6)
    assert np.std(ours_moved - ours) < 0.3 * np.std(theirs_moved - theirs)
