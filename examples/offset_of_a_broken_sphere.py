"""Offset of a broken sphere
=========================

A sphere with a third of its faces gone, noisy and partly flipped: the closed surface at a distance from it.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (1.2, 0.01)
"""Mean radius of the offset surface, and how far from it the noise may lead."""


def main(folder: Path) -> float:
    """Write the offset surface and a picture; return its mean radius."""
    broken = samples.with_noise(samples.without_faces(samples.sphere(4), 0.35), 0.01)
    broken = samples.with_flipped_faces(broken, 0.1)

    sdf = sh.signed_distance(broken, resolution=64, padding=0.5)
    surface = sdf.offset(0.2)

    surface.save(folder / "offset.stl")
    view.save_slices(sdf, folder / "offset_of_a_broken_sphere.png", broken, levels=[0.2])
    return float(np.linalg.norm(surface.vertices, axis=1).mean())


if __name__ == "__main__":
    print(f"mean radius {main(Path('.')):.4f}, expected {EXPECTED[0]}")
