"""Files in and out
================

A shape, a drawing, curves on a surface, an image of labels: each is read from its file, and what is made of it
is written again.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

samples.with_flipped_faces(samples.sphere(3), 0.3).save("ball.ply")
ball = sh.transform(sh.read("ball.ply"), 25.4 * np.eye(4)[:3])  # inches to millimetres
sdf = sh.signed_distance(ball, resolution=36)
sh.save(sdf.offset(2.54), "grown.stl")
sh.io.write_vdb(sdf, "ball.vdb")
view.save_scene(ball, "ball.png")

square = sh.Polyline([[5.0, 55.0], [5.0, 5.0], [55.0, 5.0], [55.0, 55.0]], closed=True)
sh.io.write_polylines(square, "square.svg")
from_square = sh.signed_distance(sh.io.read_polylines("square.svg"), resolution=64)

globe = samples.sphere(3)
Path("coast.csv").write_text(
    "x,y,z\n0.57,-0.81,-0.1\n0.69,-0.58,-0.42\n0.93,0.16,-0.34\n0.91,0.33,0.26\n\n0.93,0.16,0.34\n0.75,-0.43,0.5\n0.5,-0.86,0.1\n"
)
coast = sh.io.read_curves("coast.csv", globe)
sh.io.write_curves(sh.close_curves(coast, globe), "whole.json", globe)
along = sh.signed_distance(sh.io.read_curves("whole.json", globe), globe)

labels = np.zeros((40, 40, 40), dtype=np.uint8)
labels[np.linalg.norm(np.indices(labels.shape) - 20.0, axis=0) < 15] = 3
np.save("labels.npy", labels)
organ = sh.io.read_labels("labels.npy")
view.save_row(
    [
        ("ball.ply, in millimetres", sdf, {"across": (1,), "levels": [2.54]}),
        ("square.svg", from_square, {"shape": square}),
        ("coast.csv", along, {"sources": coast, "view": np.array([0.9, -0.4, 0.2])}),
        ("labels.npy", organ.to_world(organ.surface(3))),
    ],
    "files_in_and_out.png",
)

# %%
# Mean radius of the offset by 2.54 millimetres of a ball whose radius is one inch:
measured = float(np.linalg.norm(sh.read("grown.stl").vertices, axis=1).mean())
print(f"{measured:.4g}")
