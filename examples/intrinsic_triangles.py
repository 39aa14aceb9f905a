"""Triangles along the surface
===========================

Slivers of a CAD part, and the triangles on the same surface on which the method runs: their edges run along the
surface, across the faces. Both are drawn on the polygons that they have in common.
"""

import numpy as np

import signedheat as sh
from signedheat import view

angle = np.linspace(0, np.pi / 2, 41)
rim = np.stack([np.cos(angle), 0.5 * np.sin(angle), 0 * angle], axis=1)
wall = np.concatenate([rim, rim + np.array([0, 0, 1]), [[0, 0, 1]]])  # a bent wall of needles, with a fan on it
strip = [[k, k + 1, k + 42] for k in range(40)] + [[k, k + 42, k + 41] for k in range(40)]
mesh = sh.TriangleMesh(wall, strip + [[k + 41, k + 42, 82] for k in range(40)])
better = sh.intrinsic_delaunay(mesh, refine=True)
pieces, interpolate = sh.common_subdivision(better)

figure = view.new_figure(11, 5.5)
for k, (title, shown) in enumerate([("faces of the part", mesh), ("cut by the intrinsic triangles", pieces)]):
    axes = figure.add_subplot(1, 2, k + 1, projection="3d")
    polygons = shown.faces if k == 0 else shown.polygons
    loops = [[*shown.vertices[[*polygon, polygon[0]]], [np.nan] * 3] for polygon in polygons]
    axes.plot(*np.concatenate(loops).T, color="#20303c", linewidth=0.6)
    axes.set_box_aspect((1, 0.5, 1), zoom=1.1)
    axes.set_axis_off()
    axes.view_init(25, 35)
    axes.set_title(title)
figure.savefig("intrinsic_triangles.png")
assert interpolate.shape == (pieces.n_vertices, better.n_vertices)

# %%
# Smallest angle of the new triangles, in degrees:
measured = float(np.degrees(better.corner_angles.min()))
print(f"{measured:.4g}")
