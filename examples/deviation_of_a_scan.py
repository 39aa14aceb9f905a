"""Deviations of a scan
====================

A part was printed a little too large and with a dent; it was scanned with holes. How far is it off the nominal part,
and where? The nominal file is broken too: a tenth of its faces are missing, others are flipped.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

part = samples.torus(0.8, 0.3, n_around=72, n_across=36)
nominal = samples.with_flipped_faces(samples.without_faces(part, 0.1), 0.2)

away = np.linalg.norm(part.vertices - [0.8, 0.0, 0.3], axis=1)
inward = np.array([0.0, 0.0, -0.09]) * np.exp(-((away / 0.15) ** 2))[:, None]
printed = sh.TriangleMesh(part.vertices * 1.01 + inward, part.faces)
scan = samples.without_patches(printed, 4, 0.15)

found = sh.deviation(scan, nominal)
found.save("histogram.png")
found.save("deviation.ply")
view.save_row(
    [
        ("the nominal part, broken", nominal),
        (f"{found.within(0.015):.0%} of the scan within 0.015", sh.Field(scan, found.distances)),
    ],
    "deviation_of_a_scan.png",
)

# %%
# Deepest point of the dent:
measured = float(found.distances.min())
print(f"{measured:.4g}")
