"""Strokes of a curve that disagree
================================

A curve drawn in strokes, every third one in the wrong direction. Which they are is found from where strokes end and
begin. They are flipped, and the curve is completed.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

mesh = samples.sphere(4)
angle = np.linspace(0, 2 * np.pi, 181)
height = 0.3 + 0.25 * np.sin(3 * angle)
wave = np.stack([np.cos(angle), np.sin(angle), height], axis=1)
strokes = [mesh.polyline(wave[a : a + 16]) for a in range(0, 180, 20)]  # four of 20 steps are missing
drawn = [stroke.reversed() if k % 3 == 0 else stroke for k, stroke in enumerate(strokes)]

found = sh.orientation(drawn, mesh)
assert found.turned.tolist() in ([k % 3 == 0 for k in range(9)], [k % 3 != 0 for k in range(9)])
given = sh.SignedHeatSolver(mesh).distance(drawn)
agreeing = sh.signed_distance(sh.orient(drawn, mesh), mesh, as_oriented=True)

eye = np.array([0.5, -0.6, 0.6])
view.save_row(
    [
        ("every third stroke flipped", given, {"sources": drawn, "view": eye}),
        (f"{found.turned.sum()} flipped back", agreeing, {"sources": found.curves, "view": eye}),
    ],
    "flipped_strokes.png",
)
whole = sh.signed_distance(mesh.polyline(wave[:-1], closed=True), mesh).values

# %%
# Root mean square difference from the distance to the whole curve:
measured = float(np.sqrt(np.mean((agreeing.values - whole) ** 2)))
print(f"{measured:.4g}")
