"""Digital surfaces, lowered as their squares lie when orthogonal to the corrected normals (Sec. 8)."""

from __future__ import annotations

import numpy as np

from ...discretization import discretize
from ...domains.digital_surface import DigitalSurface
from ...errors import GeometryError
from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...geometry.mollification import mollify
from ...geometry.surfels import count_surfels, separated_edges
from .discretization import SurfaceDiscretization, refuse_too_many

BYTES_PER_VOXEL = 20
"""Blurred copies of the volume, from which normals are estimated."""


@discretize.register
def _(domain: DigitalSurface) -> SurfaceDiscretization:
    """Each square becomes four triangles between its corners, moved, and their mean.

    h is the standard deviation of the Gaussian with which normals are estimated, and at least the voxel size. At a
    smaller scale the shape of the surface is unknown, and diffusion would follow the directions of the lattice.
    """
    faces = count_surfels(domain.volume)
    refuse_too_many(4 * faces, faces, "faces of voxels", beside=BYTES_PER_VOXEL * domain.volume.size)
    mesh, corners = domain.triangulation, domain.smooth_vertices
    positions = np.concatenate([corners, corners[domain.surfels.corners].mean(axis=1)])
    placed = positions[mesh.faces]
    sides = np.linalg.norm(np.roll(placed, -1, axis=1) - placed, axis=2)
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
    return SurfaceDiscretization(domain, triangles, restriction=own, positions=positions, spacing=spacing)
