"""What is imposed at the source
=============================

Two broken circles on a plane, with different radii: φ free at the source, zero on the whole, or one level on each.
:class:`signedheat.constraints.Soft` is between the first two.
"""

import numpy as np

import signedheat as sh
from signedheat import view

angle = np.linspace(0, -2 * np.pi, 97)
ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
arcs = [sh.Polyline(radius * ring[a : a + 9]) for radius in (1.0, 1.6) for a in range(0, 96, 12)]
solver = sh.SignedHeatSolver(sh.Grid((-2.2, -2.2), 0.04, (111, 111)))

figure = view.new_figure(13.5, 4.2)
for k, constraint in enumerate((sh.constraints.Free(), sh.constraints.ZeroSet(), sh.constraints.EachComponent())):
    phi = solver.distance(arcs, constraint)
    axes = figure.add_subplot(1, 3, k + 1)
    view.draw_plane(phi, axes, arcs)
    axes.set_title(type(constraint).__name__)
figure.savefig("constraints.png")
zero = solver.distance(arcs, sh.constraints.ZeroSet())

# %%
# Mean of φ on the outer circle, where it is to be zero:
measured = float(np.mean(zero(np.concatenate([line.points for line in arcs]))))
print(f"{measured:.4g}")
