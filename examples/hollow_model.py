"""Hollow a model
==============

A whole application: a duck with holes in its scan becomes a duck of even wall, to save material.
"""

from pathlib import Path

import signedheat as sh
from signedheat import samples, view

EXPECTED = (1.0, 0.08)
"""Volume of the wall beside area times thickness."""


def main(folder: Path) -> float:
    """Write the hollow duck and a picture; return its volume over area times thickness."""
    scan = samples.without_patches(samples.duck(40), 5, 0.2, seed=3)
    wall = sh.morphology.shell(scan, -0.1, 0.0, resolution=72)
    wall.save(folder / "hollow.stl")

    grid = sh.Grid.around(wall.bounds, resolution=80, padding=0.15)
    view.save_row(
        folder / "hollow_model.png",
        ("in: holes", scan),
        ("out: distance to the wall", sh.signed_distance(wall, grid), {"across": (1,)}),
        ("out: from outside", wall),
    )
    area = 0.5 * wall.face_areas.sum()
    return float(wall.to_trimesh().volume / (0.1 * area))


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
