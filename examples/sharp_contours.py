"""Sharp contours of a distance of your own
========================================

`contour` takes a function of points, or an array of values, and finds its edges and corners. Marching cubes cut
them off.
"""

import numpy as np

import signedheat as sh
from signedheat import view


def part(points):
    """A plate with a hole, less a slanted half space: distances combined by maximum and minimum."""
    x, y, z = points.T
    plate = np.maximum(np.maximum(np.abs(x) - 1.0, np.abs(y) - 0.7), np.abs(z) - 0.25)
    cut = np.maximum(plate, 0.35 - np.hypot(x - 0.3, y))
    return np.maximum(cut, 0.8 * z - 0.6 * x - 0.55)


bounds = [[-1.2, -0.9, -0.4], [1.2, 0.9, 0.4]]
sharp = sh.contour(part, bounds, 0.08)
rounded = sh.contour(part, bounds, 0.08, sharp=False)
x, y, z = (np.linspace(low, high, n) for low, high, n in zip(*bounds, (31, 24, 12), strict=True))
places = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
array = sh.contour(part(places.reshape(-1, 3)).reshape(places.shape[:3]), bounds)

titles = "marching cubes", "of an array, sharp", "of the function, sharp"
around = [{"view": (35, -60)}] * 3
view.save_row(zip(titles, (rounded, array, sharp), around, strict=True), "sharp_contours.png")

# %%
# Largest distance of the corners of the plate at the right from the sharp surface:
corners = np.array([[1.0, side, end] for side in (-0.7, 0.7) for end in (-0.25, 0.25)])
away = np.linalg.norm(sharp.vertices[:, None] - corners, axis=2).min(axis=0)
measured = float(away.max())
print(f"{measured:.1e}")
