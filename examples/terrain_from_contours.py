"""Heights between contour lines
=============================

A whole application: from the lines of a map, each with its height, to heights everywhere: one field that takes a
given level on each line (Eq. 14).
"""

import numpy as np

import signedheat as sh
from signedheat import view

angle = np.linspace(0, -2 * np.pi, 120, endpoint=False)
ring = np.stack([np.cos(angle), 0.8 * np.sin(angle)], axis=1)
heights = [1.0, 2.0, 3.0, 4.0]
lines = [sh.Polyline(((5 - h) + 0.15 * np.sin(3 * angle))[:, None] * ring, closed=True).reversed() for h in heights]

grid = sh.Grid((-5, -4.2), 0.1, (101, 85))
phi = sh.SignedHeatSolver(grid).distance(lines, sh.constraints.LevelValues(heights))

figure = view.new_figure(8.0, 5.6)
axes = figure.add_subplot()
view.draw_plane(phi, axes, lines)
axes.set_title("lines of height 1, 2, 3, 4, and heights between them")
figure.savefig("terrain_from_contours.png")

# %%
# Height halfway between the lines of 2 and 3:
measured = float(phi([[2.5, 0.0]])[0])
print(f"{measured:.4g}")
