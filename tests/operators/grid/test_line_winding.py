"""Winding numbers of closed surfaces, counted along lines."""

import numpy as np
import pytest

from shapes.bodies import box, turned
from signedheat import Grid, samples
from signedheat.operators.grid.line_winding import closed_winding_numbers


def counted(mesh, grid):
    return closed_winding_numbers(((mesh.vertices - grid.origin) / grid.spacing)[mesh.faces], grid.shape)


def test_boxes_on_the_nodes_themselves():
    """Sides, edges and corners of the box run through nodes: those strictly inside count, those outside do not."""
    grid = Grid((0, 0, 0), 1.0, (9, 8, 7))
    winding = counted(box((2, 1, 1), (6, 5, 4)), grid)
    i, j, k = np.indices(grid.shape)
    inside = (i > 2) & (i < 6) & (j > 1) & (j < 5) & (k > 1) & (k < 4)
    outside = (i < 2) | (i > 6) | (j < 1) | (j > 5) | (k < 1) | (k > 4)
    assert (winding[inside] == 1).all() and (winding[outside] == 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_bodies_add_up(seed):
    """Balls at random places, one of them turned and partly beyond the grid: at each node those that hold it count."""
    rng = np.random.default_rng(seed)
    centers, radii = rng.uniform(-0.6, 0.6, (4, 3)), rng.uniform(0.3, 0.6, 4)
    centers[0] += 0.6
    balls = [samples.sphere(4, radius=r, center=c) for c, r in zip(centers, radii, strict=True)]
    grid = Grid((-1, -1, -1), 0.1, (21, 21, 21))
    winding = counted(samples.union(turned(balls[0]), *balls[1:]), grid)
    away = np.linalg.norm(grid.points[..., None, :] - centers, axis=-1) - radii
    truth = ((away < 0) * [-1, 1, 1, 1]).sum(axis=-1)
    clear = (np.abs(away) > 0.01).all(axis=-1)  # the balls are polyhedra
    assert clear.mean() > 0.8 and (winding[clear] == truth[clear]).all()


def test_a_hole_is_noticed():
    ball = samples.sphere(2)
    faces = ball.faces[np.argsort(ball.vertices[ball.faces].mean(axis=1)[:, 2])[:-8]]
    assert closed_winding_numbers((ball.vertices / 0.1 + 20)[faces], (41, 41, 41)) is None
