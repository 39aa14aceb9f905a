"""Level lines of functions on intrinsic triangulations, as polylines on the mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geodesics.exact import cleared
from ..geodesics.sources import zero_line
from ..polylines import assemble_polylines
from .history import History, straight_lines
from .transfer import ConformingRefinement, barycentric_of

LEAST = 1e-12
"""Values that are smaller, relative to the largest, count as zero."""


def level_lines(
    history: History, refinement: ConformingRefinement, values: NDArray[np.float64]
) -> list[tuple[NDArray[np.int64], NDArray[np.float64], bool]]:
    """The zero set of a function that is linear on the triangles after a history, on those before the refinement.

    Every segment is straight on an intrinsic triangle, and is traced across the faces of the mesh below. The triangles
    must be consistently oriented.

    Returns
    -------
    list of (faces, barycentric, closed)
        Points of one polyline each, in order, with larger values to its left.
    """
    least = LEAST * max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300)
    line = zero_line(history.after, cleared(history.after, values, least))
    if not len(line.faces):
        return []
    spots = barycentric_of(history.after, line.faces, line.positions)
    lines = straight_lines(
        history.gluing_before, *history.backward(line.faces, spots.mean(axis=1), np.diff(spots, axis=1))
    )
    faces, starts = refinement.pull_back(lines.faces, lines.starts)
    ends = refinement.pull_back(lines.faces, lines.ends)[1]
    first = np.searchsorted(lines.owners, np.arange(len(line.faces) + 1))
    found = []
    for order, _, closed in assemble_polylines(*line.ends.T):
        rows = np.concatenate([np.arange(first[k], first[k + 1]) for k in order])
        if closed:
            found.append((faces[rows], starts[rows], True))
        elif len(rows):
            found.append(
                (np.append(faces[rows], faces[rows[-1]]), np.concatenate([starts[rows], ends[rows[-1:]]]), False)
            )
    return found
