"""Draw any shape or field: rows of pictures in one style, and representations in notebooks."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable
from functools import singledispatch
from typing import Any

import numpy as np

from ..curves.cut_surface import CutSurface
from ..errors import GeometryError, MissingPackageError, UnsupportedTypeError
from ..fields.field import Field
from ..grids.grid import Grid
from ..grids.polyline import Polyline
from ..io.files import PathLike
from ..packages import lazy_module
from ..shapes.foreign import converted
from ..shapes.kinds import Shape
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .figures import new_figure, picture
from .slice_pictures import TET_NODES, clearest_layer, draw_line, draw_plane, draw_slices
from .surface_pictures import draw_shape, draw_surface

pillow: Any = lazy_module("PIL.Image", "pictures")


def save_row(panels: Iterable[tuple[Any, ...]], path: PathLike) -> None:
    """Write a picture of several shapes and fields, side by side, each with its title.

    Parameters
    ----------
    panels : iterable of (title, thing) or (title, thing, options)
        Title and content of each panel from left to right. The content is a shape or a field. The options are
        further arguments by name of the function that draws it, which is `draw_shape` for shapes, `draw_slices` for
        fields on grids in space, `draw_plane` for fields in the plane, and `draw_surface` for fields on surfaces.
    path : str or path
        The file, in the format ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    UnsupportedTypeError
        If something is neither a shape nor a field.
    """
    listed = list(panels) if isinstance(panels, Iterable) else []
    if not listed or not all(isinstance(panel, tuple | list) and len(panel) in (2, 3) for panel in listed):
        raise UnsupportedTypeError(
            "a row is drawn of panels", remedy="pass [(title, shape or field), …]", element="panels"
        )
    with picture(path, 4.3 * len(listed), 4.3, dpi=110) as figure:  # in inches
        for k, (title, thing, *options) in enumerate(listed):
            axes = figure.add_subplot(1, len(listed), k + 1)
            if not draw(thing, axes, **(options[0] if options else {})):
                kind = type(thing).__name__
                raise UnsupportedTypeError(f"a {kind} cannot be drawn", remedy="pass a shape or a field", element=title)
            axes.set_title(title, fontsize=11)


def html_of(thing: object) -> str:
    """Return HTML with the representation of an object and, if it can be drawn and Matplotlib is there, a picture."""
    text = f"<code>{html.escape(repr(thing))}</code>".replace("\n", "<br>")
    try:
        figure = new_figure(3.4 * 1.25, 3.4)  # in inches
        drawn = draw(thing, figure.add_subplot())
    except (MissingPackageError, GeometryError):  # fields without a value raise GeometryError
        return text
    if not drawn:
        return text
    whole, small = io.BytesIO(), io.BytesIO()
    figure.savefig(whole, dpi=90, format="png")
    # with few colours, since notebooks store it with every output
    pillow.open(whole).convert("RGB").quantize(96).save(small, format="png", optimize=True)
    data = base64.b64encode(small.getvalue()).decode()
    return f'{text}<br><img alt="{html.escape(type(thing).__name__)}" src="data:image/png;base64,{data}">'


@singledispatch
def draw(thing: Any, axes: Any, **options: Any) -> bool:
    """Draw a shape or field, or each of a list, into Matplotlib axes, and return whether it can be drawn.

    `options` are further arguments of the function that draws it, as in `save_row`.
    """
    shape = converted(thing)
    if isinstance(shape, list):
        return all([draw(part, axes, **options) for part in shape])
    return shape is not thing and draw(shape, axes, **options)


@draw.register(TriangleMesh)
@draw.register(PolygonMesh)
@draw.register(PointCloud)
@draw.register(TetMesh)
@draw.register(DigitalSurface)
def _(shape: Shape, axes: Any, **options: Any) -> bool:
    if isinstance(shape, PointCloud) and shape.points.shape[1] != 3:
        return False
    draw_shape(shape, axes, **options)
    return True


@draw.register
def _(line: Polyline, axes: Any, **options: Any) -> bool:
    draw_line(line, axes)
    axes.set_aspect("equal")
    return True


@draw.register(Field)
def _(field: Field[Any], axes: Any, **options: Any) -> bool:
    return draw_on(field.domain, field, axes, **options)


@singledispatch
def draw_on(domain: object, field: Field[Any], axes: Any, **options: Any) -> bool:
    """Draw a field on a surface into axes, and return whether it can be drawn.

    For domains that are not surfaces, other functions are registered.
    """
    simple = field if isinstance(domain, CutSurface) else field.plain()
    if isinstance(simple.domain, PointCloud) and simple.domain.points.shape[1] != 3:
        return False
    draw_surface(simple, axes, **options)
    return True


@draw_on.register
def _(grid: Grid, field: Field[Grid], axes: Any, **options: Any) -> bool:
    if grid.dimension not in (2, 3):
        return False
    if grid.dimension == 2:
        draw_plane(field, axes, **options)
    else:
        draw_slices(field, [axes], **{"across": (_best_axis(field),), **options})
    return True


@draw_on.register
def _(mesh: TetMesh, field: Field[TetMesh], axes: Any, **options: Any) -> bool:
    grid = Grid.around(np.delete(mesh.bounds, 1, axis=1), TET_NODES, padding=0.0)
    points = np.insert(grid.points.reshape(-1, 2), 1, mesh.bounds[:, 1].mean(), axis=1)
    draw_plane(Field(grid, field(points).reshape(grid.shape)), axes, **options)
    axes.set(ylabel="z")
    return True


def _best_axis(field: Field[Grid]) -> int:
    """Return the axis across which a slice shows the largest area inside: 0, 1 or 2; if equal, y before z before x."""
    field = field.coarse or field
    inside = field.values < 0
    counts = [int(inside.take(clearest_layer(field, axis), axis).sum()) for axis in range(3)]
    return max((1, 2, 0), key=lambda axis: counts[axis])
