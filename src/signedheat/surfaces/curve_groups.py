"""Pieces of broken curves in groups that are likely to be one curve each, by their ends alone."""

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
"""Distance between the ends of a single piece, relative to its length, from which it is no curve with a gap."""
ROUND = 0.15
"""What counts as the scale of a single piece, relative to its length: about the radius of a circle."""


@dataclass(frozen=True, eq=False)
class CurveGroups:
    """Groups of open oriented curves."""

    lengths: Floats  # (g,) of all pieces of each
    # (g,) mean length of the pieces of each, by length; of a single piece, which is bent nearly to a circle, less
    scales: Floats

    @classmethod
    def of(cls, mesh: TriangleMesh, curves: Sequence[Any]) -> CurveGroups:
        """Link each end of a piece to the nearest end of another; single straight pieces are left out."""
        listed = [each for c in curves for each in (c if isinstance(c, Sequence) else [c])]
        pieces = [c for c in listed if isinstance(c, Curve) and c.oriented and not c.closed]
        if not pieces:
            return cls(np.empty(0), np.empty(0))
        points = [mesh.positions(c) for c in pieces]
        length = np.array([float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in points])
        ends = np.array([p[[0, -1]] for p in points]).reshape(-1, 3)
        group = connected_components(len(pieces), *nearest_others(ends).T)
        across = np.linalg.norm(ends[::2] - ends[1::2], axis=1)
        several = np.bincount(group)[group] > 1
        used = several | (across < STRAIGHT * length)
        group, length = np.unique(group[used], return_inverse=True)[1].ravel(), length[used]
        total = np.bincount(group, length).astype(np.float64)
        mean = np.bincount(group, length**2) / np.maximum(total, 1e-300)
        return cls(total, np.where(np.bincount(group) > 1, mean, ROUND * total))


def nearest_others(ends: Floats) -> Ints:
    """(2 k, 2) the piece of each of the two ends of k pieces, and that of the end nearest to it but its own other end.

    An end that is nearer to its own other end than to any other piece is linked to its own piece.
    """
    piece = np.arange(len(ends)) // 2
    near, found = scipy.spatial.cKDTree(ends).query(ends, k=min(3, len(ends)))
    own = piece[found] == piece[:, None]
    own[:, 0] |= found[:, 0] == np.arange(len(ends))
    first = np.where(own, np.inf, near).argmin(axis=1)
    gap = np.linalg.norm(ends[::2] - ends[1::2], axis=1)[piece]
    rows = np.arange(len(ends))
    other = np.where(own.all(axis=1) | (near[rows, first] > gap), piece, piece[found[rows, first]])
    return np.stack([piece, other], axis=1)
