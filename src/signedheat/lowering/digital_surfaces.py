"""Digital surfaces, lowered by flattening each square into the plane orthogonal to its corrected normal (Sec. 8)."""

from __future__ import annotations

import numpy as np

from ..discretization import discretize
from ..domains.digital_surface import DigitalSurface
from ..operators.laid_out_triangles import LaidOutTriangles
from ..operators.surfels import flattened_sides, separated_edges
from .surface import SurfaceDiscretization


@discretize.register
def _(domain: DigitalSurface) -> SurfaceDiscretization:
    """Each square becomes a parallelogram of four triangles; neighbours agree on edges, not on their lengths.

    h is the deviation of the Gaussian that normals are estimated with, or else the voxel size. Below it nothing is
    known of the surface, and heat feels the directions of the lattice instead.
    """
    first, last = flattened_sides(domain.surfels, domain.spacing, domain.normals)
    side = [np.linalg.norm(v, axis=1) for v in (first, last)]
    diagonal = [0.5 * np.linalg.norm(v, axis=1) for v in (first - last, first + last)]  # from corners 1 and 3, 0 and 2
    lengths = np.stack(
        [np.stack([side[k % 2], diagonal[k % 2], diagonal[1 - k % 2]], axis=1) for k in range(4)], axis=1
    ).reshape(-1, 3)
    mesh = domain.triangulation
    edges = separated_edges(mesh.edges, domain.surfels)
    triangles = LaidOutTriangles.from_lengths(mesh.faces, lengths, mesh.n_vertices, edges)
    spacing = max(0.5 * domain.radius, float(domain.spacing.mean()))
    return SurfaceDiscretization(domain, triangles, restriction=np.arange(domain.n_vertices), spacing=spacing)
