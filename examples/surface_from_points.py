"""A closed surface from scanned points
====================================

Scanned points with normals: the closed surface through them, and the volume it holds.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

points = samples.oriented_points(samples.torus(major=1.0, minor=0.4), 1500)
points.save("scan.ply")

sdf = sh.signed_distance(sh.read("scan.ply"), resolution=80)
surface = sdf.contour(0.0)

surface.save("surface.ply")
view.save_slices(sdf, "surface_from_points.png", points)
corners = surface.vertices[surface.faces]

# %%
# Volume of the torus, and how far from it 1500 points leave us:
measured = float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)
print(f"{measured:.4g}")
