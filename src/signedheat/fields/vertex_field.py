"""Distance at the vertices of a surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..discretization import Diagnostics


@dataclass(frozen=True, eq=False)
class VertexField:
    """A scalar at every vertex of a surface.

    Attributes
    ----------
    domain : TriangleMesh, PolygonMesh, PointCloud or DigitalSurface
        The surface.
    values : (n_vertices,) float
        φ, in the units of the vertices; NaN where no source is connected.
    diagnostics : Diagnostics
        What happened on the way.
    source : SourceTerm
        The source as the solver saw it.
    """

    domain: Any
    values: NDArray[np.float64]
    diagnostics: Diagnostics = field(default_factory=Diagnostics, repr=False)
    source: Any = field(default=None, repr=False)

    def restrict(self) -> VertexField:
        """On an intrinsic triangulation: φ at the vertices of its mesh. On any other domain: the field itself."""
        mesh = getattr(self.domain, "mesh", self.domain)
        return self if mesh is self.domain else replace(self, domain=mesh, values=self.values[: mesh.n_vertices])
