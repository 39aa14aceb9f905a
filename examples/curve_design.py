"""Curves at equal distances on a part
===================================

A whole application: a seam drawn on a part in rough strokes; the seam closed, and lines for stitches beside it, every
0.1 on both sides.
"""

import numpy as np

import signedheat as sh
from signedheat import view

grid = sh.Grid((-1.5, -1.2, -1.0), 0.06, (51, 41, 34))
x, y, z = np.moveaxis(grid.points, -1, 0)
block = sh.Field(grid, np.maximum.reduce([np.abs(x) - 1.2, np.abs(y) - 0.8, np.abs(z) - 0.5]))
boss = sh.Field(grid, np.maximum(np.hypot(x - 0.4, y) - 0.4, np.abs(z) - 0.9))
part = sh.morphology.smooth_union(block, boss, 0.2).contour()

angle = np.linspace(0, 2 * np.pi, 241)
seam = np.stack([0.9 * np.cos(angle), 0.6 * np.sin(angle), 0.5 + 0 * angle], axis=1)
strokes = [part.polyline(seam[a : a + 20], max_distance=0.5) for a in range(0, 240, 24)]

phi = sh.sharpen(sh.SignedHeatSolver(part).distance(strokes, sh.constraints.Free()))
stitches = [curve for level in (-0.2, -0.1, 0.1, 0.2) for curve in phi.contour(level)]
sh.io.write_curves(stitches, "stitches.obj", part)

view.save_row(
    [
        ("strokes, and distance", phi, {"sources": strokes, "view": np.array([0.3, -0.5, 1.0])}),
        ("lines at ±0.1 and ±0.2", phi, {"sources": stitches, "view": np.array([0.3, -0.5, 1.0])}),
    ],
    "curve_design.png",
)
lengths = [np.linalg.norm(np.diff(part.vertices[part.faces[c.faces, 0]], axis=0), axis=1).sum() for c in stitches]

# %%
# Mean distance of the longest line from the seam: 0.1 or 0.2:
measured = float(np.abs(phi(stitches[int(np.argmax(lengths))])).mean())
print(f"{measured:.4g}")
