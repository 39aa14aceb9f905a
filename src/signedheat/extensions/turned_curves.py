"""Curves on surfaces with their positive side negative."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..domains.curves import Curve, CurveOrPoints


def with_turned(curves: Sequence[CurveOrPoints], turned: NDArray[np.bool_]) -> list[CurveOrPoints]:
    """The curves, some with their positive side negative."""
    return [_turned(curve) if turn else curve for curve, turn in zip(curves, turned, strict=True)]


def _turned(curve: CurveOrPoints) -> CurveOrPoints:
    assert isinstance(curve, Curve)
    if curve.normals is None:
        return curve.reversed()
    return Curve(curve.faces, curve.barycentric, curve.closed, curve.oriented, -curve.normals)
