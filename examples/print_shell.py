"""Print an open sheet: a shell with a drain hole
==============================================

A whole application: a bowl that is only a surface gets a wall that a printer can print, and a hole so that resin
drains.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

ball = samples.sphere(4)
bowl = sh.TriangleMesh(ball.vertices, ball.faces[ball.vertices[ball.faces][..., 2].max(axis=1) <= 0])
wall = sh.morphology.thicken(bowl, 0.06, resolution=52)

grid = sh.Grid.around(wall.bounds, resolution=52, padding=0.15)
solid = sh.signed_distance(wall, grid)
x, y, _ = np.moveaxis(grid.points, -1, 0)
drill = sh.Field(grid, np.hypot(x, y) - 0.2)
drained = sh.sharpen(solid - drill)
part = drained.contour()
part.save("bowl.stl")

view.save_row(
    [
        ("in: an open sheet", bowl, {"view": (35, -58)}),
        ("its wall, with a drain hole", drained, {"shape": bowl, "across": (1,)}),
        ("out: closed, 0.12 thick, from below", part, {"view": (-40, -58)}),
    ],
    "print_shell.png",
)

# %%
# Volume: half of the sphere times the wall, less the hole:
measured = float(part.to_trimesh().volume)
print(f"{measured:.4g}")
