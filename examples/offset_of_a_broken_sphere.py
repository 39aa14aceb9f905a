"""Offset of a broken sphere
=========================

A sphere with a third of its faces gone, noisy and partly flipped: the closed surface at a distance from it.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

broken = samples.with_noise(samples.without_faces(samples.sphere(4), 0.35), 0.01)
broken = samples.with_flipped_faces(broken, 0.1)

sdf = sh.signed_distance(broken, resolution=48, padding=0.5)
surface = sdf.offset(0.2)

surface.save("offset.stl")
view.save_slices(sdf, "offset_of_a_broken_sphere.png", broken, levels=[0.2])

# %%
# Mean radius of the offset surface, and how far from it the noise may lead:
measured = float(np.linalg.norm(surface.vertices, axis=1).mean())
print(f"{measured:.4g}")
