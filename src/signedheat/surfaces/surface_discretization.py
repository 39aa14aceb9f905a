"""Surfaces of every kind as a discretisation: one vector per edge, one value per vertex of an intrinsic mesh."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import sparse

from ..arrays import Bools, Complexes, Floats, Ints, LastUsed, fingerprint, mask_of
from ..diagnostics import EdgesLengthened, LargeAngles, Note, PointsLeftOut, VerticesAdded, VerticesJoined
from ..discretization import Levels, SourceTerm, discretize
from ..errors import GeometryError
from ..linear import Factor, chosen_backend, elimination_order, factorize
from ..linear.direct_integration import DirectIntegration, SpringIntegration, refuse_contradictions
from ..memory import refuse_beyond_memory
from ..mesh.conforming_refinement import refine_to_conform
from ..mesh.curve_segments import CurveSegments
from ..mesh.intrinsic_mesh import IntrinsicMesh, laid_out, mollify
from ..mesh.triangles import side_lengths
from .cotan import cotan_matrix, divergence
from .digital_surface import DigitalSurface, count_surfels, separated_edges
from .intrinsic_triangulation import IntrinsicTriangulation
from .point_cloud import PointCloud
from .polygon_mesh import PolygonMesh
from .source_segments import segments_of_each
from .surface_source import SurfaceSource, ends_among, surface_source
from .triangle_mesh import TriangleMesh
from .vector_heat import VectorHeat, extrapolated, nonmanifold_frames


@dataclass(frozen=True, eq=False)
class SurfaceDiscretization:
    """A surface discretised for the signed heat method, which is run on the triangles of an intrinsic mesh."""

    domain: Any  # on which fields are returned: a mesh, a cloud, a digital surface, an intrinsic triangulation
    triangles: IntrinsicMesh  # on which the method runs
    restriction: Ints  # (n,) vertex of the triangles for each vertex of the domain
    transfer: Callable[[Any], Any] | None = None  # maps a source on the domain to the triangles, if faces differ
    # Positions in space, for curves with given normals: (n_vertices, 3), or (m, 3, 3) of the corners if every face lies
    # in a plane of its own, up to translation. By default those of the domain's triangulation.
    positions: Floats | None = None
    triangulation: IntrinsicTriangulation | None = None  # of the domain; the field on it is kept, too
    spacing: float = math.nan  # h: by default half the mean edge length, the distance between midpoints of edges
    notes: tuple[Note, ...] = ()  # on repairs made in building the triangles, for the diagnostics of every field
    # the discretisation that differs only in first faces at nonmanifold edges, on which step 3 does not depend; those
    # with other triangles or another spacing have none
    unturned: SurfaceDiscretization | None = None
    # by diffusion time, of which there is a second one where curves end
    _heats: LastUsed[float, VectorHeat] = field(default_factory=lambda: LastUsed(2), init=False, repr=False)
    _turned: LastUsed[bytes, SurfaceDiscretization] = field(default_factory=LastUsed, init=False, repr=False)

    def __post_init__(self) -> None:
        if math.isnan(self.spacing):
            object.__setattr__(self, "spacing", 0.5 * float(self.triangles.lengths_of_edges.mean()))

    @cached_property
    def extent(self) -> float:
        """Square root of the area of the largest connected part, in multiples of h."""
        areas = np.bincount(self.triangles.face_components, self.triangles.face_areas)
        return float(np.sqrt(areas.max(initial=0.0))) / self.spacing

    @cached_property
    def integration(self) -> SurfaceIntegration:
        """Step 3 of the method, which integrates the directions to φ."""
        if self.unturned is not None:
            return self.unturned.integration
        ordered = partial(factorize, order=self.vertex_order)
        return SurfaceIntegration(self.stiffness, factorize=ordered, strength=SURFACE_SPRINGS / self.spacing)

    @cached_property
    def stiffness(self) -> sparse.csr_matrix:
        """Upper triangle of C (Eq. 10), on the vertices of the triangles."""
        return cotan_matrix(self.triangles) if self.unturned is None else self.unturned.stiffness

    @cached_property
    def vertex_order(self) -> Ints:
        """Fill-reducing order of the vertices, from which that of the edges follows."""
        return elimination_order(self.stiffness) if self.unturned is None else self.unturned.vertex_order

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Refine the triangles to conform to unoriented curves, and choose frames at nonmanifold edges.

        Return the discretisation for these sources, and the sources as lists of segments on it.
        """
        triangles, segments = refine_to_conform(self.triangles, self.segments(sources))
        surface = self
        if triangles is not self.triangles:  # the present vertices come first in them
            notes = *self.notes, VerticesAdded(triangles.n_vertices - self.triangles.n_vertices)
            surface = replace(self, triangles=triangles, transfer=None, notes=notes, unturned=None)
        triangles, groups = nonmanifold_frames(triangles, segments)
        return surface._turned_to(triangles), groups

    def segments(self, sources: Sequence[Any]) -> list[list[CurveSegments]]:
        """Cut sources on the domain into segments on the triangles, a list for each source."""
        if self.transfer is not None:
            sources = [self.transfer(source) for source in sources]
        positions = self.positions
        if positions is None and self.transfer is None:
            positions = self.domain.triangulation.vertices
        return segments_of_each(sources, self.triangles, positions)

    def _turned_to(self, triangles: IntrinsicMesh) -> SurfaceDiscretization:
        """Return the discretisation with other first faces at nonmanifold edges, whose layouts hold the edges' frames.

        Vectors of steps 1 and 2 depend on these frames. Step 3 does not, and is shared with this discretisation.
        """
        if triangles is self.triangles:
            return self

        key = fingerprint(triangles.first_halfedges)
        return self._turned(key, lambda: replace(self, triangles=triangles, unturned=self))

    def lower(self, sources: Sequence[Any], diffusion: float) -> Any:
        """Make a `SurfaceSource`: X₀ (Eq. 11, Eq. 19), and the rows that interpolate φ along the sources (Eq. 14)."""
        return surface_source(self.triangles, sources, diffusion, self.spacing)

    def diffuse(self, source: Any) -> list[Complexes]:
        """Solve ``(M + tL) X = X₀`` (Eq. 12): a list of stages, each (e, c) vectors in edge frames.

        The columns are X, or if it is extrapolated X, R X and R² X, with ``R = (M + tL)⁻¹ M``. Each later stage has
        values only at edges where the one before has underflowed, and NaN elsewhere.
        """
        return self.diffuse_many([source])[0]

    def diffuse_many(self, sources: Sequence[Any]) -> list[list[Complexes]]:
        """Solve Eq. 12 for several sources at once, which have the same t and are all extrapolated or all not."""
        time, order = sources[0].time, self.triangles.edges.elimination_order
        heat = self._heats(time, lambda: VectorHeat(self.triangles, time, order(self.vertex_order)))
        return heat.solve([source.vectors for source in sources], changes=2 if sources[0].extrapolated else 0)

    def to_cells(self, stages: list[Complexes]) -> Complexes:
        """(m,) directions in faces: sums of X over their edges (Sec. 6), from the last stage without NaN there.

        Stages with more than one column are extrapolated in t.
        """
        sums = self.triangles.sums_in_faces(stages[0])
        for stage in stages[1:]:
            later = self.triangles.sums_in_faces(stage)
            sums = np.where(np.isnan(later), sums, later)
        return extrapolated(sums) if sums.shape[1] > 1 else sums[:, 0]

    def divergence(self, directions: Complexes) -> Floats:
        """(n,) b, the right-hand side of ``C φ = b`` (Eq. 13), for (m,) directions in faces."""
        return divergence(self.triangles, directions)

    def reached_by(self, vectors: sparse.csr_array) -> Bools:
        """(n_vertices,) whether each vertex has a face in a component with a source; heat crosses edges only.

        `vectors` are the (1, e) X₀ of the source.
        """
        parts = self.triangles.face_components
        if not parts.any():
            return np.ones(self.triangles.n_vertices, dtype=bool)
        is_source = mask_of(self.triangles.n_edges, vectors.indices[vectors.data != 0])
        with_source = np.unique(parts[is_source[self.triangles.edges.face_edges].any(axis=1)])
        return mask_of(self.triangles.n_vertices, self.triangles.corner_vertices[np.isin(parts, with_source)])


