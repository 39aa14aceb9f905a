"""A fine band in a coarse grid
=============================

Fine nodes are needed near the surface only. A band has the fine spacing up to a distance on both sides, and a coarse
grid beyond: the same surface from a tenth of the nodes, and from a hundredth where grids are finer. Where even
that is too much for the memory, ``Solid.field`` keeps it on disk (``store=``).
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

broken = samples.without_patches(samples.torus(n_around=80, n_across=40), 3, 0.2, seed=1)
band = sh.signed_distance(broken, spacing=0.04, padding=0.3, band=0.12)
band.save("torus.vdb")
surface = band.contour()

slice_grid = sh.Grid((-1.7, -1.7), 0.02, (171, 171))
x, y = np.moveaxis(slice_grid.points, -1, 0)
values = band(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)).reshape(x.shape)
view.save_row(
    [
        ("in: three holes", broken),
        ("fine to the thin lines, coarse beyond", sh.Field(slice_grid, values), {"levels": [-0.12, 0.12]}),
        ("out: closed", surface),
    ],
    "fine_band.png",
)
ring = np.hypot(surface.vertices[:, 0], surface.vertices[:, 1]) - 1.0

# %%
# Largest distance of the completed surface from the whole torus, over the radius of its tube:
measured = float(np.abs(np.hypot(ring, surface.vertices[:, 2]) / 0.4 - 1.0).max())
print(f"{measured:.4g}")
