"""A floor plan: distance round walls
==================================

A floor plan: distance of every point from the north wall of a hall, through doors and around their posts.
"""

from pathlib import Path

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
METRE = 8
"""Nodes along a letter of the plan, which stands for a square of one metre."""
NORTH = 10.0 - 0.5 / METRE
"""Where the last nodes before the north wall are."""
EXPECTED = (NORTH - 6.0 + np.hypot(1.5, 4.5), 0.1)
"""Straight from the wall to the post of the middle door, at (11, 6), and on to a place in a corner of the room."""


def main(folder: Path) -> float:
    """Write the field and a picture; return the distance of a place in the middle room, in metres."""
    rows = np.array([list(row) for row in PLAN.split()])
    walls = np.kron(rows[::-1].T == "X", np.ones((METRE, METRE), dtype=bool))
    grid = sh.Grid(origin=(0.5 / METRE, 0.5 / METRE), spacing=1 / METRE, shape=walls.shape, mask=walls)
    north = sh.Polyline([[24.0, NORTH], [1.0, NORTH]])  # westward, so that the rooms lie to its left

    phi = sh.signed_distance(north, grid)

    phi.save(folder / "floor_plan.npz")
    view.save_slices(phi, folder / "floor_plan.png", north)
    return float(phi([[9.5, 1.5]])[0])


if __name__ == "__main__":
    print(f"distance {main(Path('.')):.3f} m, expected {EXPECTED[0]:.3f} m")
