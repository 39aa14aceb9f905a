"""Rounding and cleaning a drawing
===============================

Opening removes what is thin and rounds corners that stick out; closing fills what is narrow and rounds corners that
go in.
"""

import numpy as np

import signedheat as sh
from signedheat import view

PLATE = [
    [0, 0],
    [0, 2],
    [1.4, 2],
    [1.4, 1],
    [1.5, 1],
    [1.5, 2],
    [3, 2],
    [3, 1.1],
    [3.6, 1.1],
    [3.6, 0.95],
    [3, 0.95],
    [3, 0],
]

plate = sh.Polyline(PLATE, closed=True)
grid = sh.Grid.around(plate.bounds, resolution=220, padding=0.4)
phi = sh.signed_distance(plate, grid)
opened, closed = sh.morphology.opening(plate, 0.15, grid), sh.morphology.closing(plate, 0.15, grid)

figure = view.new_figure(13.5, 3.4)
for k, (title, lines) in enumerate([("a plate", plate), ("opened by 0.15", opened), ("closed by 0.15", closed)]):
    axes = figure.add_subplot(1, 3, k + 1)
    view.draw_plane(phi, axes, lines)
    axes.set_title(title)
figure.savefig("rounding_a_drawing.png")
cut_off = (1 - np.pi / 4) * 0.15**2

# %%
# Area after opening, beside that of the plate without its thin pin and its corners:
measured = float(sum(-line.signed_area for line in opened) / (3 * 2 - 0.1 - 6 * cut_off))
print(f"{measured:.4g}")
