"""Training points on a closed surface and around it, in the layout of public 3-D generators."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..mesh.edges import edge_table
from ..mesh.unit_vectors import unit
from ..surfaces.triangle_mesh import TriangleMesh
from .completion import complete
from .sampling import WIDTHS, evenly_on

SHARP = np.deg2rad(30.0)
"""Angle between two faces above which their edge is sharp."""


def training_points(
    surface: TriangleMesh, n: int, normalize: bool = False
) -> tuple[dict[str, NDArray[np.float32]], dict[str, NDArray[np.float32]]]:
    """Sample n points of each kind in single precision: on a closed surface, and around it with signed distances.

    With `normalize`, the shape is first moved and scaled into the unit sphere.

    Returns
    -------
    on : dict
        ``random_surface``, uniform in area, and ``sharp_surface``, uniform along sharp edges: (n, 6) positions and
        normals, which are means of both sides along edges. (0, 6) if no edge is sharp.
    around : dict
        (n, 3) ``vol_points``, uniform in the cube around the bounding sphere, ``random_near_points`` and
        ``sharp_near_points``, which are those on the surface moved by normal noise. Their (n,) signed distances,
        negative inside, are ``vol_label``, ``random_near_label`` and ``sharp_near_label``.
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
    labelled: dict[str, Floats] = {}
    for name, points in around.items():
        labelled |= {f"{name}_points": points, f"{name}_label": solid.distance(points)}
    kept = {name: np.concatenate(both, axis=1).astype(np.float32) for name, both in on.items()}
    return kept, {name: values.astype(np.float32) for name, values in labelled.items()}


def _on_sharp_edges(
    surface: TriangleMesh, normals: Floats, n: int, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """(n, 3) places uniform along sharp edges, and means of the normals on both sides."""
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
