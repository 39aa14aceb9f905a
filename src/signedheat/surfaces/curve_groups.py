"""Groups of pieces that are likely to belong to one broken curve each, found by their ends alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from ..arrays import Floats, Ints
from ..mesh.components import connected_components
from .surface_curves import Curve
from .triangle_mesh import TriangleMesh

STRAIGHT = 0.5
"""A single piece is a curve with a gap if the distance between its ends, relative to its length, is less than this."""
ROUND = 0.15
"""Scale of a single piece, relative to its length: about the radius of a circle of that length."""


@dataclass(frozen=True, eq=False)
class CurveGroups:
    """Groups of open oriented curves."""

    lengths: Floats  # (g,) total length of the pieces of each group
    scales: Floats  # (g,) mean length of the pieces, weighted by length; for a single piece its length times `ROUND`

    @classmethod
    def of(cls, mesh: TriangleMesh, curves: Sequence[Any]) -> CurveGroups:
        """Link each end of a piece to the nearest end of another; single straight pieces are left out."""
        listed = [curve for item in curves for curve in (item if isinstance(item, Sequence) else [item])]
        pieces = [curve for curve in listed if isinstance(curve, Curve) and curve.oriented and not curve.closed]
        if not pieces:
            return cls(np.empty(0), np.empty(0))
        points = [mesh.positions(piece) for piece in pieces]
        lengths = np.array([float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in points])
        ends = np.array([p[[0, -1]] for p in points]).reshape(-1, 3)
        groups = connected_components(len(pieces), *nearest_others(ends).T)
        gaps = np.linalg.norm(ends[::2] - ends[1::2], axis=1)
        used = (np.bincount(groups)[groups] > 1) | (gaps < STRAIGHT * lengths)
        groups, lengths = np.unique(groups[used], return_inverse=True)[1].ravel(), lengths[used]
        totals = np.bincount(groups, lengths).astype(np.float64)
        means = np.bincount(groups, lengths**2) / np.maximum(totals, 1e-300)
        return cls(totals, np.where(np.bincount(groups) > 1, means, ROUND * totals))


def nearest_others(ends: Floats) -> Ints:
    """(2 k, 2) for each of the two ends of k pieces: its piece, and the piece with the nearest end.

    An end that is nearer to the other end of its own piece than to any other piece is linked to its own piece.
    """
    rows = np.arange(len(ends))
    piece = rows // 2
    distances, near = scipy.spatial.cKDTree(ends).query(ends, k=min(3, len(ends)))
    own = piece[near] == piece[:, None]
    own[:, 0] |= near[:, 0] == rows
    first = np.where(own, np.inf, distances).argmin(axis=1)
    gap = np.linalg.norm(ends[::2] - ends[1::2], axis=1)[piece]
    alone = own.all(axis=1) | (distances[rows, first] > gap)
    return np.stack([piece, np.where(alone, piece, piece[near[rows, first]])], axis=1)
