"""LAS, LAZ and E57, what laser scanners write: positions of points, by laspy and pye57."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from ..packages import lazy_module, require
from .files import PathLike, ensure_fits, parsed_by_others, reading, size_of

laspy = lazy_module("laspy", ".las and .laz files")
pye57 = lazy_module("pye57", ".e57 files")

BYTES = 60
"""Measured: what each point takes at most while a file is read."""


def read_las(path: PathLike) -> PointCloud:
    """Points of a LAS or LAZ file, with its scale and offset; it has no normals.

    Raises
    ------
    MissingPackageError
        If laspy is not installed, or for LAZ no package that it decompresses with.
    """
    size, opened = size_of(path), laspy.open
    if Path(path).suffix.lower() == ".laz" and not laspy.LazBackend.detect_available():
        require("lazrs", ".laz files")
    with reading(path):

        def parse() -> NDArray[np.float64]:
            with opened(str(path)) as file:
                ensure_fits(file.header.point_count * BYTES, path)
                return np.array(file.read().xyz, dtype=np.float64)

        return _cloud(parsed_by_others(parse, size), path)


def read_e57(path: PathLike) -> PointCloud:
    """Points of all scans of an E57 file, in its own place for each; those that are marked invalid are left out."""
    size, opened = size_of(path), pye57.E57
    with reading(path):

        def parse() -> NDArray[np.float64]:
            file = opened(str(path))
            try:
                ensure_fits(sum(file.get_header(k).point_count for k in range(file.scan_count)) * BYTES, path)
                scans = [file.read_scan(k, ignore_missing_fields=True) for k in range(file.scan_count)]
            finally:
                file.close()
            axes = ("cartesianX", "cartesianY", "cartesianZ")
            return np.concatenate([np.zeros((0, 3)), *(np.stack([s[a] for a in axes], axis=1) for s in scans)])

        return _cloud(parsed_by_others(parse, size), path)


def _cloud(points: NDArray[np.float64], path: PathLike) -> PointCloud:
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise FileFormatError("it has no points", path=path)
    return PointCloud(points)
