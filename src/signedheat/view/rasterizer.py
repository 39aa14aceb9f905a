"""A small software rasteriser for triangles: depth, face and value at each pixel.

Matplotlib sorts whole faces by depth, which is wrong where they pass through each other, as those of broken shapes do.
VTK takes half a gigabyte, and needs a display, or a library to draw without one, which servers do not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled

SIZE = 900
"""Pixels along the longer side."""
MARGIN = 10
"""Width of the empty margin in pixels."""
LIGHT = np.array([0.25, 0.35, 0.9]) / np.linalg.norm([0.25, 0.35, 0.9])
"""Direction to the light: right, up and towards the eye."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A parallel projection."""

    frame: Floats  # (3, 3) right, up and towards the eye
    lower: Floats  # (2,) lower left corner of the picture, in units of length
    scale: float  # pixels per unit of length
    width: int  # in pixels
    height: int

    @classmethod
    def around(cls, points: Floats, direction: Floats, up: int = 2) -> Camera:
        """Camera that views points from a direction, with axis `up` pointing up, so that they fill the picture."""
        frame = looking(direction, up)
        seen = points @ frame[:2].T
        lower, upper = seen.min(axis=0), seen.max(axis=0)
        scale = (SIZE - 2 * MARGIN) / max(float((upper - lower).max()), 1e-300)
        width, height = (np.ceil((upper - lower) * scale).astype(int) + 2 * MARGIN).tolist()
        return cls(frame, lower, scale, width, height)

    def pixels(self, points: Floats) -> Floats:
        """(n, 3) column, row and depth of points in space; larger depths are nearer."""
        seen = points @ self.frame.T
        return np.column_stack([(seen[:, :2] - self.lower) * self.scale + MARGIN, seen[:, 2] * self.scale])

    def shades(self, area_vectors: Floats) -> Floats:
        """(m,) brightness of faces, from 0.45 to 1, the same for both sides of a face."""
        normals = area_vectors @ self.frame.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        return 0.45 + 0.55 * np.abs(normals @ LIGHT)


def looking(direction: Floats, up: int = 2) -> Floats:
    """(3, 3) axes right, up and towards the eye, for a direction towards the eye."""
    towards = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    upwards = np.eye(3)[up] if abs(towards[up]) < 0.95 else np.eye(3)[up - 1]
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards]) + 0.0


def oblique(elevation: float, azimuth: float, up: int = 2) -> Floats:
    """Direction to the eye from elevation and azimuth in degrees: above the plane across axis `up`, and around it."""
    e, a = np.radians([elevation, azimuth])
    return np.roll([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], up - 2)


def rasterize(corners: Floats, values: Floats, width: int, height: int) -> tuple[Floats, Ints, Floats]:
    """Draw triangles (m, 3, 3), given in pixels and depth, with values (m, 3) at their corners.

    Return depth, face and value of the nearest triangle at each pixel; face −1 and value NaN where there is none.
    """
    depth, face = np.full(height * width, -np.inf), np.full(height * width, -1)
    shown = np.full(height * width, np.nan)
    _draw(np.ascontiguousarray(corners), width, height, depth, face)
    pixels = np.flatnonzero(face >= 0)
    a, b, c = (corners[face[pixels], k, :2] @ [1, 1j] for k in range(3))
    away = pixels % width + 1j * (pixels // width) - a
    area = (np.conj(b - a) * (c - a)).imag
    u, v = (np.conj(away) * (c - a)).imag / area, (np.conj(b - a) * away).imag / area
    shown[pixels] = (np.stack([1 - u - v, u, v], axis=1) * values[face[pixels]]).sum(axis=1)
    return depth.reshape(height, width), face.reshape(height, width), shown.reshape(height, width)


@compiled
def _draw(corners: Floats, width: int, height: int, depth: Floats, face: Ints) -> None:
    """Depth and face of the nearest triangle at each pixel of a picture, row after row; the later one of equals.

    In each row a triangle has the pixels from one of its sides on to before the next, so that two triangles with a
    common side leave none out, and share none.
    """
    for t in range(len(corners)):
        ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
        bx, by, bz = corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2]
        cx, cy, cz = corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2]
        double = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if double == 0.0:
            continue
        slope_x = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) / double
        slope_y = ((cz - az) * (bx - ax) - (bz - az) * (cx - ax)) / double
        least, most = min(az, bz, cz), max(az, bz, cz)
        for row in range(max(np.int64(np.ceil(min(ay, by, cy))), 0), min(np.int64(np.ceil(max(ay, by, cy))), height)):
            left, right = np.inf, -np.inf
            if (ay < row) != (by < row):
                x = _crossed(ax, ay, bx, by, row)
                left, right = min(left, x), max(right, x)
            if (by < row) != (cy < row):
                x = _crossed(bx, by, cx, cy, row)
                left, right = min(left, x), max(right, x)
            if (cy < row) != (ay < row):
                x = _crossed(cx, cy, ax, ay, row)
                left, right = min(left, x), max(right, x)
            if not left < right:
                continue
            for column in range(max(np.int64(np.ceil(left)), 0), min(np.int64(np.ceil(right)), width)):
                z = min(max(az + slope_x * (column - ax) + slope_y * (row - ay), least), most)
                if z >= depth[row * width + column]:
                    depth[row * width + column], face[row * width + column] = z, t


@compiled
def _crossed(ax: float, ay: float, bx: float, by: float, y: float) -> float:
    """Where a row crosses a side: the same number whichever way round the side is given."""
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (bx - ax) * ((y - ay) / (by - ay))
