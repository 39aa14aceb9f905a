"""Seams: what joins the borders of a level set to the rims of faces that it completes."""

from __future__ import annotations

import numpy as np
import scipy

from ..arrays import Floats, Ints
from .rims import boundary, loops

SIDES = 16
"""Sides of a gap between rim and border up to which triangles without other vertices close it."""


def seams(vertices: Floats, faces: Ints, patches: Ints, step: float) -> tuple[Floats, Ints]:
    """Points on the rims of faces, (k, 3), and triangles, (m, 3), from there to the borders of patches.

    Rims get points at most `step` apart, by triangles without area. Each vertex of a border is joined to the nearest of
    them, so that no edge of a patch is open any more, and what is runs along the rims.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(2)
    >>> points, added = seams(ball.vertices, ball.faces[5:], ball.faces[:3], 0.05)
    >>> left = boundary(np.concatenate([ball.faces[5:], ball.faces[:3], added]))
    >>> bool(np.isin(left, np.append(boundary(ball.faces[5:]), len(ball.vertices) + np.arange(len(points)))).all())
    True
    """
    rim, (tails, heads) = boundary(faces), boundary(patches).T
    starts, ways = vertices[rim[:, 0]], vertices[rim[:, 1]] - vertices[rim[:, 0]]
    counts = np.maximum(np.ceil(np.linalg.norm(ways, axis=1) / step), 1).astype(np.int64) - 1
    edges = np.repeat(np.arange(len(rim)), counts)
    first = np.cumsum(counts) - counts
    shares = (np.arange(len(edges)) - first[edges] + 1) / (counts[edges] + 1)
    points = starts[edges] + shares[:, None] * ways[edges]
    names = len(vertices) + np.arange(len(points))
    last = np.append(edges[1:] != edges[:-1], True)[: len(edges)]
    onward = np.where(last, rim[edges, 1], names + 1)
    slivers = np.stack([rim[edges, 0], onward, names], axis=1)
    places = np.concatenate([vertices, points])
    ends, border = np.append(np.unique(rim), names), np.unique(tails)
    nearest = np.zeros(len(vertices), dtype=np.int64)
    nearest[border] = ends[scipy.spatial.cKDTree(places[ends]).query(vertices[border])[1]]
    strip = np.concatenate(
        [np.stack([tails, heads, nearest[heads]], axis=1), np.stack([tails, nearest[heads], nearest[tails]], axis=1)]
    )
    a, b, c = strip.T
    return points, np.concatenate([slivers, strip[(a != b) & (b != c) & (c != a)]])


def small_gaps(vertices: Floats, faces: Ints) -> Ints:
    """(k, 3) triangles that close the gaps of few sides that seams leave."""
    around = [loop for loop in loops(vertices, faces, boundary(faces)) if len(loop) <= SIDES]
    fans = [np.stack([np.full(len(loop) - 2, loop[0]), loop[1:-1], loop[2:]], axis=1) for loop in around]
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *fans])
