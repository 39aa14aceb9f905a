"""Polygon meshes, lowered through their virtual refinement (Sec. 8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...discretization import discretize
from ...domains.polygon_mesh import PolygonMesh
from .discretization import SurfaceDiscretization, lowered_mesh, refuse_too_many

LIGHTER = 0.87
"""Memory of a triangle of a polygon, over that of others: few edges meet in virtual vertices. Measured on quads."""


@discretize.register
def _(domain: PolygonMesh) -> SurfaceDiscretization:
    refuse_too_many(round(LIGHTER * len(domain.corners)), domain.n_polygons, "polygons")
    return lowered_polygons(domain)


def lowered_polygons(domain: PolygonMesh) -> SurfaceDiscretization:
    """The discretisation of polygons, of whose memory the caller has made sure.

    φ is solved for on all vertices of the triangles, virtual ones included, and reported at those of the polygons.

    With virtual vertices eliminated in step 3 (``PᵀCP``), a curve across polygons could not be a level set of φ: it
    crosses more edges of triangles than its polygons have corners, and φ would be constant on whole polygons. h is half
    the mean length of the polygons' own edges, so that virtual vertices do not change t.
    """
    lowered = lowered_mesh(domain.triangulation)
    own = (domain.triangulation.edges.vertices < domain.n_vertices).all(axis=1)
    spacing = 0.5 * float(domain.triangulation.edge_lengths[own].mean())
    return replace(lowered, domain=domain, restriction=np.arange(domain.n_vertices), spacing=spacing)
