"""Points on a closed surface and around it, as trainers of 3-D generators read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.edges import edge_table
from ..mesh.unit_vectors import unit
from ..surfaces.triangle_mesh import TriangleMesh
from .completion import complete
from .sampling import WIDTHS, evenly_on

SHARP = np.deg2rad(30.0)
"""Angle between two faces from which on the edge between them is sharp."""


def training_points(
    surface: TriangleMesh, n: int, normalize: bool = False
) -> tuple[dict[str, NDArray[np.float32]], dict[str, NDArray[np.float32]]]:
    """n points of each kind, in single precision: those on a closed surface, and those around it with signed distances.

    To normalize is to move and scale the shape into the unit sphere.

    Returns
    -------
    on : dict
        ``random_surface``, evenly by area, and ``sharp_surface``, evenly along sharp edges: (n, 6) places and normals;
        along edges these are the means of both sides. (0, 6) where no edge is sharp.
    around : dict
        ``vol_points``, evenly in the cube around the sphere around the shape, ``random_near_points`` and
        ``sharp_near_points``, those on the surface moved by normal noise: (n, 3), with (n,) signed distances, negative
        inside, as ``vol_label``, ``random_near_label`` and ``sharp_near_label``.
    """
    random = np.random.default_rng(0)
    lower, upper = surface.bounds
    center = 0.5 * (lower + upper)
    radius = float(np.linalg.norm(surface.vertices - center, axis=1).max())
    if normalize:
        surface = TriangleMesh((surface.vertices - center) / radius, surface.faces)
        center, radius = np.zeros(3), 1.0
    solid = complete(surface, as_oriented=True)
    places, faces = evenly_on(surface.vertices[surface.faces], n, random)
    normals = unit(surface.face_area_vectors)
    on = {"random_surface": (places, normals[faces]), "sharp_surface": _on_sharp_edges(surface, normals, n, random)}
    around = {"vol": center + radius * random.uniform(-1.0, 1.0, (n, 3))}
    for name, (middles, _) in zip(("random_near", "sharp_near"), on.values(), strict=True):
        widths = radius * np.resize(WIDTHS, len(middles))
        around[name] = middles + widths[:, None] * random.normal(size=middles.shape)
    labelled: dict[str, NDArray[np.float64]] = {}
    for name, points in around.items():
        labelled |= {f"{name}_points": points, f"{name}_label": solid.distance(points)}
    kept = {name: np.concatenate(both, axis=1).astype(np.float32) for name, both in on.items()}
    return kept, {name: values.astype(np.float32) for name, values in labelled.items()}


def _on_sharp_edges(
    surface: TriangleMesh, normals: NDArray[np.float64], n: int, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) places evenly along sharp edges, and the means of the normals on both sides."""
    pairs = edge_table(surface.faces).pairs
    pairs = pairs[normals[pairs // 3].prod(axis=1).sum(axis=1) < np.cos(SHARP)]
    if not len(pairs):
        return np.zeros((0, 3)), np.zeros((0, 3))
    tails, heads = surface.vertices[surface.faces.ravel()[pairs]].swapaxes(0, 1)  # halfedges run opposite ways
    ends = np.cumsum(np.linalg.norm(heads - tails, axis=1))
    marks = (np.arange(n) + random.random(n)) / n * ends[-1]
    edges = np.minimum(np.searchsorted(ends, marks, side="right"), len(ends) - 1)
    places = tails[edges] + random.random((n, 1)) * (heads - tails)[edges]
    return places, unit(normals[pairs // 3].sum(axis=1))[edges]
