"""Hollow a model
==============

A whole application: a duck with holes in its scan becomes a duck of even wall, to save material.
"""

import signedheat as sh
from signedheat import samples, view

scan = samples.without_patches(samples.duck(28), 5, 0.2, seed=3)
wall = sh.morphology.shell(scan, -0.1, 0.0, resolution=52)
wall.save("hollow.stl")

grid = sh.Grid.around(wall.bounds, resolution=56, padding=0.15)
view.save_row(
    [
        ("in: holes", scan),
        ("out: distance to the wall", sh.signed_distance(wall, grid), {"across": (1,)}),
        ("out: from outside", wall),
    ],
    "hollow_model.png",
)
area = 0.5 * wall.face_areas.sum()

# %%
# Volume of the wall beside area times thickness:
measured = float(wall.to_trimesh().volume / (0.1 * area))
print(f"{measured:.4g}")
