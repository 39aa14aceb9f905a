"""What holds of every intrinsic triangulation, of whatever mesh."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import signedheat as sh
from shapes.strategies import in_space, meshes, surface_points
from signedheat.mesh.gluing import flip_all, glue, lay_out
from signedheat.surfaces.source_segments import segments_of


@given(meshes, st.booleans())
def test_area_and_topology_stay(mesh, refine):
    better = sh.intrinsic_delaunay(mesh, refine=refine)
    old, new = better.base, better.triangles
    assert abs(new.face_areas.sum() / old.face_areas.sum() - 1) < 1e-9
    assert new.n_vertices - new.n_edges + new.n_faces == old.n_vertices - old.n_edges + old.n_faces
    np.testing.assert_array_equal(better.vertices[: mesh.n_vertices], mesh.vertices)


@given(meshes)
def test_flips_end_in_delaunay_triangles_and_repeat_nothing(mesh):
    flipped = sh.intrinsic_delaunay(mesh).triangles
    edges, opposite = flipped.edges.face_edges.ravel(), np.roll(flipped_angles(flipped), -2, axis=1).ravel()
    sums = np.bincount(edges, opposite, flipped.n_edges)
    assert (sums[flipped.edges.face_counts == 2] < np.pi + 1e-6).all()
    again = lay_out(flip_all(glue(flipped)))
    np.testing.assert_allclose(np.sort(again.edge_lengths, axis=None), np.sort(flipped.edge_lengths, axis=None))


def flipped_angles(triangles):
    """(m, 3) angle at each corner; the edge from corner k to k + 1 lies opposite corner k + 2."""
    leaving = triangles.edge_vectors
    return np.angle(-np.conj(leaving) * np.roll(leaving, 1, axis=1))


@given(st.data(), meshes, st.booleans())
def test_points_of_the_mesh_stay_where_they_are(data, mesh, refine):
    points = data.draw(surface_points(mesh))
    better = sh.intrinsic_delaunay(mesh, refine=refine)
    faces, weights = better.locate(points.faces, points.barycentric)
    assert (weights >= 0).all()
    there = better.history.backward(faces, weights)
    back = better.in_space(*better.refinement.pull_back(*there[:2]))
    assert np.abs(back - in_space(mesh, points)).max() < 1e-7 * np.ptp(mesh.vertices)


@given(st.data(), meshes, st.booleans())
def test_curves_keep_their_length(data, mesh, refine):
    points = data.draw(surface_points(mesh, 2, 4))
    try:
        curve = sh.Curve(points.faces, points.barycentric)
        length = segments_of(curve, sh.intrinsic_delaunay(mesh).base, mesh.vertices).lengths.sum()
    except sh.errors.SourceError:  # points that coincide, or on different components
        return
    better = sh.intrinsic_delaunay(mesh, refine=refine)
    assert abs(better.transfer(curve).lengths.sum() / length - 1) < 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_edges_of_a_boundary_keep_their_length_where_refinement_puts_vertices_in_their_middle(seed):
    corner = np.arange(20).reshape(4, 5)
    a, b, c, d = (corner[i, j].ravel() for i, j in product((slice(None, -1), slice(1, None)), repeat=2))
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    mesh = sh.TriangleMesh(np.random.default_rng(seed).random((20, 3)), faces)
    history = sh.intrinsic_delaunay(mesh, refine=True).history
    lines, after = history.edges_after(), history.after
    pieces = np.abs(((lines.ends - lines.starts) * after.corner_positions[lines.faces]).sum(axis=1))
    lengths = np.empty(history.before.n_edges)
    lengths[history.before.edges.face_edges] = history.before.edge_lengths
    np.testing.assert_allclose(np.bincount(lines.owners, pieces, len(lengths)), lengths, rtol=1e-9)
