"""Points with exact distances, to learn from
==========================================

A whole application: a set in the form that DeepSDF reads, four of five points near the surface, the rest in the box.
:func:`signedheat.batches.run` makes such sets of whole folders of shapes.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

ball = samples.sphere(5)
found = sh.sample_distances(sh.signed_distance(ball, resolution=48), 4000)
found.save("ball.npz", "deepsdf")

grid = sh.Grid((-1.2, -1.2), 0.02, (121, 121))
exact = sh.Field(grid, np.linalg.norm(grid.points, axis=-1) - 1)
thin = found.points[np.abs(found.points[:, 1]) < 0.1][:, [0, 2]]
view.save_row(
    [
        ("the shape", ball),
        ("samples in a slice", exact, {"shape": sh.PointCloud(thin)}),
        ("all samples", sh.PointCloud(found.points)),
    ],
    "deepsdf_set.png",
)

# %%
# Largest error of a distance to the unit sphere whose faces are flat by at most 0.001:
measured = float(np.abs(np.linalg.norm(found.points, axis=1) - 1 - found.distances).max())
print(f"{measured:.4g}")
