"""A generated mesh, made solid
============================

Meshes that networks generate have two skins, leaks and rubbish within. `seal` keeps what a ball of that diameter can
reach from outside, and fills the rest.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view

skins = [sh.offset(samples.torus(1.0, 0.4), width, resolution=48) for width in (0.03, -0.03)]
inner = sh.TriangleMesh(skins[1].vertices, skins[1].faces[:, ::-1])
rubbish = samples.sphere(2, radius=0.15, center=(1.0, 0, 0))
whole = samples.union(samples.union(skins[0], inner), rubbish)

centres = whole.vertices[whole.faces].mean(axis=1)
leaks = centres[np.random.default_rng(0).integers(skins[0].n_faces, size=30)]
lost = (np.linalg.norm(centres[:, None] - leaks, axis=2) < 0.06).any(axis=1)
generated = sh.TriangleMesh(whole.vertices, whole.faces[~lost])

as_it_is = sh.complete(generated)
solid = sh.complete(generated, seal=0.25)
cuts = [each.cut((0, 0, 0.02))[1].surface() for each in (as_it_is, solid)]
panels = ("in: two skins, 30 leaks, a ball within", generated), ("completed: hollow", cuts[0]), ("seal=0.25", cuts[1])
view.save_row([(title, thing, {"view": (42, -58)}) for title, thing in panels], "made_solid.png")

# %%
# Volume beside that of the outer skin:
measured = solid.volume / sh.complete(skins[0]).volume
print(f"{measured:.4g}")
