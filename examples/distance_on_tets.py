"""Distance on tets
================

Tets that are fine near a shape and coarse far from it, and distance to the broken shape on them.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

shape = samples.without_patches(samples.sphere(3), 3, 0.35, seed=1)
mesh = sh.tetrahedralize(shape, resolution=12, padding=0.8)
phi = sh.sharpen(sh.SignedHeatSolver(mesh).distance(shape))
offset = phi.offset(0.5)

cut = sh.TetMesh(mesh.vertices, mesh.tets[mesh.tet_barycenters[:, 1] > 0])
view.save_row(
    [("half of the tets", cut, {"view": (20, -70)}), ("signed distance", phi), ("the offset of 0.5", offset)],
    "distance_on_tets.png",
)

# %%
# Mean radius of the offset of 0.5 of a broken unit sphere:
measured = float(np.linalg.norm(offset.vertices, axis=1).mean())
print(f"{measured:.4g}")
