"""Polylines as sources on grids in the plane: their area elements are segments, with normals that point to the left."""

from __future__ import annotations

import numpy as np

from ..domains.polyline import Polyline
from .area_elements import AreaElements, area_elements


@area_elements.register
def _(shape: Polyline) -> AreaElements:
    tangents = shape.segments[:, 1] - shape.segments[:, 0]
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    return AreaElements(shape.segments, normals, shape.segment_lengths, np.zeros(len(tangents), dtype=np.int64))
