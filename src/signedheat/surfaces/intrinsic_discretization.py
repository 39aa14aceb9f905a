"""Discretisation by intrinsic triangulations, made once for a mesh or anew for each set of sources (Sec. 9.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np

from ..diagnostics import IntrinsicTriangles
from ..discretization import discretize
from ..errors import GeometryError, SignedHeatError
from ..jobs import Progress
from ..mesh.intrinsic_mesh import IntrinsicMesh, mollify
from .intrinsic_triangulation import LARGEST_ANGLE, IntrinsicTriangulation, intrinsic_delaunay
from .source_segments import CurveGroups
from .surface_discretization import SurfaceDiscretization, refuse_too_many, vertices_joined
from .triangle_mesh import TriangleMesh

LARGE_ANGLE_SHARE = 0.0015
"""Fraction of the area in triangles with an angle that is larger than all angles where none is below `LARGEST_ANGLE`,
120°, from which a mesh is refined."""
SMALL_ANGLE_SHARE = 0.1
"""Fraction of the area in triangles with an angle below `SMALL_ANGLE`, from which a mesh is refined."""
SMALL_ANGLE = 10.0
"""Angle in degrees. Needles resolve distance by their length only, even right-angled ones."""
AUTO_ANGLE = 20.0
"""Smallest angle of "auto", in degrees: the vertices that 28 would take are better spent on large triangles."""
COARSEST_TRIANGLE = 1.41
"""Largest circumradius, relative to that of a mean triangle: larger ones resolve neither curves nor directions."""
BYTES_PER_REFINED = 750
"""Memory of each triangle of a refinement, besides that of distance on it."""
SHARE_OF_PIECE = 0.5
"""h, relative to the length of the pieces of a curve that is to be completed, if h would be larger otherwise."""
MOLLIFIED_MARGIN = 1e-9
"""Margin of the triangle inequalities, relative to the mean length, in the triangles that the method runs on."""


@discretize.register
def _(domain: IntrinsicTriangulation) -> SurfaceDiscretization:
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered(domain)


@dataclass(frozen=True, eq=False)
class Retriangulated:
    """A mesh of which `adapt` makes an intrinsic triangulation for the sources; fields are reported on the mesh."""

    mesh: TriangleMesh
    progress: Progress | None = field(default=None, repr=False)
    coarsest: ClassVar[float] = COARSEST_TRIANGLE

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Refine the mesh intrinsically, with the sources along edges."""
        return refined(self.mesh, self.progress, sources, coarsest=self.coarsest).adapt(sources)


class RetriangulatedForZeroSet(Retriangulated):
    """`Retriangulated` for the zero set alone, with h small enough that small pieces of curves are not blurred."""

    coarsest: ClassVar[float] = np.inf

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
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


def lowered_by_angles(domain: Any, progress: Progress | None = None) -> Any:
    """Discretise a domain; refine meshes with many large or small angles, unless faces are too thin for that."""
    if isinstance(domain, TriangleMesh) and is_spoiled(domain):
        try:
            return refined(domain, progress, angle=AUTO_ANGLE)
        except GeometryError:
            pass
    return discretize(domain)


def checked_intrinsic(intrinsic: bool | Literal["auto"]) -> bool | Literal["auto"]:
    """Return the option `intrinsic` of `SignedHeatSolver`; refuse what it cannot be."""
    if not (isinstance(intrinsic, bool) or (isinstance(intrinsic, str) and intrinsic == "auto")):
        raise SignedHeatError(f"intrinsic must be 'auto', True or False, not {intrinsic!r:.40}", element="intrinsic")
    return intrinsic


def is_spoiled(mesh: TriangleMesh) -> bool:
    """Whether so much of the area has a large angle, or is needles, that the mesh is to be refined."""
    a, b, c = np.sort(mesh.edge_lengths[mesh.edges.face_edges], axis=1).T
    areas = mesh.face_areas
    total = max(float(areas.sum()), 1e-300)
    large = c**2 - a**2 - b**2 > -2 * np.cos(np.radians(180 - 2 * LARGEST_ANGLE)) * a * b
    small = b**2 + c**2 - a**2 > 2 * np.cos(np.radians(SMALL_ANGLE)) * b * c
    return bool(areas[large].sum() >= LARGE_ANGLE_SHARE * total or areas[small].sum() >= SMALL_ANGLE_SHARE * total)


def refined(
    mesh: TriangleMesh,
    progress: Progress | None = None,
    keep: Sequence[Any] = (),
    angle: float = 28.0,
    coarsest: float = COARSEST_TRIANGLE,
) -> SurfaceDiscretization:
    """Discretise a mesh by its intrinsic Delaunay refinement; fields are reported on the mesh, and kept on both."""
    # refinement only adds triangles
    refuse_too_many(mesh.n_faces, mesh.n_faces, "triangles", more=BYTES_PER_REFINED * mesh.n_faces)
    domain = intrinsic_delaunay(mesh, keep, refine=True, angle=angle, coarsest=coarsest, progress=progress)
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered(domain, domain=mesh, restriction=mesh.places, triangulation=domain)


def lowered(triangulation: IntrinsicTriangulation, /, **options: Any) -> SurfaceDiscretization:
    """Discretise an intrinsic triangulation, with longer edges if triangles are flat; options override fields."""
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
