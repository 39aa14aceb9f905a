"""Union, intersection and difference
==================================

Fields are combined like sets: the sign is right at once, and sharpening makes the result distance again.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (2 * np.pi / 3 * 0.75**2 * (3 - 0.75), 0.06)
"""Volume common to two unit balls 0.5 apart: two caps of height 0.75."""


def main(folder: Path) -> float:
    """Write a picture; return the volume of the intersection."""
    grid = sh.Grid((-1.6, -1.4, -1.4), 0.05, (75, 57, 57))
    left, right = (sh.signed_distance(samples.sphere(4, center=(x, 0, 0)), grid) for x in (-0.25, 0.25))
    sets = {"a | b": left | right, "a & b": left & right, "a - b": left - right}

    view.save_row(
        folder / "booleans_of_fields.png", *((title, field, {"across": (1,)}) for title, field in sets.items())
    )
    return float(sets["a & b"].contour().to_trimesh().volume)


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
