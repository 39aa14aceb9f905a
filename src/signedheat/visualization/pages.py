"""Shapes and fields as pages that any browser shows, with everything in one file: turn, slice, choose a level."""

from __future__ import annotations

import base64
import html
import json
from functools import singledispatch
from importlib.resources import files
from typing import Any

import numpy as np

from ..domains.digital_surface import DigitalSurface
from ..domains.foreign import converted
from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError, UnsupportedTypeError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..fields.piecewise_field import PiecewiseField
from ..fields.tet_field import TetField
from ..fields.vertex_field import VertexField
from ..io.files import PathLike, ensure_writable, replacing
from ..io.surface_fields import on_simple_surface
from .colors import INSIDE_TO_OUTSIDE, isolines_between
from .scenes import triangulated
from .slices import telling_layer

PAGE_FORMATS = frozenset({".html", ".htm"})
MOST_NODES = 96
"""Along the longest side; of finer grids every second, third … node is shown."""
TET_NODES = 64
"""Along the longest side of the grid on which fields on tets are shown."""
LARGEST = 32_767
"""Values are stored as 16-bit numbers; one less than the negative of this stands for none."""


def save_page(thing: object, path: PathLike, title: str | None = None, up: int = 2) -> None:
    """Write a page on which a shape or a field can be turned, sliced, and shown at any level of either sign.

    The page needs no network and no other file.

    Parameters
    ----------
    thing : a shape, GridField, TetField, VertexField or PiecewiseField
        What to show; fields in the plane are shown flat.
    path : str or path
        The file, ``.html``.
    title : str, optional
        Of the page; by default the name of its type.
    up : int
        Axis that points upwards: 0, 1 or 2.

    Raises
    ------
    FileFormatError
        If the file cannot be written.
    UnsupportedTypeError
        If there is no page for things of this type.
    GeometryError
        If a field has neither 2 nor 3 dimensions, or no value.
    """
    ensure_writable(path, PAGE_FORMATS, "a page")
    content = {"low": 0.0, "high": 0.0, "step": 1.0, "axis": 1, "position": 0.0, "colors": INSIDE_TO_OUTSIDE, "up": up}
    content |= shown(thing)
    data = json.dumps(content, allow_nan=False).replace("</", "<\\/")
    text = files(__package__).joinpath("page.html").read_text(encoding="utf-8")
    parts = {"@TITLE@": html.escape(title or type(thing).__name__), "@ABOUT@": html.escape(repr(thing)), "@DATA@": data}
    for mark, part in parts.items():
        text = text.replace(mark, part)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@singledispatch
def shown(thing: Any) -> dict[str, Any]:
    """What the page is given: a volume or a mesh, its box, its range of values."""
    if (shape := converted(thing)) is not thing:
        return shown(shape)
    raise UnsupportedTypeError(
        f"there is no page for a {type(thing).__name__}",
        remedy="pass a shape in space or a field",
        element=type(thing).__name__,
    )


@shown.register(TriangleMesh)
@shown.register(PolygonMesh)
def _(shape: Any) -> dict[str, Any]:
    mesh = triangulated(shape)
    return _mesh(mesh.vertices, mesh.faces)


@shown.register
def _(shape: TetMesh) -> dict[str, Any]:
    return shown(shape.boundary)


@shown.register
def _(shape: DigitalSurface) -> dict[str, Any]:
    return shown(shape.squares)


@shown.register
def _(shape: PointCloud) -> dict[str, Any]:
    return _mesh(_in_space(shape.points), np.empty((0, 3), dtype=np.int64))


@shown.register
def _(field: VertexField) -> dict[str, Any]:
    simple = on_simple_surface(field.subdivided())
    domain: Any = simple.domain
    if isinstance(domain, PointCloud):
        return _mesh(_in_space(domain.points), np.empty((0, 3), dtype=np.int64), simple.values)
    triangles = domain.triangulation
    return _mesh(triangles.vertices, triangles.faces, domain.on_triangulation(simple.values))


@shown.register
def _(field: PiecewiseField) -> dict[str, Any]:
    return shown(field.split())


@shown.register
def _(field: TetField) -> dict[str, Any]:
    grid = Grid.around(field.mesh.bounds, resolution=TET_NODES, padding=0.0)
    return shown(GridField(grid, field(grid.points.reshape(-1, 3)).reshape(grid.shape)))


@shown.register
def _(field: BandField) -> dict[str, Any]:
    return shown(field.coarse)


@shown.register
def _(field: GridField) -> dict[str, Any]:
    grid = field.grid
    if grid.dimension not in (2, 3):
        raise GeometryError(
            f"pages show fields in 2 and 3 dimensions, and this one has {grid.dimension}",
            remedy="take a slice of it",
            element="field",
        )
    stride = max(1, -(-max(grid.shape) // MOST_NODES))
    values = field.values[(slice(None, None, stride),) * grid.dimension]
    look = _range(values)
    scale = max(abs(look["low"]), abs(look["high"]), 1e-300) / LARGEST
    rounded = np.where(np.isfinite(values), np.rint(values / scale), -LARGEST - 1).astype("<i2")
    flat = [0.0] * (3 - grid.dimension)
    shape = [*values.shape, *(1 for _ in flat)]
    spacing = [*(stride * grid.spacing).tolist(), *(1.0 for _ in flat)]
    origin = [*grid.origin.tolist(), *flat]
    upper = [o + s * (n - 1) for o, s, n in zip(origin, spacing, shape, strict=True)]
    volume = {"shape": shape, "origin": origin, "spacing": spacing, "scale": scale, "values": _text(rounded)}
    look["position"] = origin[2] if flat else float(grid.axes[1][telling_layer(field, 1)])
    return {**look, "volume": volume, "lower": origin, "upper": upper}


def _mesh(vertices: Any, faces: Any, values: Any = None) -> dict[str, Any]:
    used = vertices[np.unique(faces)] if len(faces) else vertices
    lower, upper = used.min(axis=0), used.max(axis=0)
    moved = (vertices - (lower + upper) / 2).astype("<f4")  # single precision, whatever the distance from the origin
    half = (upper - lower) / 2
    mesh = {"vertices": _text(moved), "faces": _text(faces.astype("<u4"))}
    look = {}
    if values is not None:
        mesh["values"] = _text(values.astype("<f4"))
        look = _range(values)
    return {**look, "mesh": mesh, "lower": (-half).tolist(), "upper": half.tolist()}


def _range(values: Any) -> dict[str, Any]:
    known = values[np.isfinite(values)]
    if not known.size:
        raise GeometryError("the field has no value anywhere", remedy="compute it again", element="field")
    low, high = float(known.min()), float(known.max())
    return {"low": min(low, 0.0), "high": max(high, 0.0), "step": isolines_between(low, high)[1]}


def _in_space(points: Any) -> Any:
    if points.shape[1] > 3:
        raise GeometryError(
            f"pages show points in up to 3 dimensions, not {points.shape[1]}", remedy="project them", element="points"
        )
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _text(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
