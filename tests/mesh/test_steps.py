"""Single steps on meshes, on input so small that their results are known."""

from __future__ import annotations

import numpy as np
import pytest

from signedheat.mesh.edges import edge_table, orient_faces, pair_halfedges
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh, mollify
from signedheat.mesh.polylines import assemble_polylines, filled_outlines, leaving, without_seams
from signedheat.mesh.unit_vectors import unit


def test_edges_of_two_triangles_are_numbered_by_first_appearance():
    table = edge_table(np.array([[0, 1, 2], [2, 1, 3]]))
    assert table.vertices.tolist() == [[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]]
    assert table.face_edges.tolist() == [[0, 1, 2], [1, 3, 4]]


def test_halfedges_of_a_common_edge_are_paired():
    pairs = pair_halfedges(np.array([0, 1, 2, 2, 1, 3]), np.array([1, 2, 0, 1, 3, 2]), 4)
    assert pairs.edges.tolist() == [0, 1, 2, 1, 3, 4]
    assert pairs.second.tolist() == [-1, 3, -1, -1, -1]


def test_of_two_faces_that_disagree_the_lighter_one_turns():
    orientation = orient_faces(np.array([[0, 1, 2], [2, 3, 1]]), np.array([1.0, 2.0]), 4)
    assert orientation.turned.tolist() == [True, False]
    assert orientation.orientable.tolist() == [True] and orientation.disagreeing == 1


def test_a_right_triangle_is_laid_out_from_its_lengths():
    flat = IntrinsicMesh.from_lengths(np.array([[0, 1, 2]]), np.array([[4.0, 5.0, 3.0]]), 3)
    assert flat.corner_positions.tolist() == [[0, 4, 3j]]


def test_a_flat_triangle_is_mollified_to_its_margin():
    lengths, added = mollify(np.array([[1.0, 1.0, 2.0]]), 0.09375)
    assert lengths.tolist() == [[1.125, 1.125, 2.125]] and added == 0.125


SQUARE = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])


@pytest.mark.parametrize(("rule", "count"), [("nonzero", 1), ("evenodd", 2)])
def test_a_square_in_a_square_is_a_hole_by_one_rule_only(rule, count):
    pytest.importorskip("manifold3d")
    assert len(filled_outlines([SQUARE, 1 + SQUARE / 2], rule)) == count


def test_an_outline_that_runs_the_other_way_is_a_hole_where_it_is_within():
    pytest.importorskip("manifold3d")
    assert [len(filled_outlines([SQUARE, inner[::-1]], "nonzero")) for inner in (1 + SQUARE / 2, 2 + SQUARE)] == [2, 1]


def test_a_spike_of_an_outline_goes():
    spike = np.array([[0.0, 0], [2, 0], [2, 1], [1, 0]])
    segments = without_seams(np.stack([spike, np.roll(spike, -1, axis=0)], axis=1))
    assert sorted(segments.tolist()) == [[[1.0, 0.0], [2.0, 0.0]], [[2.0, 0.0], [2.0, 1.0]], [[2.0, 1.0], [1.0, 0.0]]]


def test_segments_are_joined_end_to_end():
    lines = assemble_polylines(np.array([1, 0, 5]), np.array([2, 1, 5]))
    assert [(segments.tolist(), closed) for segments, _, closed in lines] == [([1, 0], False), ([2], True)]


def test_points_that_are_left_for_another_place():
    assert leaving(np.array([[0.0], [0.0], [1.0], [1.1]]), False, np.full(4, 0.5)).tolist() == [1, 3]
    assert leaving(np.array([[0.0], [1.0], [2.0], [0.0]]), True, np.zeros(4)).tolist() == [0, 1, 2]


def test_unit_vectors_do_not_underflow():
    np.testing.assert_allclose(unit(np.array([[3e-300, 4e-300], [0.0, 0.0]])), [[0.6, 0.8], [0.0, 0.0]])
    np.testing.assert_allclose(unit(np.array([3e-300 + 4e-300j])), [0.6 + 0.8j])


@pytest.mark.parametrize("shape", [(70_000, 3), (3, 70_000, 3), (300, 300, 3), (2, 200, 200, 2)])
def test_many_unit_vectors_are_those_of_each(shape):
    vectors = np.random.default_rng(0).normal(size=shape)
    expected = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    np.testing.assert_allclose(unit(vectors), expected, rtol=1e-12)
    np.testing.assert_allclose(unit(vectors, overwrite=True), expected, rtol=1e-12)