@discretize.register
def _(domain: TriangleMesh) -> SurfaceDiscretization:
    """Discretise a triangle mesh, or raise `MemoryLimitError` if it does not fit in memory."""
    refuse_too_many(domain.n_faces, domain.n_faces, "triangles")
    return lowered_mesh(domain)


def lowered_mesh(domain: TriangleMesh) -> SurfaceDiscretization:
    """Discretise a mesh without checking its memory."""
    triangles, added = laid_out(domain.joined, 1e-6)
    share, joined = large_angles(triangles), vertices_joined(domain)
    notes = (*([EdgesLengthened(added)] if added else []), *([LargeAngles(share)] if share else []), *joined)
    return SurfaceDiscretization(domain, triangles, domain.places, notes=notes)


def vertices_joined(mesh: TriangleMesh) -> list[Note]:
    """Return a note on how many vertices were joined at seams; none if no vertex was."""
    count = int((mesh.places != np.arange(mesh.n_vertices)).sum())
    return [VerticesJoined(count)] if count else []


def large_angles(triangles: IntrinsicMesh) -> float:
    """Return the fraction of angles above 120°, or 0 if it is below 1 %.

    Many such angles make directions far from the source inaccurate.
    """
    share = float((triangles.corner_cotangents < -(3**-0.5)).mean())
    return share if share >= 0.01 else 0.0


