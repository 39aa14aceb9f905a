"""Sides in a band where the nearest face does not tell them."""

import numpy as np

import signedheat as sh
from shapes.bodies import box
from signedheat import samples


def band_values(shapes, grid, cells=3):
    """Nodes of a band, and their values."""
    band = sh.solid_distance(shapes, grid, band=cells * float(grid.spacing.max()))
    nodes = band.blocks.places[:, None] * 8 + np.argwhere(np.ones((8, 8, 8)))
    values = band.values.ravel()
    kept = np.isfinite(values)
    return (grid.origin + nodes.reshape(-1, 3) * grid.spacing)[kept], values[kept]


def test_where_bodies_touch_all_is_inside():
    """Two faces lie on each other there, each as near as the other, and only one tells the right side."""
    bodies = [box((-1, -1, -0.3), (1, 1, 0)), box((-0.31, -0.17, 0), (0.23, 0.41, 0.5))]
    grid = sh.Grid((-1.21, -1.223, -0.51), 2.5 / 140, (141, 141, 67))
    nodes, values = band_values(bodies, grid)
    inner = ((nodes > [-0.31, -0.17, -0.3]) & (nodes < [0.23, 0.41, 0.5])).all(axis=1)
    on_it = inner & (np.abs(nodes[:, 2]) < 0.03)
    assert on_it.sum() > 500
    assert (values[on_it] < 0).all()
    free = (nodes[:, 2] > 0) & ~((nodes >= [-0.31, -0.17, 0]) & (nodes <= [0.23, 0.41, 0.5])).all(axis=1)
    assert (values[free] > 0).all()


def test_beside_a_fin_without_thickness_all_is_outside():
    """Its two sides are cut into triangles along different diagonals: no face is the other's copy."""
    corners = np.array([[1.0, -0.4, -0.4], [1.8, -0.4, -0.4], [1.8, 0.4, 0.4], [1.0, 0.4, 0.4]])
    fin = sh.TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]))
    grid = sh.Grid((-0.21, -0.72, -0.73), 2.2 / 140, (141, 91, 91))
    nodes, values = band_values(samples.union(box((0, -0.5, -0.5), (1, 0.5, 0.5)), fin), grid)
    beyond = nodes[:, 0] > 1
    assert beyond.sum() > 10_000
    assert (values[beyond] > 0).all()
