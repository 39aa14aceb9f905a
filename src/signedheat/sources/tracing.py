"""Shortest lines across faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import SourceError
from ..operators.laid_out_triangles import LaidOutTriangles
from .places import Places


def trace(
    triangles: LaidOutTriangles, start: Places, end: Places, name: str, segments: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    raise SourceError(f"{name}: segment {segments[0]} joins points that share no face: put points on the edges between")
