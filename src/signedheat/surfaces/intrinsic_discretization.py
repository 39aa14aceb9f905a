"""Intrinsic triangulations, and meshes that get one per set of sources, lowered to intrinsic meshes (Sec. 9.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..diagnostics import IntrinsicTriangles
from ..discretization import discretize
from ..errors import GeometryError
from ..mesh.intrinsic_mesh import IntrinsicMesh, mollify
from ..progress import Progress
from .curve_groups import CurveGroups
from .intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from .surface_discretization import SurfaceDiscretization, refuse_too_many
from .triangle_mesh import TriangleMesh

SPOILED = 0.0015
"""Fraction of the area in triangles with an angle above `LARGE`, from which a mesh is refined."""
LARGE = 120.0
"""Degrees."""
NEEDLES = 0.1
"""Fraction of the area in triangles with an angle below `SMALL`, from which a mesh is refined."""
SMALL = 10.0
"""Degrees. Needles resolve distance by their length only, even right-angled ones."""
ANGLE = 20.0
"""Smallest angle of "auto", in degrees: vertices that 28 would take are better spent on large triangles."""
COARSEST = 1.41
"""Largest triangles of "auto", over the mean one: curves on coarser ones are not resolved."""
BYTES_REFINED = 750
"""What each triangle of a refinement takes itself, besides distance on it."""
SHARE_OF_PIECE = 0.5
"""h over the length of the pieces of a curve that is to be completed, where triangles are larger."""
THICKNESS = 1e-9
"""Margin of the triangle inequalities, relative to the mean length, in the triangles that the method runs on."""


@discretize.register
def _(domain: IntrinsicTriangulation) -> SurfaceDiscretization:
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered(domain)


@dataclass(frozen=True, eq=False)
class Retriangulated:
    """A mesh for which an intrinsic triangulation is made for every set of sources; fields are reported on the mesh.

    Takes the place of the discretisation until `adapt` is called with the sources.
    """

    mesh: TriangleMesh
    progress: Progress | None = field(default=None, repr=False)

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Make the intrinsic Delaunay refinement of the mesh that has the sources along its edges."""
        return refined(self.mesh, self.progress, sources).adapt(sources)


class RetriangulatedForZeroSet(Retriangulated):
    """The same for those who want the zero set alone: h suits pieces of curves, not triangles far away.

    With the t of large triangles, pieces of a curve that is smaller than these are one blot of heat, and
    how the curve goes on between them is lost. Gaps are about as long as pieces are, or shorter. Of several curves
    the smallest counts.
    """

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Make the refinement."""
        surface, groups = super().adapt(sources)
        scales = CurveGroups.of(self.mesh, sources).scales
        parts = [part for group in groups for part in group if len(part.ends)]
        if not parts or not len(scales):
            return surface, groups
        areas = surface.triangles.face_areas[np.concatenate([part.faces for part in parts])]
        lengths = np.concatenate([part.lengths for part in parts])
        own = 0.5 * float(np.average(np.sqrt(4 / 3**0.5 * areas), weights=lengths))
        return replace(surface, spacing=min(surface.spacing, max(SHARE_OF_PIECE * scales.min(), own))), groups


def lowered_by_angles(domain: Any, progress: Progress | None = None) -> Any:
    """The discretisation of a domain; triangle meshes with many large or small angles are refined intrinsically.

    Those whose faces are too thin for that stay as they are, with the note `LargeAngles`.
    """
    if isinstance(domain, TriangleMesh) and is_spoiled(domain):
        try:
            return refined(domain, progress, (), ANGLE, COARSEST)
        except GeometryError:
            pass
    return discretize(domain)


def is_spoiled(mesh: TriangleMesh) -> bool:
    """Whether so much of the area has a large angle, or is needles, that the mesh is to be refined."""
    a, b, c = np.sort(mesh.edge_lengths[mesh.edges.face_edges], axis=1).T
    areas = mesh.face_areas
    total = max(float(areas.sum()), 1e-300)
    large = c**2 - a**2 - b**2 > -2 * np.cos(np.radians(LARGE)) * a * b
    small = b**2 + c**2 - a**2 > 2 * np.cos(np.radians(SMALL)) * b * c
    return bool(areas[large].sum() >= SPOILED * total or areas[small].sum() >= NEEDLES * total)


def refined(
    mesh: TriangleMesh,
    progress: Progress | None = None,
    keep: Sequence[Any] = (),
    angle: float = 28.0,
    coarsest: float = np.inf,
) -> SurfaceDiscretization:
    """The intrinsic Delaunay refinement of a mesh; fields are reported on the mesh, and kept on the refinement."""
    refuse_too_many(mesh.n_faces, mesh.n_faces, "triangles", more=BYTES_REFINED * mesh.n_faces)  # which only grow
    domain = intrinsic_delaunay(mesh, keep, refine=True, angle=angle, coarsest=coarsest, progress=progress)
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    lowered_mesh = lowered(domain, domain=mesh, restriction=np.arange(mesh.n_vertices))
    return replace(lowered_mesh, triangulation=domain)


def lowered(triangulation: IntrinsicTriangulation, **options: Any) -> SurfaceDiscretization:
    """The discretisation of an intrinsic triangulation; triangles that are nearly flat are mollified."""
    triangles = triangulation.triangles
    lengths, added = mollify(triangles.edge_lengths, THICKNESS)
    if added:
        thicker = IntrinsicMesh.from_lengths(triangles.corner_vertices, lengths, triangles.n_vertices, triangles.edges)
        triangles = replace(triangles, corner_positions=thicker.corner_positions)  # the first faces of edges stay first
    options = {
        "domain": triangulation,
        "transfer": triangulation.transfer,
        "spacing": spacing(triangles),
        "notes": (IntrinsicTriangles(triangulation.summary),),
        **options,
    }
    return SurfaceDiscretization(triangles=triangles, **options)


def spacing(triangles: IntrinsicMesh) -> float:
    """h: half the area-weighted mean edge length.

    The plain mean would be dominated by the many small triangles that refinement may insert in a small region, and
    ``√t`` would be too short for the others.
    """
    return 0.5 * float(triangles.face_areas @ triangles.edge_lengths.mean(axis=1) / triangles.face_areas.sum())
