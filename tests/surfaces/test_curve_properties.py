"""What holds of every curve, on whatever mesh."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import signedheat as sh
from shapes.strategies import in_space, meshes, seeds, sheared_squares, surface_points
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh
from signedheat.surfaces.source_segments import segments_of


def intrinsic(mesh):
    return IntrinsicMesh.from_lengths(mesh.faces, mesh.edge_lengths[mesh.edges.face_edges], mesh.n_vertices, mesh.edges)


@given(st.data(), sheared_squares())
def test_joined_points_are_joined_by_straight_lines_on_the_plane(data, mesh):
    at = data.draw(surface_points(mesh, 2, 5))
    points = in_space(mesh, at)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    if length > 1e-6:
        segments = segments_of(sh.Curve(at.faces, at.barycentric), intrinsic(mesh))
        assert abs(segments.lengths.sum() / length - 1) < 1e-9


@given(st.data(), meshes)
def test_segments_lie_in_faces_and_join_end_to_end(data, mesh):
    at = data.draw(surface_points(mesh, 2, 6))
    try:
        segments = segments_of(sh.Curve(at.faces, at.barycentric), intrinsic(mesh))
    except sh.errors.SourceError:
        return
    assert (segments.ends[1:, 0] == segments.ends[:-1, 1]).all()
    ends = in_space(mesh, sh.SurfacePoints(segments.nodes.faces, segments.nodes.barycentric))[segments.ends]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(segments.lengths, lengths, atol=1e-9 * np.ptp(mesh.vertices))


@given(meshes, seeds)
def test_level_sets_pass_through_points_at_the_level_and_turn_with_the_function(mesh, seed):
    values = np.random.default_rng(seed).normal(size=mesh.n_vertices)
    curves, turned = mesh.level_set(values, 0.1), mesh.level_set(-values, -0.1)
    for curve in curves:
        there = np.einsum("ik,ik->i", curve.barycentric, values[mesh.faces[curve.faces]])
        assert np.abs(there - 0.1).max() < 1e-12 * np.abs(values).max()
    assert sum(c.n_segments for c in curves) == sum(c.n_segments for c in turned)
