"""Points without normals
======================

A scan that is points alone: sides are found first, then the closed surface.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (2 * np.pi**2 * 0.4**2, 0.12)
"""Volume of the torus."""


def main(folder: Path) -> float:
    """Write a picture; return the volume of the surface."""
    cloud = sh.PointCloud(samples.oriented_points(samples.torus(1.0, 0.4), 5000).points)
    phi = sh.signed_distance(cloud, resolution=72)
    surface = phi.contour()

    view.save_row(
        folder / "points_without_normals.png",
        ("in: 5000 points", cloud, {"view": (40, -58)}),
        ("signed distance", phi, {"shape": cloud, "across": (2,)}),
        ("out: closed", surface, {"view": (40, -58)}),
    )
    return float(surface.to_trimesh().volume)


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
