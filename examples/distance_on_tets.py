"""Distance on tets
================

Tets that are fine near a shape and coarse far from it, and distance to the broken shape on them.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (1.5, 0.03)
"""Mean radius of the offset of 0.5 of a broken unit sphere."""


def main(folder: Path) -> float:
    """Write a picture; return the mean radius of the offset."""
    shape = samples.without_patches(samples.sphere(4), 3, 0.35, seed=1)
    mesh = sh.tetrahedralize(shape, resolution=14, padding=0.8)
    phi = sh.sharpen(sh.SignedHeatSolver(mesh).distance(shape))
    offset = phi.offset(0.5)

    cut = sh.TetMesh(mesh.vertices, mesh.tets[mesh.tet_barycenters[:, 1] > 0])
    view.save_row(
        folder / "distance_on_tets.png",
        ("half of the tets", cut, {"view": (20, -70)}),
        ("signed distance", phi),
        ("the offset of 0.5", offset),
    )
    return float(np.linalg.norm(offset.vertices, axis=1).mean())


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
