"""From a mask to distance and back
================================

A whole application: a segmented organ as voxels; distance at the same nodes, and from it the very same mask, and
one grown by a millimetre. Files of masks are for :func:`signedheat.io.read_volume`
and :func:`signedheat.io.read_labels`.
"""

import numpy as np

import signedheat as sh
from signedheat import view

spacing, shape = np.array([0.8, 0.8, 1.6]), (44, 40, 22)
x, y, z = np.moveaxis(sh.Grid((0, 0, 0), spacing, shape).points - [17.2, 15.6, 16.8], -1, 0)
mask = (np.hypot(np.hypot(x / 13, y / 9), z / 10) < 1) & (np.hypot(x - 4, y - 9) > 6)

voxels = sh.DigitalSurface(mask, spacing=spacing)
grid = sh.Grid((0, 0, 0), spacing, shape)
phi = sh.signed_distance(voxels.smooth_surface, grid)
grown = sh.DigitalSurface(phi.values < 1.0, spacing=spacing)

view.save_row(
    [
        ("in: a mask, slices of 1.6 mm", voxels, {"view": (25, -50)}),
        ("distance in the same space", phi, {"shape": voxels.smooth_surface, "across": (2,), "levels": [1.0]}),
        ("out: the mask 1 mm larger", grown, {"view": (25, -50)}),
    ],
    "mask_and_back.png",
)

# %%
# Share of the voxels that come back as they were:
measured = float(((phi.values < 0) == mask).mean())
print(f"{measured:.4g}")
