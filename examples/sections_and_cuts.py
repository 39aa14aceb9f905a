"""Sections and cuts
=================

A scan with holes is cut by planes: outlines of layers for a slicer, and two closed halves to print.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

scan = samples.without_patches(samples.torus(1.0, 0.4, n_around=96, n_across=48), 6, 0.25, seed=2)
solid = sh.complete(scan)

heights = np.linspace(-0.35, 0.35, 15)
layers = solid.section((0, 0, 0), heights=heights)
sh.io.write_polylines(layers[7].outlines, "layer.svg")
above, below = solid.cut((0, 0, 0), (0.3, 0, 1))
above.save("above.stl")

figure = view.new_figure(13, 4.2)
view.draw_shape(scan, figure.add_subplot(1, 3, 1), view=(40, -58))
axes = figure.add_subplot(1, 3, 2, projection="3d")
for layer in layers:
    for points in layer.in_space:
        axes.plot(*np.append(points, points[:1], axis=0).T, color="C0", linewidth=0.8)
axes.set_box_aspect((4, 4, 1), zoom=1.8)
axes.set_axis_off()
view.draw_shape(above.surface(), figure.add_subplot(1, 3, 3), view=(-30, -58))
for panel, title in zip(figure.axes, ("in: six holes", "15 layers", "one of two closed halves"), strict=True):
    panel.set_title(title)
figure.savefig("sections_and_cuts.png")

# %%
# Area of the middle layer, a ring from 0.6 to 1.4, beside π (1.4² − 0.6²):
measured = layers[7].area / (np.pi * (1.4**2 - 0.6**2))
print(f"{measured:.4g}")
