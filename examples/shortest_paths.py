"""Shortest paths
==============

Exact geodesics on a bumpy surface: between vertices, and from a curve to the vertices that are farthest from it.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

ball = samples.sphere(5)
x, y, z = ball.vertices.T
bumps = 1 + 0.15 * np.sin(5 * x) * np.sin(4 * y + 1) * np.cos(3 * z)
mesh = sh.TriangleMesh(bumps[:, None] * ball.vertices, ball.faces)

pole = int(z.argmax())
ends = [int((ball.vertices @ way).argmax()) for way in ((1, -1, 0.2), (0.3, -1, -0.6), (1, -0.1, -0.7))]
paths = [mesh.shortest_path(pole, end) for end in ends]

circle = mesh.level_set(z, 0.5)
field = sh.signed_distance(circle, mesh)
down = [mesh.shortest_path(field.contour(), end) for end in ends]

near = sh.sharpen(sh.SignedHeatSolver(mesh).distance(mesh.points_at(pole)))
way = np.array([0.6, -0.7, 0.3])
view.save_row(
    [
        (
            "from a vertex",
            near,
            {"sources": paths, "view": way},
        ),
        ("from a curve", field, {"sources": [*circle, *down], "view": way}),
    ],
    "shortest_paths.png",
)

# %%
# The length of a path beside the distance of its end:
steps = np.diff(mesh.positions(down[0]), axis=0)
measured = float(np.linalg.norm(steps, axis=1).sum() / abs(field.values[ends[0]]))
print(f"{measured:.4g}")
