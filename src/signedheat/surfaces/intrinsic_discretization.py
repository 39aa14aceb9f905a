"""Discretisation by intrinsic triangulations, made once for a mesh, or anew for each set of sources (Sec. 9.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..diagnostics import IntrinsicTriangles
from ..discretization import discretize
from ..errors import GeometryError
from ..jobs import bound_progress
from ..mesh.intrinsic_mesh import IntrinsicMesh, mollify
from .intrinsic_triangulation import LARGEST_ANGLE, IntrinsicTriangulation, intrinsic_delaunay
from .source_segments import CurveGroups
from .surface_discretization import SurfaceDiscretization, refuse_too_many, vertices_joined
from .triangle_mesh import TriangleMesh

LARGE_ANGLE_SHARE = 0.0015
"""A mesh is refined if at least this share of its area is in triangles with an angle above 120°, the largest that a
triangle without angles below `LARGEST_ANGLE` has."""
SMALL_ANGLE_SHARE = 0.1
"""A mesh is refined if at least this share of its area is in triangles with an angle below `SMALL_ANGLE`."""
SMALL_ANGLE = 10.0
"""Angle below which triangles are needles, in degrees. These resolve distance along their length only."""
AUTO_ANGLE = 20.0
"""Smallest angle of ``intrinsic="auto"``, in degrees. With 28 there would be many more vertices in small triangles."""
COARSEST_TRIANGLE = 1.41
"""Largest circumradius, relative to that of a mean triangle; larger triangles resolve neither curves nor directions."""
BYTES_PER_REFINED = 750
"""Memory per triangle of a refinement, besides that of distance on it."""
SHARE_OF_PIECE = 0.5
"""For curves with gaps that are to be completed, h is at most this share of the length of their pieces, or as large as
the triangles along them."""
MOLLIFIED_MARGIN = 1e-9
"""Least margin of the triangle inequalities, relative to the mean edge length, in the triangles of the method."""


@discretize.register
def _(domain: IntrinsicTriangulation) -> SurfaceDiscretization:
    """Discretise an intrinsic triangulation; fields have values at all of its vertices."""
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered(domain)


@dataclass(frozen=True, eq=False)
class Retriangulated:
    """A mesh that `adapt` discretises by an intrinsic triangulation for given sources; fields are on the mesh."""

    mesh: TriangleMesh
    coarsest: ClassVar[float] = COARSEST_TRIANGLE

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Refine the mesh intrinsically with the sources along edges; return the discretisation, and sources on it."""
        return refined(self.mesh, sources, coarsest=self.coarsest).adapt(sources)


class RetriangulatedForZeroSet(Retriangulated):
    """`Retriangulated` for the zero set alone, with h so small that short curves with gaps are not blurred."""

    coarsest: ClassVar[float] = np.inf

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Refine the mesh as `Retriangulated` does, with a smaller h for short curves with gaps."""
        surface, groups = super().adapt(sources)
        scales = CurveGroups.of(self.mesh, sources).scales
        parts = [part for group in groups for part in group if len(part.ends)]
        if not parts or not len(scales):
            return surface, groups
        areas = surface.triangles.face_areas[np.concatenate([part.faces for part in parts])]
        lengths = np.concatenate([part.lengths for part in parts])
        own = 0.5 * float(np.average(np.sqrt(4 / 3**0.5 * areas), weights=lengths))
        smaller = min(surface.spacing, max(SHARE_OF_PIECE * scales.min(), own))
        return replace(surface, spacing=smaller, unturned=None), groups


def lowered_by_angles(domain: Any) -> Any:
    """Discretise a domain, as ``intrinsic="auto"`` does: meshes with many large or small angles are refined.

    They are not refined if faces are too thin for that.
    """
    if isinstance(domain, TriangleMesh) and is_spoiled(domain):
        try:
            return refined(domain, angle=AUTO_ANGLE)
        except GeometryError:
            pass
    return discretize(domain)


def is_spoiled(mesh: TriangleMesh) -> bool:
    """Whether so much of the area is in triangles with a large angle, or in needles, that the mesh is to be refined."""
    a, b, c = np.sort(mesh.edge_lengths[mesh.edges.face_edges], axis=1).T
    areas = mesh.face_areas
    total = max(float(areas.sum()), 1e-300)
    large = c**2 - a**2 - b**2 > -2 * np.cos(np.radians(180 - 2 * LARGEST_ANGLE)) * a * b
    small = b**2 + c**2 - a**2 > 2 * np.cos(np.radians(SMALL_ANGLE)) * b * c
    return bool(areas[large].sum() >= LARGE_ANGLE_SHARE * total or areas[small].sum() >= SMALL_ANGLE_SHARE * total)


def refined(
    mesh: TriangleMesh,
    keep: Sequence[Any] = (),
    angle: float = 28.0,
    coarsest: float = COARSEST_TRIANGLE,
) -> SurfaceDiscretization:
    """Discretise a mesh by its intrinsic Delaunay refinement; fields are on the mesh, and also kept on the refinement.

    The other arguments are those of `intrinsic_delaunay`.
    """
    # refinement only adds triangles
    refuse_too_many(mesh.n_faces, mesh.n_faces, "triangles", more=BYTES_PER_REFINED * mesh.n_faces)
    domain = intrinsic_delaunay(mesh, keep, refine=True, angle=angle, coarsest=coarsest, progress=bound_progress())
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered(domain, domain=mesh, restriction=mesh.places, triangulation=domain)


def lowered(triangulation: IntrinsicTriangulation, /, **options: Any) -> SurfaceDiscretization:
    """Discretise an intrinsic triangulation, with lengthened edges if triangles are flat.

    Options replace attributes of the `SurfaceDiscretization`.
    """
    triangles = triangulation.triangles
    lengths, added = mollify(triangles.edge_lengths, MOLLIFIED_MARGIN)
    if added:
        thicker = IntrinsicMesh.from_lengths(triangles.corner_vertices, lengths, triangles.n_vertices, triangles.edges)
        # which halfedge leads each edge must not change
        triangles = replace(triangles, corner_positions=thicker.corner_positions)
    mesh = triangulation.mesh
    options = {
        "domain": triangulation,
        "restriction": np.concatenate([mesh.places, np.arange(mesh.n_vertices, triangles.n_vertices)]),
        "transfer": triangulation.transfer,
        "spacing": spacing(triangles),
        "notes": (IntrinsicTriangles(triangulation.summary), *vertices_joined(mesh)),
        **options,
    }
    return SurfaceDiscretization(triangles=triangles, **options)


def spacing(triangles: IntrinsicMesh) -> float:
    """h: half the area-weighted mean edge length, which many small triangles in a small region do not dominate."""
    return 0.5 * float(triangles.face_areas @ triangles.edge_lengths.mean(axis=1) / triangles.face_areas.sum())
