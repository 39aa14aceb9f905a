"""Domains and fields as objects of PyVista."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

from ..domains.digital_surface import DigitalSurface
from ..domains.display import to_pyvista
from ..domains.grid import Grid
from ..domains.intrinsic_triangulation import IntrinsicTriangulation
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.polyline import Polyline
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError, UnsupportedTypeError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.piecewise_field import PiecewiseField
from ..fields.tet_field import TetField
from ..fields.vertex_field import VertexField
from ..packages import lazy_module
from .surface_fields import NAME, on_simple_surface

pyvista = lazy_module("pyvista", "objects of PyVista")


@singledispatch
def as_pyvista(thing: object) -> Any:
    """An object of PyVista with the same points and cells; values of a field are point data ``signed_distance``."""
    raise UnsupportedTypeError(f"PyVista has no object for a {type(thing).__name__}", element=type(thing).__name__)


to_pyvista.provide(as_pyvista)


@as_pyvista.register(TriangleMesh)
@as_pyvista.register(PolygonMesh)
@as_pyvista.register(PointCloud)
@as_pyvista.register(TetMesh)
def _(shape: TriangleMesh | PolygonMesh | PointCloud | TetMesh) -> Any:
    return shape.to_pyvista()


@as_pyvista.register
def _(shape: DigitalSurface) -> Any:
    return shape.squares.to_pyvista()


@as_pyvista.register
def _(triangulation: IntrinsicTriangulation) -> Any:
    return triangulation.mesh.to_pyvista()


@as_pyvista.register
def _(line: Polyline) -> Any:
    points = np.column_stack([line.points, np.zeros(line.n_points)])
    return pyvista.lines_from_points(points, close=line.closed)


@as_pyvista.register
def _(grid: Grid) -> Any:
    if grid.dimension not in (2, 3):
        raise GeometryError(
            f"PyVista has grids in the plane and in space, and this one has {grid.dimension} axes",
            remedy="take two or three of its axes",
            element="grid",
        )
    flat = (0,) * (3 - grid.dimension)
    image = pyvista.ImageData(
        dimensions=(*grid.shape, *(1 for _ in flat)), spacing=(*grid.spacing, *flat), origin=(*grid.origin, *flat)
    )
    if grid.mask is not None:
        image.point_data["solid"] = grid.mask.ravel(order="F")
    return image


@as_pyvista.register
def _(field: GridField) -> Any:
    image = as_pyvista(field.grid)
    if field.confidence is not None:
        image.point_data["confidence"] = field.confidence.ravel(order="F")
    return _with_values(image, field.values.ravel(order="F"))


@as_pyvista.register
def _(field: BandField) -> Any:
    return as_pyvista(field.coarse)


@as_pyvista.register
def _(field: TetField) -> Any:
    return _with_values(as_pyvista(field.mesh), field.values)


@as_pyvista.register
def _(field: VertexField) -> Any:
    simple = on_simple_surface(field)
    return _with_values(as_pyvista(simple.domain), simple.values)


@as_pyvista.register
def _(field: PiecewiseField) -> Any:
    return as_pyvista(field.split())


def _with_values(thing: Any, values: Any) -> Any:
    thing.point_data[NAME] = np.array(values)
    thing.set_active_scalars(NAME)
    return thing
