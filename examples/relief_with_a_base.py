"""A relief with a base
====================

A terrain is a sheet, which no printer takes. `extrude` gives it a skirt, walls down to a base or up to a lid. Of
outlines it makes a plate, whose holes go through.
"""

import numpy as np

import signedheat as sh
from signedheat import view
from signedheat.morphology import extrude

side = np.linspace(-2, 2, 81)
x, y = np.meshgrid(side, side, indexing="ij")
height = 0.6 * np.exp(-((x - 0.5) ** 2) - y**2) + 0.12 * np.sin(4 * x) * np.cos(3 * y)
a = (np.arange(80)[:, None] * 81 + np.arange(80)).ravel()
faces = np.concatenate([np.stack([a, a + 81, a + 82], axis=1), np.stack([a, a + 82, a + 1], axis=1)])
terrain = sh.TriangleMesh(np.stack([x, y, height], axis=-1).reshape(-1, 3), faces)
block = extrude(terrain, -0.8)
mould = extrude(terrain, 1.2)

turn = np.linspace(0, 2 * np.pi, 90, endpoint=False)
wheel = (1.8 + 0.15 * np.sign(np.sin(12 * turn)))[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
holes = [
    0.45 * np.stack([np.cos(-turn), np.sin(-turn)], axis=1) + place for place in ((1, 0), (-0.5, 0.8), (-0.5, -0.8))
]
gear = extrude([sh.Polyline(points, closed=True) for points in (wheel, *holes)], 0.6)

view.save_row(
    [
        ("in: a terrain", terrain, {"view": (28, -55)}),
        ("base at −0.8", block, {"view": (28, -55)}),
        ("up to 1.2, from below", mould, {"view": (-28, -55)}),
        ("outlines to 0.6", gear, {"view": (40, -55)}),
    ],
    "relief_with_a_base.png",
)

# %%
# Volume of base and mould together, beside that of the box 4 × 4 × 2:
measured = (block.volume + mould.volume) / 32
print(f"{measured:.4g}")
