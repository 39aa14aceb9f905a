"""Bodies that overlap
===================

Modellers put bodies into one another. What is inside others is left out, and the rest is one solid.
"""

import signedheat as sh
from signedheat import samples, view

shape = samples.union(samples.sphere(4, center=(-0.5, 0, 0)), samples.sphere(4, center=(0.5, 0, 0)))
grid = sh.Grid.around(shape.bounds, 64)
solid = sh.complete(shape)
given, united = sh.sharpen(sh.SignedHeatSolver(grid).distance(shape)), solid.field(grid=grid)

view.save_row(
    [
        ("two balls, one mesh", shape),
        ("as they were given", given, {"shape": shape, "across": (1,)}),
        ("the solid, and the faces that bound it", united, {"shape": solid.faces, "across": (1,)}),
    ],
    "overlapping_bodies.png",
)

# %%
# Distance from the middle between two unit balls 1 apart to the circle where they meet:
measured = float(united([0.0, 0.0, 0.0]))
print(f"{measured:.4g}")
