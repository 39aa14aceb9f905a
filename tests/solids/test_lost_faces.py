"""Small holes are closed by the faces that were lost there."""

import numpy as np
import pytest

from signedheat import samples
from signedheat.mesh.edges import edge_table
from signedheat.solids.closing import LOST_FACE_SIDES, small_lids


def unordered(faces):
    return {tuple(sorted(face)) for face in faces.tolist()}


def ring_with_lid_missing(n, height):
    """A cone of n sides without its tip, above a disc: a loop of n sides around the axis is open."""
    angles = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(n)], axis=1)
    vertices = np.concatenate([circle, 0.3 * circle + [0, 0, height], [[0.0, 0, 0]]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([k, after, n + after], 1), np.stack([k, n + after, n + k], 1)])
    return vertices, np.concatenate([sides, np.stack([after, k, np.full(n, 2 * n)], 1)])


@pytest.mark.parametrize("share", [0.02, 0.15])
def test_faces_lost_at_random_are_found_but_for_diagonals(share):
    sphere = samples.sphere(4)
    lost = np.random.default_rng(1).random(sphere.n_faces) < share
    found = small_lids(sphere.vertices, sphere.faces[~lost])
    assert len(found) == lost.sum()
    again = unordered(found) & unordered(sphere.faces[lost])
    assert len(again) >= 0.85 * lost.sum()
    table = edge_table(np.concatenate([sphere.faces[~lost], found]))
    assert (table.face_counts == 2).all()
    assert (np.bincount(table.face_edges.ravel(), np.where(table.forward.ravel(), 1, -1)) == 0).all()


def test_one_lost_face_of_each_kind():
    sphere = samples.sphere(2)
    for k in (0, 17, 99):
        assert unordered(small_lids(sphere.vertices, np.delete(sphere.faces, k, axis=0))) == unordered(
            sphere.faces[[k]]
        )


def test_holes_that_touch_at_a_vertex_are_two():
    sphere = samples.sphere(3)
    first = sphere.faces[0]
    touching = (sphere.faces == first[0]).any(axis=1) & (np.isin(sphere.faces, first).sum(axis=1) == 1)
    lost = np.array([0, np.flatnonzero(touching)[0]])
    found = small_lids(sphere.vertices, np.delete(sphere.faces, lost, axis=0))
    assert unordered(found) == unordered(sphere.faces[lost])


@pytest.mark.parametrize("height", [0.1, 3.0])
def test_a_small_hole_is_closed_where_the_surface_goes_on_across_it(height):
    """Around 90° the lid does not go on as the sides do: they may be the end of something longer."""
    for n in (6, 8, LOST_FACE_SIDES + 1):
        vertices, faces = ring_with_lid_missing(n, height)
        goes_on = height < 1 and n <= LOST_FACE_SIDES
        assert len(small_lids(vertices, faces)) == (n - 2 if goes_on else 0)


def test_faces_and_strips_that_hang_on_nothing_get_no_back():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2], [2, 1, 0.5], [5, 5, 5], [6, 5, 5], [5, 6, 5]])
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4], [5, 6, 7]])
    assert not len(small_lids(vertices, faces))
    assert not len(small_lids(vertices, faces[:0]))
