"""A grid of your own, for an image viewer
=======================================

Distance on an image grid with thick slices, saved for an image viewer and loaded back.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

sphere = samples.without_patches(samples.sphere(4), n_patches=3, radius=0.5)
grid = sh.Grid(origin=(-1.5, -1.5, -1.6), spacing=(0.06, 0.06, 0.1), shape=(51, 51, 33))

sdf = sh.signed_distance(sphere, grid)
sdf.save("distance.nrrd")

again = sh.read_field("distance.nrrd")
view.save_slices(again, "grid_of_your_own.png", sphere)

# %%
# Distance at a point 0.3 outside the sphere:
measured = float(again([1.3 * np.array([0.6, 0.48, 0.64])])[0])
print(f"{measured:.4g}")
