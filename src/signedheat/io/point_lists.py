"""Tables of points: one point per line, an empty line between polylines."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from .files import PathLike, text


def read_point_lists(path: PathLike, dimension: int) -> list[tuple[NDArray[np.float64], bool]]:
    """Points (n, dimension) of each polyline, and whether it is closed (its last point equals its first).

    Numbers are separated by commas, semicolons, tabs or spaces. Lines that begin with ``#`` and a header line are
    skipped.

    Raises
    ------
    FileFormatError
        If a line does not have `dimension` numbers, or there is no such line.
    """
    blocks: list[list[list[float]]] = [[]]
    for number, line in enumerate(text(path).removeprefix("\ufeff").splitlines(), start=1):
        words = [word for word in re.split(r"[,;\s]+", line.strip()) if word]
        if not words:
            blocks.append([])
        elif not words[0].startswith("#"):
            try:
                values = [float(word) for word in words]
            except ValueError:
                values = []
            if len(values) == dimension:
                blocks[-1].append(values)
            elif values or any(blocks):
                raise FileFormatError(
                    f"line {number}, '{line.strip()[:60]}', does not hold {dimension} numbers",
                    remedy="give one point a line, and an empty line between polylines",
                    element=f"line {number}",
                )
    lists = [np.array(block) for block in blocks if block]
    if not lists:
        raise FileFormatError("there is no point in it", remedy=f"give {dimension} numbers a line")
    closed = [len(points) > 3 and bool((points[0] == points[-1]).all()) for points in lists]
    return [(points[:-1] if end else points, end) for points, end in zip(lists, closed, strict=True)]


def write_point_lists(lists: Sequence[tuple[NDArray[np.float64], bool]]) -> str:
    """The text that `read_point_lists` reads."""
    blocks = []
    for points, closed in lists:
        rows = [*points.tolist(), *([points[0].tolist()] if closed else [])]
        blocks.append("".join(",".join(map(repr, row)) + "\n" for row in rows))
    return "\n".join(blocks)
