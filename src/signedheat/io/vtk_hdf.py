"""VTKHDF, VTK's own kind of HDF5: fields on grids as image data, surfaces as polygons, tets; written by h5py.

After VTK's published description of the format, version 1.0 of image data and of unstructured grids, 2.0 of polygons,
which ParaView 5.12 and later and VTK 9.3 and later read.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.exchange import NAME, Elements
from ..domains.grid import Grid
from ..packages import lazy_module
from .files import PathLike

h5py = lazy_module("h5py", "VTKHDF files")
TETRA = 10
"""VTK's number for tets."""


def image_in_hdf(grid: Grid, values: Mapping[str, NDArray[Any]]) -> bytes:
    """Values at the nodes of a grid in the plane or in space, by name."""
    missing = 3 - grid.dimension
    shape = (*grid.shape, *[1] * missing)
    with io.BytesIO() as data:
        file = h5py.File(data, "w")
        root = _root(file, "ImageData", (1, 0))
        root.attrs["WholeExtent"] = np.array([[0, n - 1] for n in shape]).ravel()
        root.attrs["Origin"] = np.append(grid.origin, [0.0] * missing)
        root.attrs["Spacing"] = np.append(grid.spacing, [1.0] * missing)
        root.attrs["Direction"] = np.eye(3).ravel()
        _point_data(root, {name: each.T for name, each in values.items()})
        file.close()
        return data.getvalue()


def write_vtkhdf(shape: Elements, path: PathLike) -> bytes:
    """Polygons, points or tets, with values at the points by name."""
    points, values = np.asarray(shape.points, dtype=np.float64), dict(shape.values)
    if shape.normals is not None:
        values["Normals"] = shape.normals
    with io.BytesIO() as data:
        file = h5py.File(data, "w")
        if shape.tets is not None:
            root = _root(file, "UnstructuredGrid", (1, 0))
            _cells(root, shape.tets.ravel(), np.full(len(shape.tets), 4))
            root["NumberOfCells"] = np.array([len(shape.tets)])
            root["Types"] = np.full(len(shape.tets), TETRA, dtype=np.uint8)
        else:
            root = _root(file, "PolyData", (2, 0))
            alone = np.arange(len(points) if not len(shape.counts) else 0)
            none = np.zeros(0, dtype=np.int64)
            _cells(root.create_group("Vertices"), alone, np.ones_like(alone))
            _cells(root.create_group("Polygons"), shape.corners, shape.counts)
            _cells(root.create_group("Lines"), none, none)
            _cells(root.create_group("Strips"), none, none)
        root["NumberOfPoints"] = np.array([len(points)])
        root["Points"] = points
        _point_data(root, values)
        file.close()
        return data.getvalue()


def _root(file: Any, kind: str, version: tuple[int, int]) -> Any:
    """The group that VTK looks for, with the kind of data that it holds."""
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array(version)
    root.attrs.create("Type", np.bytes_(kind))
    return root


def _cells(group: Any, corners: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
    """Write the vertex ids of cells, one after another, and where each begins, into a group of the file."""
    if group.name != "/VTKHDF":
        group["NumberOfCells"] = np.array([len(counts)])
    group["NumberOfConnectivityIds"] = np.array([len(corners)])
    group["Connectivity"] = np.asarray(corners, dtype=np.int64)
    group["Offsets"] = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _point_data(root: Any, values: Mapping[str, NDArray[Any]]) -> None:
    """Arrays at the points; ParaView shows the first of them."""
    data = root.create_group("PointData")
    for name, each in values.items():
        data[name] = np.ascontiguousarray(each)
    if NAME in values:
        data.attrs.create("Scalars", np.bytes_(NAME))
