"""Nodes of a band that are on one side amid nodes on the other."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import signedheat as sh
from signedheat import samples
from signedheat.extensions.band_specks import MOST, without_specks
from signedheat.operators.grid.blocks import Blocks, block_points

SHAPE = (24, 24, 24)


@pytest.fixture
def ball():
    """Blocks of a grid, all there, and a function that is negative in a ball in its middle."""
    blocks = Blocks.of(np.argwhere(np.ones((3, 3, 3), dtype=bool)), SHAPE)
    points = block_points(blocks.places, np.ones(3)).reshape(27, 512, 3)
    return blocks, points, np.linalg.norm(points - 11.5, axis=2) - 7.3


def cleared(blocks, function, told=None):
    """What is left of a function, and where it differs."""
    result = function.copy()
    without_specks(blocks, result, np.zeros(function.shape, dtype=bool) if told is None else told)
    return result, result != function


def nodes_of(points, *nodes):
    """Which of (27, 512, 3) points are at the given nodes."""
    return (points[..., None, :] == np.array(nodes, dtype=float)).all(axis=-1).any(axis=-1)


def test_what_is_smooth_stays(ball):
    blocks, _, function = ball
    assert not cleared(blocks, function)[1].any()


@pytest.mark.parametrize(
    "nodes",
    [
        [(11, 11, 11)],
        [(7, 8, 12), (8, 8, 12), (8, 8, 11)],  # across the seams of blocks
        [tuple(8 + np.array(corner)) for corner in np.ndindex(2, 2, 2)],
        [(2, 2, 2)],
    ],
)
def test_specks_of_either_side_get_the_side_around_them(ball, nodes):
    blocks, points, function = ball
    speck = nodes_of(points, *nodes)
    broken = np.where(speck, -0.1 * np.sign(function), function)
    result, changed = cleared(blocks, broken)
    assert (changed == speck).all()
    assert (np.sign(result) == np.sign(function)).all()
    assert (np.abs(result[speck]) > 1).all()  # the mean of those around


def test_what_faces_tell_is_larger_or_reaches_what_is_not_known_stays(ball):
    blocks, points, function = ball
    one = nodes_of(points, (11, 11, 11))
    broken = np.where(one, 0.1, function)
    assert not cleared(blocks, broken, one)[1].any()
    larger = nodes_of(points, *[(8 + k, 11, 11) for k in range(MOST + 1)])
    assert not cleared(blocks, np.where(larger, 0.1, function))[1].any()
    at_wall = nodes_of(points, (0, 11, 11))
    assert not cleared(blocks, np.where(at_wall, -0.1, function))[1].any()
    some = np.flatnonzero((blocks.places != [1, 1, 2]).any(axis=1))  # the node at its seam has an unknown neighbour
    seam = np.where(nodes_of(points, (11, 11, 15)), 0.1, function)
    assert cleared(blocks, seam)[1].any()
    assert not cleared(Blocks(blocks.places[some], SHAPE), seam[some])[1].any()


def test_a_sphere_without_most_of_its_faces_has_a_surface_in_one_part():
    """Winding numbers between few faces are rough: single nodes fall to the other side of their level."""
    broken = samples.without_faces(samples.sphere(3), 0.6, seed=9)
    grid = sh.Grid.around(broken.bounds, 56)
    surface = sh.solid_distance(broken, grid, band=3 * float(grid.spacing[0])).contour()
    a, b = surface.faces[:, [0, 1, 1, 2]].reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(surface.n_vertices,) * 2)
    assert connected_components(graph, directed=False)[0] == 1
