"""The zero set of distance to curves on triangle meshes, also where these run along the rim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..discretization import discretize
from ..domains.curves import Curve, CurvesAndPoints
from ..domains.kinds import SurfaceDomain
from ..domains.triangle_mesh import TriangleMesh
from ..fields.vertex_field import VertexField
from ..geometry.components import connected_components
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..lowering.surface.discretization import SurfaceDiscretization
from .small_curves import flattened

ZERO = 1e-7
"""Value, in mean edge lengths, up to which φ is zero at a vertex of the rim."""
WHOLE = 0.5
"""Length, relative to the shortest curve given, below which a loop is none of those that complete them."""


def zero_set(field: VertexField[SurfaceDomain], curves: CurvesAndPoints) -> list[Curve]:
    """The zero set of a field as curves: those that follow or complete the given ones.

    Where a curve runs along the rim of the surface, φ has one sign beside it, and is zero up to rounding on it: there
    the rim counts as the other side. Loops that are shorter than what they would complete are left out.
    """
    if not isinstance(field.domain, TriangleMesh):
        return field.contour(0.0)
    fine = field.finest
    surface = discretize(fine.domain)
    assert isinstance(surface, SurfaceDiscretization)
    values = fine.values.copy()
    beyond_the_rim(surface.triangles, values)
    found = replace(fine, values=values).contour(0.0)
    shortest = min(
        length(field.domain, each) for each in flattened(curves) if isinstance(each, Curve) and each.oriented
    )
    whole = [curve for curve in found if not curve.closed or length(field.domain, curve) > WHOLE * shortest]
    return whole or found


def beyond_the_rim(triangles: IntrinsicMesh, values: NDArray[np.float64]) -> None:
    """Give zeros in rows along the rim the sign of the rim beyond both ends; without such, that not found beside."""
    least = ZERO * float(triangles.lengths_of_edges.mean())
    zero, ends = np.abs(values) <= least, triangles.edges.vertices
    rim = ends[triangles.edges.face_counts == 1]
    row = connected_components(len(values), *rim[zero[rim].all(axis=1)].T)
    in_row = np.zeros(len(values), dtype=bool)
    in_row[rim[zero[rim]]] = True

    def signs_beside(edges: NDArray[np.int64]) -> NDArray[np.float64]:
        """Sum of the signs at the other ends of edges from each row."""
        tail, head = np.concatenate([edges, edges[:, ::-1]]).T
        out = in_row[tail] & ~zero[head]
        sums: NDArray[np.float64] = np.bincount(row[tail[out]], np.sign(values[head[out]]), len(values)).astype(float)
        return sums

    beyond, beside = signs_beside(rim), signs_beside(ends)
    long = np.bincount(row[in_row], minlength=len(values)) > 1
    side = np.where(np.abs(beyond) > 1, np.sign(beyond), np.where(long, -np.sign(beside), 0.0))[row]
    chosen = in_row & (side != 0)
    values[chosen] = least * side[chosen]


def length(mesh: TriangleMesh, curve: Curve) -> float:
    """Length of a curve, measured straight between its points."""
    points = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    following = np.roll(points, -1, axis=0) if curve.closed else points[1:]
    return float(np.linalg.norm(following - points[: len(following)], axis=1).sum())
