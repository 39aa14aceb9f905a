"""Shapes and fields as structures of Polyscope."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

from ..domains.digital_surface import DigitalSurface
from ..domains.display import register_in_polyscope
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.polyline import Polyline
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import UnsupportedTypeError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.piecewise_field import PiecewiseField
from ..fields.tet_field import TetField
from ..fields.vertex_field import VertexField
from ..io.surface_fields import on_simple_surface
from ..packages import lazy_module

polyscope = lazy_module("polyscope", "views in Polyscope")

QUANTITY = "signed distance"


@singledispatch
def register(thing: object, name: str) -> Any:
    """The structure of Polyscope that shows a shape or a field."""
    raise UnsupportedTypeError(
        f"Polyscope has no structure for a {type(thing).__name__}", remedy="use plot()", element=type(thing).__name__
    )


register_in_polyscope.provide(register)


@register.register
def _(shape: TriangleMesh, name: str) -> Any:
    return polyscope.register_surface_mesh(name, shape.vertices, shape.faces)


@register.register
def _(shape: PolygonMesh, name: str) -> Any:
    return polyscope.register_surface_mesh(name, shape.vertices, [polygon.tolist() for polygon in shape.polygons])


@register.register
def _(shape: DigitalSurface, name: str) -> Any:
    return register(shape.squares, name)


@register.register
def _(shape: PointCloud, name: str) -> Any:
    cloud = polyscope.register_point_cloud(name, shape.points)
    if shape.normals is not None:
        cloud.add_vector_quantity("normals", shape.normals)
    return cloud


@register.register
def _(shape: TetMesh, name: str) -> Any:
    return polyscope.register_volume_mesh(name, shape.vertices, tets=shape.tets)


@register.register
def _(line: Polyline, name: str) -> Any:
    edges = "loop" if line.closed else "line"
    return polyscope.register_curve_network(name, np.column_stack([line.points, np.zeros(line.n_points)]), edges)


@register.register
def _(field: VertexField, name: str) -> Any:
    simple = on_simple_surface(field)
    return _colored(register(simple.domain, name), simple.values)


@register.register
def _(field: PiecewiseField, name: str) -> Any:
    return register(field.split(), name)


@register.register
def _(field: TetField, name: str) -> Any:
    return _colored(register(field.mesh, name), field.values)


@register.register
def _(field: BandField, name: str) -> Any:
    return register(field.coarse, name)


@register.register
def _(field: GridField, name: str) -> Any:
    grid = field.grid
    if grid.dimension != 3:
        raise UnsupportedTypeError(
            f"Polyscope has grids in space only, and this one has {grid.dimension} axes",
            remedy="use plot()",
            element="grid",
        )
    volume = polyscope.register_volume_grid(name, grid.shape, tuple(grid.origin), tuple(grid.upper))
    reach = float(np.nanmax(np.abs(field.values)))
    volume.add_scalar_quantity(
        QUANTITY, field.values, enabled=True, cmap="coolwarm", vminmax=(-reach, reach), enable_isosurface_viz=True
    )
    return volume


def _colored(structure: Any, values: Any) -> Any:
    """The structure with φ as colours centred on zero, and isolines."""
    reach = float(np.nanmax(np.abs(values)))
    look: dict[str, Any] = {"enabled": True, "cmap": "coolwarm", "vminmax": (-reach, reach)}
    structure.add_scalar_quantity(QUANTITY, values, isolines_enabled=True, isoline_width=reach / 8, **look)
    return structure
