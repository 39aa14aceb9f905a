"""Distance from points on a surface
=================================

Points have no sides: distance grows in all directions along the surface.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

EXPECTED = (np.pi / 2, 0.03)
"""Distance from the poles to the equator."""


def main(folder: Path) -> float:
    """Write a picture; return the distance at the equator."""
    ball = samples.sphere(5)
    poles = ball.points_at([int(ball.vertices[:, 2].argmax()), int(ball.vertices[:, 2].argmin())])
    phi = sh.sharpen(sh.SignedHeatSolver(ball).distance(poles))

    part = samples.torus(1.0, 0.45)
    source = part.points_at([200, 2500])
    on_part = sh.sharpen(sh.SignedHeatSolver(part).distance(source))
    view.save_row(
        folder / "distance_from_points.png",
        ("from both poles", phi, {"sources": [poles]}),
        ("from two points of a torus", on_part, {"sources": [source], "view": np.array([0.4, -0.6, 0.9])}),
    )
    return float(phi([[1.0, 0.0, 0.0]])[0])


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
