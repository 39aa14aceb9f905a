"""Grow, shrink, open, close
=========================

Four operations by offsets of a broken shape: dilation and erosion, and one after the other. Opening removes thin
parts, closing fills narrow gaps.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

duck = samples.without_patches(samples.duck(32), 3, 0.2, seed=2)
grid = sh.Grid.around(duck.bounds, resolution=60, padding=0.5)
changed = {
    "dilated by 0.1": sh.morphology.dilate(duck, 0.1, grid),
    "eroded by 0.1": sh.morphology.erode(duck, 0.1, grid),
    "opened by 0.14": sh.morphology.opening(duck, 0.14, grid),
    "closed by 0.25": sh.morphology.closing(duck, 0.25, grid),
}
for title, surface in changed.items():
    sh.save(surface, f"{title.split()[0]}.stl")
    assert surface.to_trimesh().is_watertight
view.save_row("grow_and_shrink.png", ("in: three holes", duck), *changed.items())

# %%
# Mean distance of the eroded surface from the duck:
measured = float(np.mean(sh.signed_distance(duck, grid)(changed["eroded by 0.1"].vertices)))
print(f"{measured:.4g}")
