"""Intrinsic triangulations, and meshes that get one of their own for every source, lowered to intrinsic meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...diagnostics import IntrinsicTriangles
from ...discretization import discretize
from ...domains.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from ...domains.triangle_mesh import TriangleMesh
from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...geometry.mollification import mollify
from .discretization import SurfaceDiscretization

THICKNESS = 1e-9
"""The same, for what is computed on a triangulation that has been made."""


@discretize.register
def _(domain: IntrinsicTriangulation) -> SurfaceDiscretization:
    return lowered(domain)


@dataclass(frozen=True, eq=False)
class Retriangulated:
    """A mesh that gets an intrinsic triangulation of its own for every set of sources; fields stay on the mesh.

    Stands in for the mesh's discretisation until the sources are known.
    """

    mesh: TriangleMesh
    progress: Callable[[float], None] | None = field(default=None, repr=False)

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Refine the mesh with the sources along edges."""
        inner = None if self.progress is None else lambda share, _: self.progress(share)
        domain = intrinsic_delaunay(self.mesh, keep=sources, refine=True, progress=inner)
        own = np.arange(self.mesh.n_vertices)
        return lowered(domain, domain=self.mesh, restriction=own).adapt(sources)


def lowered(triangulation: IntrinsicTriangulation, **options: Any) -> SurfaceDiscretization:
    """An intrinsic triangulation as the three steps see it; what is flat against an edge that stays, is thickened."""
    triangles = triangulation.triangles
    lengths, added = mollify(triangles.edge_lengths, THICKNESS)
    if added:
        corners, edges = triangles.corner_vertices, triangles.edges
        triangles = IntrinsicMesh.from_lengths(corners, lengths, triangles.n_vertices, edges)
    options = {
        "domain": triangulation,
        "transfer": triangulation.transfer,
        "spacing": spacing(triangles),
        "notes": (IntrinsicTriangles(triangulation.summary),),
        **options,
    }
    return SurfaceDiscretization(triangles=triangles, **options)


def spacing(triangles: IntrinsicMesh) -> float:
    """h: half the mean edge length, where the mean is over the area of the surface.

    The plain mean would follow the many small triangles that refinement puts where the mesh needs them, and then
    ``√t`` would not bridge the others.
    """
    return 0.5 * float(triangles.face_areas @ triangles.edge_lengths.mean(axis=1) / triangles.face_areas.sum())
