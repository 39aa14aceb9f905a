"""Distance from points on a surface
=================================

Points have no sides: distance grows in all directions along the surface.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

ball = samples.sphere(4)
poles = ball.points_at([int(ball.vertices[:, 2].argmax()), int(ball.vertices[:, 2].argmin())])
phi = sh.sharpen(sh.SignedHeatSolver(ball).distance(poles))

part = samples.torus(1.0, 0.45)
source = part.points_at([200, 2500])
on_part = sh.sharpen(sh.SignedHeatSolver(part).distance(source))
view.save_row(
    [
        ("from both poles", phi, {"sources": [poles]}),
        ("from two points of a torus", on_part, {"sources": [source], "view": np.array([0.4, -0.6, 0.9])}),
    ],
    "distance_from_points.png",
)

# %%
# Distance from the poles to the equator:
measured = float(phi([[1.0, 0.0, 0.0]])[0])
print(f"{measured:.4g}")
