"""Distance on voxels
==================

Distance on a ball of voxels: accurate with corrected normals, far too long on the staircase of voxel faces.
"""

import numpy as np

import signedheat as sh
from signedheat import view

index = np.stack(np.indices((46, 46, 46)), axis=-1)
volume = np.linalg.norm(index - [22.4, 22.6, 22.3], axis=-1) < 20
axis = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])

errors = []
for radius in (None, 0.0):  # corrected normals, and each face's own
    surface = sh.DigitalSurface(volume, spacing=1 / 20, radius=radius)
    center = np.array([22.4, 22.6, 22.3]) / 20
    along = (surface.vertices - center) @ axis / np.linalg.norm(surface.vertices - center, axis=1)
    circle = surface.level_set(along, 0.3)

    phi = sh.SignedHeatSolver(surface).distance(circle)

    errors.append(float(phi.values[np.argmax(along)] / (np.pi / 2 - np.arcsin(0.3)) - 1))
    if radius is None:
        view.save_surface(phi, "distance_on_voxels.png", circle)
print(f"error with corrected normals {errors[0]:+.2%}, without {errors[1]:+.2%}")

# %%
# Error at the pole with corrected normals, as a part of the distance:
measured = errors[0]
print(f"{measured:.4g}")
