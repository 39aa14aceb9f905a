"""Points without normals
======================

A scan that is points alone: sides are found first, then the closed surface.
"""

import signedheat as sh
from signedheat import samples, view

cloud = sh.PointCloud(samples.oriented_points(samples.torus(1.0, 0.4), 3000).points)
phi = sh.signed_distance(cloud, resolution=52)
surface = phi.contour()

view.save_row(
    [
        ("in: 3000 points", cloud, {"view": (40, -58)}),
        ("signed distance", phi, {"shape": cloud, "across": (2,)}),
        ("out: closed", surface, {"view": (40, -58)}),
    ],
    "points_without_normals.png",
)

# %%
# Volume of the torus:
measured = float(surface.to_trimesh().volume)
print(f"{measured:.4g}")
