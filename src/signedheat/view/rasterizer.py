"""A small software rasteriser for triangles: depth, face and value at each pixel.

Matplotlib sorts whole faces by depth, which is wrong where they pass through each other, as those of broken shapes do;
VTK has half a gigabyte, and needs a display or a library for drawing without one, which servers do not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..frozen import read_only
from ..search.stabbing_lines import crossings_at_pixels

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
    vertices, frame = read_only(corners.reshape(-1, 3)), read_only(np.eye(3))
    triangles = read_only(np.arange(3 * len(corners)).reshape(-1, 3))
    shape, none = np.array([width, height]), np.zeros(3)
    ids, _, places = crossings_at_pixels(vertices, triangles, frame, none, 1.0, none[:2], shape, 0)
    order = np.argsort(places[:, 0], kind="stable")  # the nearest is written last
    depth, face, shown = np.full(height * width, -np.inf), np.full(height * width, -1), np.full(height * width, np.nan)
    depth[ids[order, 0]], face[ids[order, 0]] = places[order, 0], ids[order, 1]
    pixels = np.flatnonzero(face >= 0)
    a, b, c = (corners[face[pixels], k, :2] @ [1, 1j] for k in range(3))
    away = pixels % width + 1j * (pixels // width) - a
    area = (np.conj(b - a) * (c - a)).imag
    u, v = (np.conj(away) * (c - a)).imag / area, (np.conj(b - a) * away).imag / area
    shown[pixels] = (np.stack([1 - u - v, u, v], axis=1) * values[face[pixels]]).sum(axis=1)
    return depth.reshape(height, width), face.reshape(height, width), shown.reshape(height, width)
