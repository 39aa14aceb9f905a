"""Surfaces of every kind, as laid-out triangles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..discretization import Diagnostics, discretize
from ..domains.triangle_mesh import TriangleMesh
from ..fields.vertex_field import VertexField
from ..linear import Factor, factorize, upper_triangle, whole
from ..operators.cotan import cotan_matrix, divergence
from ..operators.crouzeix_raviart import vector_heat_matrix
from ..operators.laid_out_triangles import LaidOutTriangles
from .direct_integration import DirectIntegration


@dataclass(frozen=True, eq=False)
class SurfaceDiscretization:
    """A surface as the three steps see it.

    Parameters
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        What fields are reported on.
    triangles : LaidOutTriangles
        What the method runs on.
    prolongation : (n_vertices of the triangles, n_unknowns) sparse, optional
        P, where only some vertices of the triangles are unknowns of φ and the others averages of them: step 3 then
        has ``Pᵀ C P`` and ``Pᵀ b`` (Sec. 8).
    restriction : (n,) int, optional
        Unknown of φ that belongs to each vertex of the domain, where the triangles have more vertices than it.
    bring : callable, optional
        Takes a source on the domain to the same source on the triangles, where their faces are not the domain's.
    spacing : float, optional
        h. By default half the mean edge length, the mean distance between neighbouring edge midpoints.
    notes : mapping
        What was repaired in making the triangles; passed on to the diagnostics of every field.
    """

    domain: Any
    triangles: LaidOutTriangles
    prolongation: sparse.csr_matrix | None = None
    restriction: NDArray[np.int64] | None = None
    bring: Callable[[Any], Any] | None = None
    spacing: float | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)
    _factors: dict[float, Factor] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if self.spacing is None:
            lengths = np.empty(self.triangles.n_edges)
            lengths[self.triangles.edges.of_faces] = self.triangles.edge_lengths
            object.__setattr__(self, "spacing", 0.5 * float(lengths.mean()))

    @cached_property
    def integration(self) -> DirectIntegration:
        """Step 3."""
        matrix = cotan_matrix(self.triangles)
        if self.prolongation is not None:
            matrix = upper_triangle(self.prolongation.T @ whole(matrix) @ self.prolongation)
        return DirectIntegration(matrix, self.prolongation)

    def adapt(self, sources: Sequence[Any]) -> tuple[SurfaceDiscretization, Sequence[Any]]:
        """Unoriented curves and points inside faces get edges and vertices of their own."""
        if self.bring is not None:
            sources = [self.bring(source) for source in sources]
        from ..sources.embedding import embed
        from ..sources.pieces import in_pieces

        positions = None if self.bring is not None else self.domain.triangulation.vertices
        groups = in_pieces(sources, self.triangles, positions)
        triangles, groups = embed(self.triangles, groups)
        return self if triangles is self.triangles else self._cut_into(triangles), groups

    def _cut_into(self, triangles: LaidOutTriangles) -> SurfaceDiscretization:
        """The same surface in more triangles, whose first vertices are those of this."""
        added = triangles.n_vertices - self.triangles.n_vertices
        n_unknowns = self.triangles.n_vertices if self.prolongation is None else self.prolongation.shape[1]
        return replace(
            self,
            triangles=triangles,
            prolongation=None
            if self.prolongation is None
            else sparse.block_diag([self.prolongation, sparse.identity(added)], format="csr"),
            restriction=np.arange(n_unknowns) if self.restriction is None else self.restriction,
            bring=None,
            notes={**self.notes, "vertices added for sources": added},
            _factors={},
        )

    def lower(self, sources: Sequence[Any], diffusion: float) -> Any:
        """X₀ and the rows that interpolate φ along the sources."""
        from ..sources.surface_source import surface_source

        return surface_source(self.triangles, sources, diffusion, self.spacing)

    def diffuse(self, source: Any) -> NDArray[np.complex128]:
        """Solve ``(M + tL) X = X₀``; one vector per edge."""
        factor = self._factors.get(source.time)
        if factor is None:
            self._factors.clear()
            factor = self._factors[source.time] = factorize(vector_heat_matrix(self.triangles, source.time))
        if self.triangles.is_consistently_oriented:
            return factor.solve(source.vectors)
        return factor.solve(np.ascontiguousarray(source.vectors).view(np.float64)).view(np.complex128)

    def to_cells(self, vectors: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """X at the faces, as complex numbers in their layouts."""
        return self.triangles.in_face_frames(vectors).sum(axis=1)

    def divergence(self, directions: NDArray[np.complex128]) -> NDArray[np.float64]:
        """b, the right-hand side of ``C φ = b``."""
        flux = divergence(self.triangles, directions)
        return flux if self.prolongation is None else self.prolongation.T @ flux

    def field(self, values: NDArray[np.float64], source: Any, diagnostics: Diagnostics) -> VertexField:
        """φ at the vertices of the domain."""
        if self.restriction is not None:
            values = values[self.restriction]
        unreached = np.flatnonzero(np.isnan(values))
        diagnostics = replace(diagnostics, unreached=unreached, notes={**diagnostics.notes, **self.notes})
        return VertexField(self.domain, values, diagnostics, source)


@discretize.register
def _(domain: TriangleMesh) -> SurfaceDiscretization:
    a, b, c = (domain.vertices[domain.faces[:, k]] for k in range(3))
    lengths = np.stack([np.linalg.norm(d, axis=1) for d in (b - a, c - b, a - c)], axis=1)
    triangles = LaidOutTriangles.from_lengths(domain.faces, lengths, domain.n_vertices, domain.edges)
    return SurfaceDiscretization(domain, triangles)
