"""A floor plan: distance round walls
==================================

A floor plan: distance of every point from the north wall of a hall, through doors and around their posts. The floor is
a surface in the plane: squares where there is no wall.
"""

import numpy as np

import signedheat as sh
from signedheat import view

PLAN = """
XXXXXXXXXXXXXXXXXXXXXXXXX
X.......................X
X.......................X
X.......................X
XXXX.XXXXXX.XXXXXXXXX.XXX
X.......X...........X...X
X.......X...........X...X
X.......X...........X...X
X.......X...........X...X
X.......X...........X...X
XXXXXXXXXXXXXXXXXXXXXXXXX
"""
NORTH = 9.9
"""Where the line along the north wall is, in metres; a letter of the plan is a square of one metre."""


def squares(is_free: np.ndarray, side: float) -> sh.PolygonMesh:
    """The free ones of some squares in the plane as a mesh."""
    corners = np.argwhere(is_free)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
    points, ids = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return sh.PolygonMesh(np.pad(side * points, ((0, 0), (0, 1))), ids.reshape(-1, 4))


rows = np.array([list(row) for row in PLAN.split()])
floor = squares(np.kron(rows[::-1].T != "X", np.ones((4, 4), dtype=bool)), 0.25)
north = floor.polyline([[24.0, NORTH, 0], [1.0, NORTH, 0]])  # westward, so that the rooms lie to its left

phi = sh.signed_distance(north, floor)

phi.save("floor_plan.ply")
above = {"sources": [north], "view": np.array([0.0, 0.0, 1.0])}
view.save_row([("distance from the north wall, in metres", phi, above)], "floor_plan.png")

# %%
# Straight from the wall to the post of the middle door, at (11, 6), and on to a place in a corner of the room:
measured = float(phi([[9.5, 1.5, 0]])[0])
print(f"{measured:.4g}")
