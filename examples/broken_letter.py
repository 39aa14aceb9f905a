"""Complete a broken letter
========================

A letter with gaps at its corners, completed: the longer the diffusion, the rounder the joins (Fig. 18).
"""

import numpy as np

import signedheat as sh
from signedheat import view

LETTER = np.array([[0, 0], [0, 5], [3, 5], [3, 4], [1, 4], [1, 3], [2.5, 3], [2.5, 2], [1, 2], [1, 0]])  # clockwise


def broken(corners: np.ndarray, gap: float) -> list[sh.Polyline]:
    """The sides of a polygon, cut short at both ends."""
    ends = np.roll(corners, -1, axis=0)
    along = (ends - corners) / np.linalg.norm(ends - corners, axis=1, keepdims=True)
    return [sh.Polyline([a + gap * t, b - gap * t]) for a, b, t in zip(corners, ends, along, strict=True)]


sides = broken(LETTER, gap=0.3)
sh.io.write_polylines(sides, "broken.svg")
figure = view.new_figure(11, 6.5)
areas, cuts = [], []
for k, (name, diffusion) in enumerate([("sharp", 1.0), ("round", 30.0)]):
    phi = sh.SignedHeatSolver(sh.Grid.around(sides, 160, padding=0.8), diffusion=diffusion).distance(sides)
    outline = max(phi.contour(0.0), key=lambda line: line.length)
    sh.io.write_polylines(outline, f"{name}.svg")

    areas.append(-outline.signed_area)
    cuts.append(np.linalg.norm(outline.points - LETTER[1], axis=1).min())
    axes = figure.add_subplot(1, 2, k + 1)
    view.draw_plane(phi, axes, sides)
    axes.set_title(f"diffusion {diffusion:g}: cuts {cuts[-1]:.3f} off the corner")
figure.savefig("broken_letter.png")
assert cuts[1] > 3 * cuts[0]

# %%
# Area of the letter, and what its missing corners may cost:
measured = areas[0]
print(f"{measured:.4g}")
