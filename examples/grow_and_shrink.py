"""Grow, shrink, open, close
=========================

Four operations by offsets of a broken shape: dilation and erosion, and one after the other. Opening removes thin
parts, closing fills narrow gaps.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

duck = samples.without_patches(samples.duck(24), 3, 0.2, seed=2)
grid = sh.Grid.around(duck.bounds, resolution=44, padding=0.5)
solid = sh.complete(duck)
changed = {
    "dilated by 0.1": sh.morphology.dilate(solid, 0.1, grid),
    "eroded by 0.1": sh.morphology.erode(solid, 0.1, grid),
    "opened by 0.14": sh.morphology.opening(solid, 0.14, grid),
    "closed by 0.25": sh.morphology.closing(solid, 0.25, grid),
}
for title, surface in changed.items():
    sh.save(surface, f"{title.split()[0]}.stl")
    assert surface.to_trimesh().is_watertight
view.save_row([("in: three holes", duck), *changed.items()], "grow_and_shrink.png")

# %%
# Mean distance of the eroded surface from the duck:
measured = float(np.mean(solid.distance(changed["eroded by 0.1"].vertices)))
print(f"{measured:.4g}")
