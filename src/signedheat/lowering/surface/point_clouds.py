"""Point clouds, lowered through their local triangulations (Sec. 8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...diagnostics import PointsLeftOut
from ...discretization import discretize
from ...domains.point_cloud import PointCloud
from .discretization import SurfaceDiscretization, refuse_too_many

NEIGHBORS, BYTES_PER_POINT = 40_000_000, 1300
"""Bytes of the libraries that find neighbours, and of neighbours, beside those of triangles. Measured."""


@discretize.register
def _(domain: PointCloud) -> SurfaceDiscretization:
    """The values of φ are at the points; points that coincide share one unknown.

    h is the mean distance between neighbouring points, the scale below which the samples do not determine the surface.
    """
    refuse_too_many(
        2 * domain.n_points, domain.n_points, "points", beside=NEIGHBORS + BYTES_PER_POINT * domain.n_points
    )
    mesh = domain.triangulation
    used = np.zeros(domain.n_points, dtype=bool)
    used[mesh.faces] = True
    duplicates = int((domain.representatives != np.arange(domain.n_points)).sum())
    notes = (PointsLeftOut(duplicates, np.flatnonzero(~used[domain.representatives])),)
    spacing = float(mesh.edge_lengths.mean())
    return replace(discretize(mesh), domain=domain, restriction=domain.representatives, spacing=spacing, notes=notes)
