"""Unsigned distance, to clothes and to roads
==========================================

Nothing is closed with `completion="none"`: distance is to the cloth itself, not to what would close its neck and hem,
and to every road of a network, whatever it bounds. It is never negative.
"""

import numpy as np

import signedheat as sh
from signedheat import view

z = np.linspace(0, 1.4, 29)
radius = 0.16 + 0.3 * np.sqrt(np.clip(1.4 - z, 0, 0.25) / 0.25) ** 0.8 + 0.25 * np.clip(0.9 - z, 0, None) ** 2
turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
ring = np.stack([np.cos(turn), 0.7 * np.sin(turn), 0 * turn], axis=1)
vertices = (radius[:, None, None] * ring + z[:, None, None] * [0, 0, 1]).reshape(-1, 3)
low, after = np.arange(64), np.roll(np.arange(64), -1)
strip = np.concatenate([np.stack([low, after, after + 64], axis=1), np.stack([low, after + 64, low + 64], axis=1)])
dress = sh.TriangleMesh(vertices, np.concatenate([strip + 64 * k for k in range(len(z) - 1)]))

cloth = sh.complete(dress, completion="none")
plane = sh.Grid((-1, -0.4), 0.02, (101, 111))  # x and z, at y = 0
distance = sh.Field(plane, cloth.distance(np.insert(plane.points, 1, 0.0, axis=-1)))
(cut,) = cloth.section((0, 0, 0), (0, 1, 0), heights=[0.0])

side = np.linspace(-1, 1, 41)
x, y = np.meshgrid(side, side, indexing="ij")
a = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
faces = np.concatenate([np.stack([a, a + 41, a + 42], axis=1), np.stack([a, a + 42, a + 1], axis=1)])
hills = 0.2 * np.sin(3 * x) * np.cos(4 * y)
land = sh.TriangleMesh(np.stack([x, y, hills], axis=-1).reshape(-1, 3), faces)
ways = [[(-0.8, -0.5), (0.0, -0.1), (0.8, 0.4)], [(0.0, -0.1), (-0.3, 0.8)], [(0.4, 0.15), (0.6, -0.8)]]
roads = [land.polyline([(x, y, 0.2 * np.sin(3 * x) * np.cos(4 * y)) for x, y in way]) for way in ways]
along = sh.signed_distance(roads, land, completion="none")

view.save_row(
    [
        ("distance along the land to roads", along, {"sources": roads, "view": np.array([0.3, -0.8, 1.2])}),
        ("a dress", dress, {"view": (15, -60)}),
        ("unsigned distance to it", distance, {"shape": cut.sheets, "levels": [0.1]}),
    ],
    "clothes_and_roads.png",
)

# %%
# Distance in the middle of the neck, which a lid would close, beside half of the neck's width, 0.7 of its radius:
measured = float(cloth.distance([0.0, 0.0, 1.4]) / (0.7 * radius[-1]))
print(f"{measured:.4g}")
