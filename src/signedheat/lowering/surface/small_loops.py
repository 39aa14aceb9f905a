"""Closed curves that triangles hardly see: step 1 adds up what lies on both sides of a loop within one edge's reach."""

from __future__ import annotations

import numpy as np

from ...geometry.components import connected_components
from .source import SurfaceSource, joined

SMALL = 3.5
"""Length of a loop, in sides of the triangles that it crosses, below which a quarter or more of its heat cancels."""


def small_loops(source: SurfaceSource) -> int:
    """How many closed oriented curves are shorter than `SMALL` sides of the triangles that they cross.

    Distance to them is several times less accurate than triangles of this size allow.
    """
    parts = [part for part in source.parts if part.oriented and len(part.ends)]
    if not parts:
        return 0
    triangles = source.triangles
    nodes, ends = joined(parts)
    label = connected_components(len(nodes), ends[:, 0], ends[:, 1])[ends[:, 0]]
    lengths = np.concatenate([part.lengths for part in parts])
    faces = np.concatenate([part.faces for part in parts])
    inside = np.concatenate([part.edges < 0 for part in parts])
    sides = np.where(inside, np.sqrt(4 / 3**0.5 * triangles.face_areas[faces]), 0.0)  # edges see what runs along them
    length, weighted = np.bincount(label, lengths), np.bincount(label, lengths * sides)
    is_open = np.zeros(len(length), dtype=bool)
    odd = np.bincount(ends.ravel(), minlength=len(nodes)) % 2 == 1
    is_open[label[odd[ends].any(axis=1)]] = True
    return int(((length > 0) & ~is_open & (length**2 < SMALL * weighted)).sum())
