"""Open sheets bound nothing
=========================

A table of thin boards without thickness: around a sheet that bounds nothing, distance is positive on both sides, and
the offset is a closed surface around each board.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view


def board(corner: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...], n: int = 12) -> sh.TriangleMesh:
    """A rectangle of triangles."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    points = np.array(corner) + (i[..., None] * np.array(u) + j[..., None] * np.array(v)) / n
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([a, a + n + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + 1], axis=1)])
    return sh.TriangleMesh(points.reshape(-1, 3), faces)


table = samples.union(
    board((0, 0, 1), (2, 0, 0), (0, 1.2, 0)),
    board((0.2, 0.1, 0), (0, 1, 0), (0, 0, 1)),
    board((1.8, 0.1, 0), (0, 1, 0), (0, 0, 1)),
)
phi = sh.signed_distance(table, resolution=72, padding=0.4)

view.save_row(
    [
        ("in: boards without thickness", table, {"view": (20, -60)}),
        ("distance: outside on both sides", phi, {"shape": table, "across": (1,), "levels": [0.12]}),
        ("out: 0.12 around", phi.offset(0.12), {"view": (20, -60)}),
    ],
    "open_sheets.png",
)

# %%
# Share of the nodes with positive distance:
measured = float((phi.values > 0).mean())
print(f"{measured:.4g}")