BYTES_PER_TRIANGLE = {"pardiso": (1200, 40), "superlu": (100, 200)}
"""Peak memory per triangle, in bytes, by back end, and its growth with every doubling of their number, due to fill-in.
Measured on 20,000 to 310,000 triangles with one diffusion time."""


def memory_estimate(n_triangles: int) -> float:
    """Return the estimated memory, in bytes, that the first distance on `n_triangles` triangles takes."""
    each, per_doubling = BYTES_PER_TRIANGLE[chosen_backend()]
    return n_triangles * (each + per_doubling * math.log2(max(n_triangles, 2)))


def refuse_too_many(triangles: int, count: int, elements: str, more: float = 0.0) -> None:
    """Raise `MemoryLimitError` if distance on so many triangles, and `more` bytes, do not fit into memory.

    For the message, they belong to `count` elements, such as "points".
    """
    each = triangles / max(count, 1)
    refuse_beyond_memory(
        f"distance on {count:,} {elements}",
        count,
        lambda number: memory_estimate(math.ceil(each * number)) + more * number / count,
        lambda number: f"use at most {number:,} {elements}, coarsened or in parts",
    )


SURFACE_SPRINGS = 100.0
"""Strength of the springs that hold φ along curves across faces, in 1/h: measured on twenty meshes, good and bad."""
SOFT_STRENGTH = 10.0
"""Default λ of `Soft`, in 1/h."""


