"""Curves across polygons
======================

Two dashed circles across the hexagons of a torus: distance of every corner from them, around the tube.
"""

import numpy as np

import signedheat as sh
from signedheat import view


def torus(n_around: int = 96, n_across: int = 32, major: float = 2.5, minor: float = 1.0) -> sh.PolygonMesh:
    """Hexagons like bricks: each spans two columns of a lattice, shifted by one from row to row."""
    u, v = np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij")
    a, b = 2 * np.pi * u / n_around, 2 * np.pi * v / n_across
    ring = major + minor * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), minor * np.sin(b)], axis=-1)

    def at(i, j):
        return (i % n_around) * n_across + j % n_across

    bricks = [
        [at(i, j), at(i + 1, j), at(i + 2, j), at(i + 2, j + 1), at(i + 1, j + 1), at(i, j + 1)]
        for j in range(n_across)
        for i in range(j % 2, n_around, 2)
    ]
    return sh.PolygonMesh(points.reshape(-1, 3), bricks)


mesh = torus()
dashes = []
for radius, length in ((3.5, np.pi / 10), (1.5, -np.pi / 10)):  # outside eastward, inside westward: north is left
    for start in np.arange(0, 2 * np.pi, np.pi / 6):
        angle = np.linspace(start, start + length, 12)
        dashes.append(mesh.polyline(radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)))

phi = sh.SignedHeatSolver(mesh, diffusion=4).distance(dashes, sh.constraints.Free())

view.save_surface(phi, "curve_across_polygons.png", dashes)

# %%
# Distance from the equators to the top of the torus, a quarter of the way round a tube of radius 1:
measured = float(phi.values[np.isclose(mesh.vertices[:, 2], 1.0)].mean())
print(f"{measured:.4g}")
