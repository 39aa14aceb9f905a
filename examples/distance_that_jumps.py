"""Curves that bound no region
===========================

Curves that bound no region (Sec. 7.2, Figs. 12–14): distance is continuous except across a short cut.

A loop around the tube of a torus; one around its hole; and on a sphere an equator whose halves have opposite
orientations. The sources are yellow.
"""

import matplotlib.pyplot as plt
import numpy as np

import signedheat as sh
from signedheat.diagnostics import Jumps
from signedheat.samples import sphere, torus
from signedheat.view import draw_surface

ring = torus(n_around=60, n_across=24)
ball = sphere(3)
half = np.linspace(0, np.pi, 60)
equator = [ball.polyline(np.stack([np.cos(half), side * np.sin(half), 0 * half], axis=1)) for side in (1, -1)]
cases = {
    "round the tube": (ring, [ring.path(np.arange(24), closed=True)]),
    "round the hole": (ring, [ring.path(np.arange(60) * 24 + 4, closed=True)]),
    "halves against each other": (ball, equator),
}
figure, axes = plt.subplots(1, 3, figsize=(13, 4.5), layout="constrained")
lengths = []
for panel, (title, (mesh, sources)) in zip(axes, cases.items(), strict=True):
    phi = sh.piecewise_distance(sources, mesh)
    cut = phi.domain.cuts(phi.values)[0]
    lengths.append(cut.length)
    print(f"{title}: {phi.diagnostics.note(Jumps).gap:.1%} from the least objective at most; {cut}")
    direction = np.array([0.2, -0.8, 0.7]) if mesh is ring else np.array([0.9, 0.3, 0.5])
    draw_surface(phi, panel, sources, view=direction)
    panel.set_title(f"{title}: cut {cut.length:.2f} long", fontsize=10)
figure.savefig("distance_that_jumps.png")
plt.close(figure)

# %%
# length of the first cut: once across the tube, whose radius is 0.4:
measured = lengths[0]
print(f"{measured:.4g}")
