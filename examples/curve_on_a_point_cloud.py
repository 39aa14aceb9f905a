"""A curve on a point cloud
========================

Points on a sphere without normals: distance to a circle of points, of which every third is missing.
"""

import numpy as np

import signedheat as sh
from signedheat import view

k = np.arange(6000) + 0.5
height, azimuth = 1 - 2 * k / 6000, np.pi * (1 + 5**0.5) * k
width = np.sqrt(1 - height**2)
points = np.stack([width * np.cos(azimuth), width * np.sin(azimuth), height], axis=1)
cloud = sh.PointCloud(points)

arcs = []
for start in np.arange(0, 2 * np.pi, np.pi / 4):
    angle = np.linspace(start, start + np.pi / 6, 9)
    arcs.append(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * np.sqrt(1 - 0.4**2) + [0, 0, 0.4])
curves = [cloud.polyline(arc) for arc in arcs]

phi = sh.SignedHeatSolver(cloud).distance(curves, sh.constraints.Free())

view.save_surface(phi, "curve_on_a_point_cloud.png", curves)

# %%
# Distance from the circle at height 0.4 to the north pole:
measured = float(phi.values[np.argmax(points[:, 2])])
print(f"{measured:.4g}")
