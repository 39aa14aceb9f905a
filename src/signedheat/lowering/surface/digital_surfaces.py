"""Digital surfaces, lowered by flattening each square into the plane orthogonal to its corrected normal (Sec. 8)."""

from __future__ import annotations

import numpy as np

from ...discretization import discretize
from ...domains.digital_surface import DigitalSurface
from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...geometry.surfels import flattened_sides, separated_edges
from .discretization import SurfaceDiscretization


@discretize.register
def _(domain: DigitalSurface) -> SurfaceDiscretization:
    """Each square becomes a parallelogram of four triangles; neighbours agree on edges, not on their lengths.

    h is the deviation of the Gaussian that normals are estimated with, or else the voxel size. Below it nothing is
    known of the surface, and heat feels the directions of the lattice instead.
    """
    first, last = flattened_sides(domain.surfels, domain.spacing, domain.normals)
    around = np.stack([np.zeros_like(first), first, first + last, last], axis=1)
    middle = np.broadcast_to(0.5 * (first + last)[:, None], around.shape)
    corners = np.stack([around, np.roll(around, -1, axis=1), middle], axis=2).reshape(-1, 3, 3)
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    mesh = domain.triangulation
    edges = separated_edges(mesh.edges, domain.surfels)
    triangles = IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, edges)
    spacing = max(0.5 * domain.radius, float(domain.spacing.mean()))
    own = np.arange(domain.n_vertices)
    return SurfaceDiscretization(domain, triangles, restriction=own, positions=corners, spacing=spacing)
