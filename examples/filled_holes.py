"""Holes closed, with colours, UV and groups
=========================================

`fill_holes` leaves a mesh as it is and adds faces. What belongs to faces goes over by ``origins``; what belongs to
vertices is where it was, and new vertices take that of the nearest one.
"""

import numpy as np
import scipy
import trimesh

import signedheat as sh
from signedheat import samples, view

whole = samples.torus(1.0, 0.4, n_around=72, n_across=36)
scan = samples.without_patches(whole, 5, 0.25, seed=1)
x, y, z = scan.vertices.T
uv = np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y) - 1.0)], axis=1) / (2 * np.pi) + 0.5
trimesh.Trimesh(scan.vertices, scan.faces, visual=trimesh.visual.TextureVisuals(uv=uv), process=False).export("a.glb")

given = trimesh.load("a.glb", force="mesh", process=False)
groups = (given.triangles_center[:, 2] > 0).astype(int)  # as of an OBJ: one for each face, or its colour
filled = sh.fill_holes(given)

new_groups = np.where(filled.origins < 0, 2, groups[filled.origins])
nearest = scipy.spatial.cKDTree(given.vertices).query(filled.vertices)[1]
textured = trimesh.visual.TextureVisuals(uv=given.visual.uv[nearest], material=given.visual.material)
trimesh.Trimesh(filled.vertices, filled.faces, visual=textured, process=False).export("filled.glb")

# %%
# A watertight surface has vertices of its own: `closest` says where on the faces given each lies, and −1 elsewhere.
solid = sh.complete(given)
surface = solid.surface(resolution=48)
found = solid.closest(surface.vertices)
on = found.faces >= 0
corners = given.visual.uv[given.faces[found.faces[on]]]
surface_uv = np.full((surface.n_vertices, 2), 0.5)
surface_uv[on] = np.einsum("nk,nkd->nd", found.barycentric[on], corners)

parts = [sh.TriangleMesh(filled.vertices, filled.faces[new_groups != 2]), filled, surface]
titles = "in: five holes", "every face, and new ones", "watertight"
around = [{"view": (40, -58)}] * 3
view.save_row(zip(titles, parts, around, strict=True), "filled_holes.png")

# %%
# Its volume beside that of the shape before it had holes:
closed = trimesh.load("filled.glb", force="mesh")
measured = float(closed.volume / whole.to_trimesh().volume)
print(f"{measured:.4g}")
