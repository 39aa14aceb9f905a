"""Distance to walls, round obstacles
==================================

A whole application: what a flow solver wants to know in a channel with blocks: how far is it to the next wall, and how
far from the inlet along the way that a fluid would take?
"""

import numpy as np

import signedheat as sh
from signedheat import view


def squares(is_free: np.ndarray, side: float) -> sh.PolygonMesh:
    """The free ones of some squares in the plane as a mesh."""
    corners = np.argwhere(is_free)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
    points, ids = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return sh.PolygonMesh(np.pad(side * points, ((0, 0), (0, 1))), ids.reshape(-1, 4))


grid = sh.Grid((0.0, 0.0), 0.0125, (241, 97))
x, y = np.moveaxis(grid.points, -1, 0)
blocks = (np.abs(x - 1.3) < 0.1) & (y < 0.7) | (np.abs(x - 2.1) < 0.15) & (y > 0.5)
solid = blocks | (y < 0.1) | (y > 1.1)

walls = sh.Polyline.from_mask(solid, spacing=grid.spacing)
to_walls = ~sh.signed_distance([line.reversed() for line in walls], grid)
free = sh.Field(grid, np.where(solid, np.nan, np.abs(to_walls.values)))

channel = squares(~solid[::4, ::4], 0.05)
inlet = channel.polyline([[0.05, 1.1, 0.0], [0.05, 0.15, 0.0]])
from_inlet = sh.signed_distance(inlet, channel)

view.save_row(
    [
        ("to the nearest wall", free),
        ("from the inlet, round the blocks", from_inlet, {"sources": [inlet], "view": np.array([0.0, 0.0, 1.0])}),
    ],
    "wall_distance.png",
)

# %%
# Largest distance from a wall in the free channel of width 1:
measured = float(np.nanmax(free.values[x < 0.6]))
print(f"{measured:.4g}")
