"""A closed surface from scanned points
====================================

Scanned points with normals: the closed surface through them, and the volume it holds.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (2 * np.pi**2 * 1.0 * 0.4**2, 0.06)
"""Volume of the torus, and how far from it 1500 points leave us."""


def main(folder: Path) -> float:
    """Write the points, the surface and a picture; return the volume of the surface."""
    points = samples.oriented_points(samples.torus(major=1.0, minor=0.4), 1500)
    points.save(folder / "scan.ply")

    sdf = sh.signed_distance(sh.read(folder / "scan.ply"), resolution=80)
    surface = sdf.contour(0.0)

    surface.save(folder / "surface.ply")
    view.save_slices(sdf, folder / "surface_from_points.png", points)
    corners = surface.vertices[surface.faces]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


if __name__ == "__main__":
    print(f"volume {main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
