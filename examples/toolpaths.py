"""Offset toolpaths in the plane
=============================

A whole application: a pocket, drawn with gaps where lines did not meet, is milled by a tool of radius 0.12: paths at
distances of 0.12, 0.3, 0.48 … inside.
"""

import numpy as np

import signedheat as sh
from signedheat import view

CORNERS = np.array([[0, 0], [0, 2], [1.2, 2], [1.2, 1.3], [2, 1.3], [2, 2], [3.2, 2], [3.2, 0]])

ends = np.roll(CORNERS, -1, axis=0)
steps = 0.03 * (ends - CORNERS) / np.linalg.norm(ends - CORNERS, axis=1, keepdims=True)
drawing = [sh.Polyline([a + s, b - s]) for a, b, s in zip(CORNERS, ends, steps, strict=True)]

phi = sh.signed_distance(drawing, resolution=200, padding=0.2)
levels = [-0.12 - 0.18 * k for k in range(4)]
paths = [line for level in levels for line in phi.contour(level)]
sh.io.write_polylines(paths, "paths.svg")

figure = view.new_figure(11.5, 4.2)
for k, (title, lines) in enumerate([("the drawing, with gaps", drawing), (f"{len(paths)} paths", paths)]):
    axes = figure.add_subplot(1, 2, k + 1)
    view.draw_plane(phi, axes, lines)
    axes.set_title(title)
figure.savefig("toolpaths.png")
first = max(phi.contour(levels[0]), key=lambda line: line.length).points
along = np.linspace(CORNERS, ends, 400).reshape(-1, 2)

# %%
# Least distance of the first path from the whole outline: at its inner corners, which the gaps cut off:
measured = float(np.sqrt(((first[:, None] - along[None]) ** 2).sum(axis=-1)).min())
print(f"{measured:.4g}")