@dataclass(frozen=True, eq=False)
class SurfaceIntegration(SpringIntegration):
    """Step 3 on the vertices of a surface: `fit` is exact if all samples are vertices, and uses springs otherwise."""

    @property
    def soft_weight(self) -> float:
        """Default λ of `Soft`, in 1/length."""
        return SOFT_STRENGTH / SURFACE_SPRINGS * self.strength

    def anchored(self, source: SourceTerm) -> Factor:
        """Factorise C with φ held at zero along the source by equally stiff springs at all samples."""
        return self._pulled_factor(source.interpolation, DirectIntegration.springs(self, source))

    def held(self, source: SourceTerm) -> tuple[sparse.csr_matrix, Floats]:
        """Return the rows that interpolate φ at the springs, and their strengths; see `SpringIntegration`.

        Springs are at two Gauss points of each segment, which is exact for linear φ, and at isolated points.
        """
        assert isinstance(source, SurfaceSource)
        n, springs = len(source.weights), self.springs(source)
        ends, lengths = ends_among(source.parts, np.arange(n)), np.concatenate([p.lengths for p in source.parts])
        # of both Gauss points of each segment: the samples at its ends, and the weights of these
        shares = 0.5 + np.array([[1.0, -1.0], [-1.0, 1.0]]) / 12**0.5
        along = np.repeat(ends, 2, axis=0), np.tile(shares, (len(ends), 1))
        alone = np.bincount(ends.ravel(), minlength=n) == 0
        points = np.flatnonzero(alone | (np.diff(source.interpolation.indptr) == 1))
        starts = np.concatenate([np.arange(0, 4 * len(ends), 2), 4 * len(ends) + np.arange(len(points) + 1)])
        entries = np.concatenate([along[1].ravel(), np.ones(len(points))]), np.concatenate([along[0].ravel(), points])
        interpolation = sparse.csr_matrix((*entries, starts), shape=(len(starts) - 1, n))
        return interpolation, np.concatenate([np.repeat(0.5 * self.strength * lengths, 2), springs[points]])

    def fit(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """(n,) φ with given levels along sources (Eq. 14): exactly along edges, to some hundredths of h in faces."""
        if (np.diff(source.interpolation.indptr) == 1).all():
            return self.fit_exactly(divergence, source, levels)
        fitted = super().fit(divergence, source, levels)
        if levels.groups is None:
            between = np.diff(np.unique(levels.values)).min(initial=np.inf)
            refuse_contradictions(source.interpolation, levels.values, fitted, 0.25 * float(between))
        return fitted


LIGHTER = 0.87
"""Memory per triangle of polygons, relative to other triangles, since few edges meet at virtual vertices. Measured on
quads."""


@discretize.register
def _(domain: PolygonMesh) -> SurfaceDiscretization:
    """Discretise a polygon mesh, or raise `MemoryLimitError` if it does not fit in memory."""
    refuse_too_many(round(LIGHTER * len(domain.corners)), domain.n_polygons, "polygons")
    return lowered_polygons(domain)


def lowered_polygons(domain: PolygonMesh) -> SurfaceDiscretization:
    """Discretise polygons without checking their memory; h is half the mean length of their own edges.

    φ is solved for on virtual vertices, too. If they were eliminated (``PᵀCP``), a curve across polygons could not be a
    level set of φ, which would be constant on whole polygons.
    """
    lowered = lowered_mesh(domain.triangulation)
    own = (domain.triangulation.edges.vertices < domain.n_vertices).all(axis=1)
    spacing = 0.5 * float(domain.triangulation.edge_lengths[own].mean())
    return replace(lowered, domain=domain, restriction=lowered.restriction[: domain.n_vertices], spacing=spacing)


BYTES_OF_NEIGHBORS, BYTES_PER_POINT = 40_000_000, 1300
"""Measured bytes of the libraries that find neighbours, and of the neighbours of each point, without triangles."""


@discretize.register
def _(domain: PointCloud) -> SurfaceDiscretization:
    """Discretise a point cloud by its local triangles, with values at the points."""
    # h is the mean distance between neighbouring points, the scale below which they do not determine the surface
    refuse_too_many(
        2 * domain.n_points, domain.n_points, "points", more=BYTES_OF_NEIGHBORS + BYTES_PER_POINT * domain.n_points
    )
    mesh = domain.triangulation
    used = mask_of(domain.n_points, mesh.faces)
    duplicates = int((domain.representatives != np.arange(domain.n_points)).sum())
    notes = (PointsLeftOut(duplicates, np.flatnonzero(~used[domain.representatives]).tolist()),)
    lowered, spacing = lowered_mesh(mesh), float(mesh.edge_lengths.mean())
    places = lowered.restriction[domain.representatives]
    return replace(lowered, domain=domain, restriction=places, spacing=spacing, notes=notes)


BYTES_PER_VOXEL = 20
"""Memory of the blurred copies of the volume from which normals are estimated."""


@discretize.register
def _(domain: DigitalSurface) -> SurfaceDiscretization:
    """Discretise a digital surface by four triangles for each square, between its moved corners and their mean.

    h is the standard deviation of the Gaussian with which normals are estimated, and at least the voxel size: at a
    smaller scale the shape is unknown, and diffusion would follow the directions of the lattice.
    """
    faces = count_surfels(domain.volume)
    refuse_too_many(4 * faces, faces, "faces of voxels", more=BYTES_PER_VOXEL * domain.volume.size)
    mesh, corners = domain.triangulation, domain.smooth_vertices
    positions = np.concatenate([corners, corners[domain.surfels.corners].mean(axis=1)])
    sides = side_lengths(positions[mesh.faces])
    if not sides.any():
        raise GeometryError(
            "the faces of the voxels are so small that their corners fall together",
            remedy="scale spacing, or move origin to zero",
            element="spacing",
        )
    lengths, _ = mollify(sides, 1e-6)
    edges = separated_edges(mesh.edges, domain.surfels)
    triangles = IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, edges)
    extent = float((domain.bounds[1] - domain.bounds[0]).max())
    spacing = max(min(0.5 * domain.radius, extent), float(domain.spacing.mean()))
    own = np.arange(domain.n_vertices)
    return SurfaceDiscretization(domain, triangles, own, positions=positions, spacing=spacing)
