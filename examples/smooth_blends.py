"""Smooth blends
=============

A fillet where two solids meet, of a width that is chosen.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, visualization

EXPECTED = (0.125, 0.01)
"""How far the blend of width 0.5 goes beyond the sharp edge: a quarter of the width, over the gradient there."""


def main(folder: Path) -> float:
    """Write a picture; return the largest difference of the fields."""
    grid = sh.Grid((-1.8, -1.4, -1.4), 0.06, (61, 48, 48))
    ball = sh.solid_distance(samples.sphere(4, 0.8, (-0.5, 0, 0)), grid)
    ring = sh.solid_distance(samples.torus(0.8, 0.25), grid)
    blends = {width: sh.smooth_union(ball, ring, width) for width in (0.0, 0.2, 0.5)}

    visualization.save_row(
        folder / "smooth_blends.png",
        *((f"width {width:g}", field.contour(), {"view": (30, -60)}) for width, field in blends.items()),
    )
    return float(np.abs(blends[0.5].values - blends[0.0].values).max())


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
