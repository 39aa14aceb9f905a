"""Round the corners of a tank, on tets
====================================

Distance inside a tank with a baffle, measured around the baffle; the tets need not conform to the source.

The source is a broken sphere in one corner: a third of its faces are gone.
"""

import numpy as np
import trimesh

import signedheat as sh
from signedheat import view

CENTER, RADIUS = np.array([0.5, 0.5, 0.5]), 0.3


def tank(n: int) -> sh.TetMesh:
    """The box [0, 3] × [0, 2] × [0, 1] in cubes of side 1/n, six tets each, but for 1.4 < x < 1.6, y < 1.5."""
    cells = np.stack(np.meshgrid(*map(np.arange, (3 * n, 2 * n, n)), indexing="ij"), axis=-1).reshape(-1, 3)
    x, y, _ = (cells + 0.5).T / n
    cells = cells[~((np.abs(x - 1.5) < 0.1) & (y < 1.5))]
    stride = np.array([(2 * n + 1) * (n + 1), n + 1, 1])
    orders = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    steps = [np.cumsum(np.vstack([np.zeros(3, int), np.eye(3, dtype=int)[list(order)]]), axis=0) for order in orders]
    ids, tets = np.unique(np.concatenate([(cells[:, None] + s) @ stride for s in steps]), return_inverse=True)
    points = np.stack([ids // stride[0], ids % stride[0] // stride[1], ids % stride[1]], axis=1) / n
    return sh.TetMesh(points, tets.reshape(-1, 4))


ball = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
keep = np.random.default_rng(0).random(len(ball.faces)) > 1 / 3
phi = sh.signed_distance(sh.TriangleMesh(ball.vertices + CENTER, ball.faces[keep]), tank(10))
plane = sh.Grid((0.0, 0.0), 0.02, (151, 101))
x, y = np.moveaxis(plane.points, -1, 0)
middle = np.stack([x, y, 0.5 + 0 * x], axis=-1).reshape(-1, 3)
values = np.where((np.abs(x - 1.5) < 0.1) & (y < 1.5), np.nan, phi(middle).reshape(x.shape))
figure = view.new_figure(9.0, 5.0)
axes = figure.add_subplot()
view.draw_plane(sh.Field(plane, values), axes)
axes.set_title("round a baffle, from a sphere without a third of its faces")
figure.savefig("distance_round_corners.png")

# %%
# from the sphere over the edge of the baffle to the far corner: the exact length:
measured = float(phi([[3.0, 0.0, 0.5]])[0])
print(f"{measured:.4g}")
