"""Plates thinner than a cell
==========================

A plate of a quarter of a cell is solid, and its offset is where it should be: faces tell sides, not nodes.
"""

import numpy as np
import trimesh

import signedheat as sh
from signedheat import view

half = np.array([1.0, 0.6, 0.01])
plate = trimesh.creation.box(2 * half)
phi = sh.signed_distance(plate, spacing=0.08, padding=0.5)
offset = phi.offset(0.2)

away = np.abs(offset.vertices) - half
exact = np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(axis=1), 0)
view.save_row(
    [
        ("a plate, 0.02 thick", sh.as_shape(plate)),
        ("distance at nodes 0.08 apart", phi, {"shape": sh.as_shape(plate), "across": (1,), "levels": [0.2]}),
        ("its offset of 0.2", offset),
    ],
    "thin_plates.png",
)

# %%
# Largest distance of a vertex of the offset from where it should be:
measured = float(np.abs(exact - 0.2).max())
print(f"{measured:.4g}")
