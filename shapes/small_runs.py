"""One small run of everything that has kernels; its values, as one flat array for each.

Run as a program, it writes them to the file that it is given.
"""

from __future__ import annotations

import sys
import warnings
from functools import cache
from unittest import mock

import numpy as np

import signedheat as sh
from signedheat import samples
from signedheat.solids import gauss


@cache
def runs() -> dict[str, np.ndarray]:
    """Values by name."""
    ball = samples.sphere(1)
    broken = samples.without_faces(ball, 0.2, 0)
    found = {}
    grid = sh.SignedHeatSolver(sh.Grid.around(broken, 7)).distance(broken)
    found["grid"] = grid.values
    found["sharpened grid"] = sh.sharpen(grid).values
    few = samples.without_faces(samples.sphere(0), 0.2, 0)
    with mock.patch.object(gauss, "LEVEL_POINTS", 100):
        found["solid on a grid"] = sh.complete(few).field(resolution=5).values
    curve = ball.polyline([[1.0, 0.1, 0.2], [0.0, 1.0, -0.1], [-1.0, 0.0, 0.3]])
    surface = sh.SignedHeatSolver(ball).distance(curve)
    found["surface"] = surface.values
    found["sharpened surface"] = sh.sharpen(surface).values
    angles = np.linspace(0.0, 5.9, 9)
    stroke = ball.polyline(np.stack([np.cos(angles), np.sin(angles), 0.1 + 0.2 * np.cos(angles + 0.3)], axis=1))
    angles = np.linspace(0.0, 2 * np.pi - 3.1, 9)
    ring = ball.polyline(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1))  # where ways and cuts tie
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sh.errors.InexactWarning)  # half of the ring is gone: what it bounds is a guess
        closed = sh.close_curves(ring, ball)
    lines = [
        *sh.close_curves(stroke, ball),
        *closed,
        *ball.level_set(ball.vertices[:, 2]),
        *surface.contour(0.1),
    ]
    found["lines"] = np.array([line.n_points for line in lines])
    found["refined"] = np.sort(sh.intrinsic_delaunay(ball, refine=True).triangles.edge_lengths, axis=None)
    found["points"] = sh.SignedHeatSolver(sh.PointCloud(ball.vertices)).distance(ball.points_at(3)).values
    tets = sh.tetrahedralize(broken, resolution=5)
    field = sh.SignedHeatSolver(tets).distance(broken)
    found["tets"] = field.values
    found["sharpened tets"] = sh.sharpen(field).values
    return {name: np.asarray(values, dtype=np.float64).ravel() for name, values in found.items()}


if __name__ == "__main__":
    np.savez(sys.argv[1], **runs())
