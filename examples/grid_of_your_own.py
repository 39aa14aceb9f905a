"""A grid of your own, for an image viewer
=======================================

Distance on an image grid with thick slices, saved for an image viewer and loaded back.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (0.3, 0.02)
"""Distance at a point 0.3 outside the sphere."""


def main(folder: Path) -> float:
    """Write the field as NRRD and a picture; return its value at a point."""
    sphere = samples.without_patches(samples.sphere(4), n_patches=3, radius=0.5)
    grid = sh.Grid(origin=(-1.5, -1.5, -1.6), spacing=(0.06, 0.06, 0.1), shape=(51, 51, 33))

    sdf = sh.signed_distance(sphere, grid)
    sdf.save(folder / "distance.nrrd")

    again = sh.load_field(folder / "distance.nrrd")
    view.save_slices(again, folder / "grid_of_your_own.png", sphere)
    return float(again([1.3 * np.array([0.6, 0.48, 0.64])])[0])


if __name__ == "__main__":
    print(f"distance {main(Path('.')):.4f}, expected {EXPECTED[0]}")
