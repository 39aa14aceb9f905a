"""Surfaces of every kind, as intrinsic mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ...cache import LastUsed, fingerprint
from ...discretization import discretize
from ...domains.segments import segments_of_each
from ...domains.triangle_mesh import TriangleMesh
from ...errors import GeometryError
from ...geometry.intrinsic.conforming_refinement import refine_to_conform
from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...geometry.mollification import mollify
from ...linear import elimination_order, factorize
from ...operators.cotan import cotan_matrix, divergence
from ..direct_integration import DirectIntegration
from .nonmanifold_frames import nonmanifold_frames
from .source import surface_source
from .vector_heat import VectorHeat


@dataclass(frozen=True, eq=False)
class SurfaceDiscretization:
    """A surface as the three steps see it.

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        What fields are reported on.
    triangles : IntrinsicMesh
        What the method runs on.
    restriction : (n,) int, optional
        Vertex of the triangles that stands for each vertex of the domain, where they are not the same.
    transfer : callable, optional
        Takes a source on the domain to the same source on the triangles, where their faces are not the domain's.
    positions : (n_vertices, 3) or (m, 3, 3) float, optional
        Where in space vertices lie, or the corners of each face, up to translation, where faces lie in planes of their
        own: for curves whose normals are given. By default what the domain's triangulation says.
    spacing : float, optional
        h. By default half the mean edge length, the mean distance between neighbouring edge midpoints.
    notes : mapping
        What was repaired in making the triangles; passed on to the diagnostics of every field.
    """

    domain: Any
    triangles: IntrinsicMesh
    restriction: NDArray[np.int64] | None = None
    transfer: Callable[[Any], Any] | None = None
    positions: NDArray[np.float64] | None = None
    spacing: float | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)
    _heats: LastUsed[float, VectorHeat] = field(default_factory=LastUsed, init=False, repr=False)
    _turned: LastUsed[bytes, SurfaceDiscretization] = field(default_factory=LastUsed, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.spacing is None:
            object.__setattr__(self, "spacing", 0.5 * float(self.triangles.lengths_of_edges.mean()))

    @cached_property
    def integration(self) -> DirectIntegration:
        """Step 3."""
        return DirectIntegration(self.stiffness, factorize=partial(factorize, order=self.vertex_order))

    @cached_property
    def stiffness(self) -> sparse.csr_matrix:
        """Upper triangle of C, on the vertices of the triangles."""
        return cotan_matrix(self.triangles)

    @cached_property
    def vertex_order(self) -> NDArray[np.int64]:
        """Fill-reducing order of the vertices, from which that of the edges follows."""
        return elimination_order(self.stiffness)

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Unoriented curves and points inside faces get edges and vertices; nonmanifold edges are told from where."""
        if self.transfer is not None:
            sources = [self.transfer(source) for source in sources]
        positions = self.positions
        if positions is None and self.transfer is None:
            positions = self.domain.triangulation.vertices
        groups = segments_of_each(sources, self.triangles, positions)
        triangles, groups = refine_to_conform(self.triangles, groups)
        surface = self if triangles is self.triangles else self._cut_into(triangles)
        triangles, groups = nonmanifold_frames(triangles, groups)
        return surface._turned_to(triangles), groups

    def _turned_to(self, triangles: IntrinsicMesh) -> SurfaceDiscretization:
        """The same triangles with other first faces at nonmanifold edges; step 3 does not see them."""
        if triangles is self.triangles:
            return self
        return self._turned(fingerprint(triangles.first_halfedges), lambda: self._turn_to(triangles))

    def _turn_to(self, triangles: IntrinsicMesh) -> SurfaceDiscretization:
        turned = replace(self, triangles=triangles)
        turned.__dict__.update({name: getattr(self, name) for name in ("stiffness", "integration", "vertex_order")})
        return turned

    def _cut_into(self, triangles: IntrinsicMesh) -> SurfaceDiscretization:
        """The same surface in more triangles, whose first vertices are those of this."""
        added = triangles.n_vertices - self.triangles.n_vertices
        return replace(
            self,
            triangles=triangles,
            restriction=np.arange(self.triangles.n_vertices) if self.restriction is None else self.restriction,
            transfer=None,
            notes={**self.notes, "vertices added for sources": added},
        )

    def lower(self, sources: Sequence[Any], diffusion: float) -> Any:
        """X₀ and the rows that interpolate φ along the sources."""
        return surface_source(self.triangles, sources, diffusion, self.spacing)

    def diffuse(self, source: Any) -> list[NDArray[np.complex128]]:
        """Solve ``(M + tL) X = X₀``; one vector per edge, in stages (see `VectorHeat`)."""
        return self.diffuse_many([source])[0]

    def diffuse_many(self, sources: Sequence[Any]) -> list[list[NDArray[np.complex128]]]:
        """Solve for several sources of the same t at once."""
        heat = self._heats(sources[0].time, lambda: self._vector_heat(sources[0].time))
        return heat.solve([source.vectors for source in sources])

    def _vector_heat(self, time: float) -> VectorHeat:
        return VectorHeat(self.triangles, time, self.triangles.edges.elimination_order(self.vertex_order))

    def to_cells(self, stages: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        """X at the faces, as complex numbers in their layouts: each face from the last stage that covers it."""
        vectors = self.triangles.sum_in_faces(stages[0])
        for stage in stages[1:]:
            later = self.triangles.sum_in_faces(stage)
            vectors = np.where(np.isnan(later), vectors, later)
        return vectors

    def divergence(self, directions: NDArray[np.complex128]) -> NDArray[np.float64]:
        """b, the right-hand side of ``C φ = b``."""
        return divergence(self.triangles, directions)

    def reached_by(self, vectors: sparse.csr_array) -> NDArray[np.bool_]:
        """(n_vertices,) whether a vertex has a face on a part that holds vectors. Vectors only pass along edges."""
        parts = self.triangles.face_components
        if not parts.any():
            return np.ones(self.triangles.n_vertices, dtype=bool)
        held, lit = np.zeros(self.triangles.n_edges, dtype=bool), np.zeros(self.triangles.n_faces, dtype=bool)
        held[vectors.indices[vectors.data != 0]] = True
        lit[parts[held[self.triangles.edges.face_edges].any(axis=1)]] = True
        reached = np.zeros(self.triangles.n_vertices, dtype=bool)
        reached[self.triangles.corner_vertices[lit[parts]]] = True
        return reached


@discretize.register
def _(domain: TriangleMesh) -> SurfaceDiscretization:
    lengths, added = mollify(domain.edge_lengths[domain.edges.face_edges], 1e-6)
    if not lengths.max() > 0:
        raise GeometryError("all edges of the mesh have length zero: it has no area to measure distance on")
    triangles = IntrinsicMesh.from_lengths(domain.faces, lengths, domain.n_vertices, domain.edges)
    notes = {"added to edge lengths": added, "large angles": large_angles(triangles)}
    return SurfaceDiscretization(domain, triangles, notes={name: note for name, note in notes.items() if note})


def large_angles(triangles: IntrinsicMesh) -> float:
    """Share of angles above 120°; 0 below 1 %. Where they are many, step 1 may turn directions far from the source."""
    share = float((triangles.corner_cotangents < -(3**-0.5)).mean())
    return share if share >= 0.01 else 0.0
