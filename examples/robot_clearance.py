"""Clearance of a robot
====================

A whole application: a robot as a ball of radius 0.25 moves among obstacles that were scanned with holes; the field
tells its clearance along a path, and its gradient pushes the path away from what is too near.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

RADIUS = 0.25

scene = samples.union(
    samples.sphere(3, 0.5, (-0.6, 0.1, 0)),
    samples.sphere(3, 0.45, (0.75, -0.75, 0)),
    samples.sphere(3, 0.3, (0.6, 0.95, 0)),
)
scan = samples.without_patches(scene, 6, 0.2)
phi = sh.signed_distance(scan, resolution=72, padding=0.7)

start = np.linspace([-1.5, -0.7, 0], [1.5, 0.6, 0], 61)
path = start.copy()
for _ in range(300):
    missing = np.clip(RADIUS + 0.06 - phi(path), 0, None)
    path[1:-1] += 0.5 * (missing[:, None] * phi.gradient(path))[1:-1]
    path[1:-1] += 0.1 * (path[:-2] + path[2:] - 2 * path[1:-1])
    path[:, 2] = 0
for _ in range(20):
    path[1:-1] += (np.clip(RADIUS - phi(path), 0, None)[:, None] * phi.gradient(path))[1:-1] * [1, 1, 0]
missing = np.clip(RADIUS - phi(path), 0, None).max()

flat = sh.Grid(phi.domain.origin[:2], phi.domain.spacing[:2], phi.domain.shape[:2])
points = np.insert(flat.points.reshape(-1, 2), 2, 0.0, axis=1)
plane = sh.Field(flat, phi(points).reshape(flat.shape))
view.save_row(
    [
        ("the scan", scan, {"view": (60, -70)}),
        (f"before: clearance {phi(start).min():.2f}", plane, {"shape": sh.Polyline(start[:, :2]), "levels": [RADIUS]}),
        (f"after: clearance {phi(path).min():.2f}", plane, {"shape": sh.Polyline(path[:, :2]), "levels": [RADIUS]}),
    ],
    "robot_clearance.png",
)

# %%
# How much of the wanted clearance is missing in the end:
measured = float(missing)
print(f"{measured:.4g}")
