"""Measure the thickness of walls and the width of gaps of a shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..mesh.triangles import area_vectors
from ..mesh.unit_vectors import unit
from ..mesh.welding import same_positions
from ..search.stabbing_lines import LineCrossings, stabbing_lines
from .mesh_orientation import Mesh

N_LINES = 30_000
"""Number of lines through a shape."""
N_DIRECTIONS = 8
"""Number of directions of these lines."""
SHARE = 0.01
"""Quantile of the widths of walls, or gaps, that is reported."""
OPPOSITE = -0.9
"""Cosine between the normals of faces below which they are opposite, rather than a wedge."""
COINCIDENT = 1e-6
"""Width, over the largest coordinate, up to which faces coincide but for the rounding of single precision."""
STEEP = 0.7
"""Least cosine between a line and the normals at which it measures a width."""


@dataclass(frozen=True)
class Thickness:
    """Walls and gaps of a shape, measured on lines through it, without the least 1 %.

    Attributes
    ----------
    wall, gap : float or None
        First percentile of the thickness of walls and of the width of gaps; None if no faces are opposite, as in a
        wedge.
    typical_wall, typical_gap : float or None
        Medians.
    """

    wall: float | None
    gap: float | None
    typical_wall: float | None
    typical_gap: float | None

    @property
    def spacing(self) -> float | None:
        """Spacing of a grid that has two cells across the thinnest wall and the narrowest gap."""
        widths = [width for width in (self.wall, self.gap) if width is not None]
        return 0.5 * min(widths) if widths else None


def thickness(shape: Mesh) -> Thickness:
    """Measure walls and gaps between faces opposite each other.

    Lines are laid through the shape. Between a face that a line enters by and the next, by which it leaves, there is a
    wall; between leaving and entering, a gap. Its width is the way along the line times the mean of the cosines at both
    ends. Faces that share a vertex are a fold, and have no width between them. Takes O(n) time.

    Parameters
    ----------
    shape : TriangleMesh or PolygonMesh
        A shape whose faces point outwards; see `orient`.

    Examples
    --------
    >>> from signedheat import samples
    >>> found = thickness(samples.torus(major=1.0, minor=0.4))
    >>> 0.75 < found.wall < 0.8, 1.0 < found.gap < 1.2
    (True, True)
    """
    mesh, exponent = shape.triangulation, int(np.frexp(np.abs(shape.bounds).max())[1])
    corners = np.ldexp(mesh.vertices, -exponent)  # so that no product leaves the range of numbers
    bounds = np.ldexp(shape.bounds, -exponent)
    lines = stabbing_lines(corners, mesh.faces, bounds, N_LINES, N_DIRECTIONS)
    names = same_positions(mesh.vertices)[mesh.faces]
    (walls, n_walls), (gaps, n_gaps) = (_widths(corners[mesh.faces], names, lines, wall) for wall in (True, False))
    unit = float(np.ldexp(1.0, exponent))
    return Thickness(
        wall=_quantile(walls * unit, SHARE * n_walls),
        gap=_quantile(gaps * unit, SHARE * n_gaps),
        typical_wall=_quantile(walls * unit, 0.5 * len(walls)),
        typical_gap=_quantile(gaps * unit, 0.5 * len(gaps)),
    )


def _widths(
    triangles: NDArray[np.float64], names: NDArray[np.int64], lines: LineCrossings, wall: bool
) -> tuple[NDArray[np.float64], int]:
    """Widths of walls, or gaps, between opposite faces along lines; and how many are crossed in all."""
    last = np.zeros(len(lines.crossed), dtype=bool)
    last[lines.starts[1:][np.diff(lines.starts) > 0] - 1] = True
    here = np.flatnonzero(~last[:-1] & (lines.entering[:-1] == wall) & (lines.entering[1:] != wall))
    one, other = lines.crossed[here], lines.crossed[here + 1]
    normals = unit(area_vectors(triangles[one])), unit(area_vectors(triangles[other]))
    opposite = np.einsum("ij,ij->i", *normals) < OPPOSITE
    opposite &= np.minimum(lines.cosines[here], lines.cosines[here + 1]) > STEEP
    widths = (lines.depths[here + 1] - lines.depths[here]) * 0.5 * (lines.cosines[here] + lines.cosines[here + 1])
    apart = ~(names[one, :, None] == names[other, None, :]).any(axis=(1, 2))
    apart &= widths > COINCIDENT * np.abs(triangles).max()
    return widths[opposite & apart], int(apart.sum())


def _quantile(widths: NDArray[np.float64], rank: float) -> float | None:
    """The width of a rank; None if there are fewer."""
    return float(np.partition(widths, int(rank))[int(rank)]) if int(rank) < len(widths) else None
