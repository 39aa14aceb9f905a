"""Straight lines through a shape, evenly spread over places and directions, and where they cross its triangles.

Lines of one direction pass through the pixels of a picture of the shape, into which the triangles are drawn one by one:
no tree is built, and the time grows with the number of triangles and crossings. Lines spread like this meet each piece
of surface in proportion to its area (Cauchy and Crofton's formula), however it is cut into triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..frozen import read_only
from ..mesh.components import grouped


@dataclass(frozen=True, eq=False)
class LineCrossings:
    """Where lines cross triangles, line after line and along each in order."""

    starts: Ints  # (n_lines + 1,) where the crossings of each line begin
    crossed: NDArray[np.integer]  # (k,) triangle of each crossing, or the face that it is part of
    entering: Bools  # (k,) whether the line comes from the side to which the triangle's normal points
    depths: Floats  # (k,) place along the line, in units of length
    cosines: Floats  # (k,) cosine of the angle between line and normal, not negative


def stabbing_lines(
    vertices: Floats, triangles: Ints, bounds: Floats, n_lines: int, n_directions: int = 16
) -> LineCrossings:
    """Cross a shape by about `n_lines` lines, through its shadows along some directions; the same lines every time.

    A line between triangles that share an edge by vertex ids crosses exactly one of them. Many lines may miss the
    shape. `bounds`, (2, 3), is a box around it.
    """
    frames = line_frames(n_directions)
    center, half = 0.5 * (bounds[0] + bounds[1]), 0.5 * (bounds[1] - bounds[0])
    extents = 2 * np.abs(frames) @ half  # (d, 3) of the box along each axis of each frame
    pixel = float(np.sqrt((extents[:, 0] * extents[:, 1]).sum() / max(n_lines, 1)))
    pixel = max(pixel, 1e-4 * float(extents.max()), np.finfo(float).tiny)  # where the box is hardly more than a line
    shapes = np.floor(extents[:, :2] / pixel).astype(np.int64) + 1
    first_lines = np.concatenate([[0], np.cumsum(shapes.prod(axis=1))])
    parts, fixed = [], read_only(triangles)
    for k in range(n_directions):
        shift = 0.5 * (shapes[k] - 1) + 0.5 * np.modf((k + 1) * np.array([2**0.5, 3**0.5]))[0] - 0.25
        parts.append(
            crossings_at_pixels(vertices, fixed, frames[k], center, pixel, shift, shapes[k], int(first_lines[k]))
        )
    ids, entering, places = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    by_depth = np.argsort(places[:, 0])
    starts, members = grouped(ids[by_depth, 0], int(first_lines[-1]))  # which keeps the order within each line
    order = by_depth[members]
    places = places[order]
    return LineCrossings(starts, ids[order, 1], entering[order], places[:, 0], places[:, 1])


@lru_cache(maxsize=4)
def line_frames(n: int) -> Floats:
    """Return (n, 3, 3) right-handed frames whose last rows are spread evenly over half a sphere, none along an axis."""
    height = (np.arange(n) + 0.5) / n
    turn = np.pi * (3 - 5**0.5) * np.arange(n)
    radius = np.sqrt(1 - height**2)
    ways = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    tilt, _ = np.linalg.qr(np.array([[0.9, 0.37, -0.23], [-0.31, 0.83, 0.46], [0.41, -0.29, 0.87]]))
    ways = ways @ tilt.T
    aside = np.cross(ways, [0.267, 0.535, 0.802])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    frames = np.stack([aside, np.cross(ways, aside), ways], axis=1)
    frames.flags.writeable = False
    return frames


@compiled
def crossings_at_pixels(
    vertices: Floats,
    triangles: Ints,
    frame: Floats,
    center: Floats,
    pixel: float,
    shift: Floats,
    shape: Ints,
    first_line: int,
) -> tuple[NDArray[np.int32], Bools, Floats]:
    """Return crossings of the lines through a picture's pixels: (line, triangle), whether it enters, (depth, cosine).

    Pixels are `pixel` apart in the plane of the first two rows of the frame, and the first one lies `shift` pixels
    before the center. Its line is `first_line`; the next line is to its right. On a row, the pixels from one side of a
    triangle on to before the next are inside.
    """
    n = len(vertices)
    at, cells = np.empty((n, 3)), np.empty((n, 2), dtype=np.int32)
    for v in range(n):
        x, y, z = vertices[v, 0] - center[0], vertices[v, 1] - center[1], vertices[v, 2] - center[2]
        at[v, 0] = (frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z) / pixel + shift[0]
        at[v, 1] = (frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z) / pixel + shift[1]
        at[v, 2] = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
        cells[v, 0], cells[v, 1] = np.int32(np.ceil(at[v, 0])), np.int32(np.ceil(at[v, 1]))
    capacity, count = 4 * shape[0] * shape[1] + 1024, 0
    ids, entering, places = np.empty((capacity, 2), np.int32), np.empty(capacity, np.bool_), np.empty((capacity, 2))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if cells[a, 1] == cells[b, 1] and cells[a, 1] == cells[c, 1]:
            continue  # between two rows
        if cells[a, 0] == cells[b, 0] and cells[a, 0] == cells[c, 0]:
            continue  # between two columns
        low, high = min(cells[a, 1], cells[b, 1], cells[c, 1]), max(cells[a, 1], cells[b, 1], cells[c, 1])
        ax, ay, bx, by, cx, cy = at[a, 0], at[a, 1], at[b, 0], at[b, 1], at[c, 0], at[c, 1]
        ux, uy, uz = bx - ax, by - ay, at[b, 2] - at[a, 2]
        wx, wy, wz = cx - ax, cy - ay, at[c, 2] - at[a, 2]
        double = ux * wy - uy * wx
        if double == 0.0:
            continue
        slope_x, slope_y = (uz * wy - wz * uy) / double, (wz * ux - uz * wx) / double
        least, most = min(at[a, 2], at[b, 2], at[c, 2]), max(at[a, 2], at[b, 2], at[c, 2])
        steep = 1.0 / np.sqrt(1.0 + (slope_x * slope_x + slope_y * slope_y) / (pixel * pixel))
        for j in range(max(low, 0), min(high, shape[1])):
            left, right = np.inf, -np.inf
            if (ay < j) != (by < j):
                x = _crossed(ax, ay, bx, by, j)
                left, right = min(left, x), max(right, x)
            if (by < j) != (cy < j):
                x = _crossed(bx, by, cx, cy, j)
                left, right = min(left, x), max(right, x)
            if (cy < j) != (ay < j):
                x = _crossed(cx, cy, ax, ay, j)
                left, right = min(left, x), max(right, x)
            if not left < right:
                continue
            for i in range(max(np.int64(np.ceil(left)), 0), min(np.int64(np.ceil(right)), shape[0])):
                if count == capacity:
                    ids, entering, places = _doubled(ids, entering, places)
                    capacity *= 2
                ids[count, 0], ids[count, 1] = first_line + j * shape[0] + i, t
                entering[count] = double < 0.0
                places[count, 0] = min(max(at[a, 2] + slope_x * (i - ax) + slope_y * (j - ay), least), most)
                places[count, 1] = steep
                count += 1
    return ids[:count], entering[:count], places[:count]


@compiled
def _crossed(ax: float, ay: float, bx: float, by: float, y: float) -> float:
    """Return where a row crosses a side: the same number whichever way round the side is given."""
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (bx - ax) * ((y - ay) / (by - ay))


@compiled
def _doubled(ids: NDArray[np.int32], entering: Bools, places: Floats) -> tuple[NDArray[np.int32], Bools, Floats]:
    """Return the same rows with room for as many more."""
    n = len(ids)
    more = np.empty((2 * n, 2), np.int32), np.empty(2 * n, np.bool_), np.empty((2 * n, 2))
    for k in range(n):
        more[0][k, 0], more[0][k, 1] = ids[k, 0], ids[k, 1]
        more[1][k] = entering[k]
        more[2][k, 0], more[2][k, 1] = places[k, 0], places[k, 1]
    return more
