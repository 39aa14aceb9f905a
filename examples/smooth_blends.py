"""Smooth blends
=============

A fillet where two solids meet, of a width that is chosen: in unions, common parts and differences.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

grid = sh.Grid((-1.8, -1.4, -1.4), 0.06, (61, 48, 48))
ball = sh.signed_distance(samples.sphere(4, 0.8, (-0.5, 0, 0)), grid)
ring = sh.signed_distance(samples.torus(0.8, 0.25), grid)
sharp, smooth = ball | ring, sh.morphology.smooth_union(ball, ring, 0.5)
shown = {
    "union": sharp,
    "union, width 0.5": smooth,
    "common part, width 0.2": sh.morphology.smooth_intersection(ball, ring, 0.2),
    "difference, width 0.2": sh.morphology.smooth_difference(ball, ring, 0.2),
}
view.save_row(
    ((title, field.contour(), {"view": (30, -60)}) for title, field in shown.items()),
    "smooth_blends.png",
)

# %%
# How far the blend of width 0.5 goes beyond the sharp edge: a quarter of the width, over the gradient there:
measured = float(np.abs(smooth.values - sharp.values).max())
print(f"{measured:.4g}")
