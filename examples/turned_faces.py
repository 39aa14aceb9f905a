"""Turned faces
============

Half of the faces of a shape look inwards, at random. Winding numbers cancel; orientation is found and mended first.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (0.0, 0.005)
"""Largest error of the distance to the unit sphere, whose faces are flat by at most 0.001."""


def main(folder: Path) -> float:
    """Write a picture; return the largest error."""
    shape = samples.with_flipped_faces(samples.sphere(5), 0.5)
    grid = sh.Grid.around(shape.bounds, 64)
    plain, mended = sh.sharpen(sh.SignedHeatSolver(grid).distance(shape)), sh.signed_distance(shape, grid)
    turned = sh.orientation(shape).turned_faces

    view.save_row(
        folder / "turned_faces.png",
        ("half of the faces turned (red)", shape),
        (f"sh.orient: {turned} turned back", sh.orient(shape)),
        ("as they were given", plain, {"shape": shape, "across": (1,)}),
        ("signed_distance", mended, {"shape": shape, "across": (1,)}),
    )
    return float(np.abs(np.linalg.norm(grid.points, axis=-1) - 1 - mended.values).max())


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
