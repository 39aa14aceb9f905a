"""Polygon meshes, lowered through their virtual refinement (Sec. 8)."""

from __future__ import annotations

from dataclasses import replace

from ..discretization import discretize
from ..domains.polygon_mesh import PolygonMesh
from .surface import SurfaceDiscretization


@discretize.register
def _(domain: PolygonMesh) -> SurfaceDiscretization:
    """The triangles diffuse and normalise; φ lives at the corners of the polygons."""
    return replace(discretize(domain.triangulation), domain=domain, prolongation=domain.refinement.prolongation)
