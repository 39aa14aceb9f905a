"""Shapes and fields in windows and notebooks, by PyVista."""

from __future__ import annotations

from contextlib import suppress
from functools import singledispatch
from typing import Any

from ..errors import GeometryError, OutsideError
from ..fields.field import Field
from ..grids.grid import Grid
from ..grids.polyline import Polyline
from ..packages import lazy_module
from ..shapes.exchange import VALUES_NAME
from ..tets.tet_mesh import TetMesh
from .figures import even_colors, isolines_between, range_of
from .surface_pictures import INNER_COLOR, OUTER_COLOR

pyvista: Any = lazy_module("pyvista", "windows")

BODY = "#d8d2c0"
"""Colour of points, lines and zero sets."""
LINE = "#1a1a1a"
"""Colour of isolines, outlines and polylines in the plane."""


def plotter_of(thing: object) -> Any:
    """Draw a shape or a field into a new `pyvista.Plotter`."""
    plotter = pyvista.Plotter()
    add(thing, plotter)
    plotter.add_axes()
    return plotter


@singledispatch
def add(thing: Any, plotter: Any) -> None:
    """Add a shape to a `pyvista.Plotter`, with the inner sides of faces in another colour.

    For polylines, grids and fields, other functions are registered.
    """
    if isinstance(thing, TetMesh):
        thing = thing.boundary
    mesh = thing.to_pyvista()
    if not mesh.faces.size:
        plotter.add_mesh(mesh, color=BODY, render_points_as_spheres=True, point_size=5, line_width=3)
        return
    plotter.add_mesh(mesh, color=OUTER_COLOR, backface_params={"color": INNER_COLOR})


@add.register
def _(line: Polyline, plotter: Any) -> None:
    plotter.add_mesh(line.to_pyvista(), color=LINE, line_width=3)
    plotter.view_xy()


@add.register(list)
def _(lines: list[Polyline], plotter: Any) -> None:
    for line in lines:
        add(line, plotter)


@add.register
def _(grid: Grid, plotter: Any) -> None:
    plotter.add_mesh(grid.to_pyvista().outline(), color=LINE)


@add.register(Field)
def _(field: Field[Any], plotter: Any) -> None:
    in_space = isinstance(field.domain, Grid | TetMesh)
    field = (field.coarse or field) if in_space else field.expand()
    drawn, look = field.to_pyvista(), _options_of(field.values)
    if not in_space:
        _add_colors(plotter, drawn, look, point_size=6, render_points_as_spheres=True)
        if drawn.faces.size:
            _add_isolines(plotter, drawn, look)
    elif isinstance(field.domain, Grid) and field.domain.dimension == 2:
        _add_colors(plotter, drawn, look)
        _add_isolines(plotter, drawn, look)
        plotter.view_xy()
    else:
        _add_section(plotter, drawn, look)
        _add_zero_set(plotter, field)


def _options_of(values: Any) -> dict[str, Any]:
    """Return how the values of a field are drawn, by name.

    ``reach`` is the largest absolute value, at which colours end on both sides of zero, ``colors`` a Matplotlib colour
    map, ``levels`` the values of isolines, and ``zero`` tells whether there are values on both sides of zero.
    """
    low, high = range_of(values)
    reach = max(abs(low), abs(high), 1e-300)
    levels = isolines_between(low, high)[0]
    return {"reach": reach, "colors": even_colors(reach).cmap, "levels": levels, "zero": low < 0 < high}


def _add_colors(plotter: Any, mesh: Any, look: dict[str, Any], **options: Any) -> None:
    """Add a PyVista mesh in the colours of its values, and a colour bar; `look` is what `_options_of` returns."""
    bar = {"title": "signed distance", "n_labels": 5, "fmt": "%.3g"}
    limits = (-look["reach"], look["reach"])
    plotter.add_mesh(
        mesh, scalars=VALUES_NAME, cmap=look["colors"], clim=limits, nan_color="#b9b9b9", scalar_bar_args=bar, **options
    )


def _add_isolines(plotter: Any, mesh: Any, look: dict[str, Any]) -> None:
    """Add the isolines of the values of a PyVista mesh, and a heavier line at zero, as `_options_of` says in `look`."""
    for levels, width in ((look["levels"], 1.0), ([0.0] if look["zero"] else [], 4.0)):
        lines = mesh.contour(list(levels), scalars=VALUES_NAME) if len(levels) else None
        if lines is not None and lines.n_points:
            mapper = plotter.add_mesh(lines, color=LINE, line_width=width, show_scalar_bar=False).mapper
            mapper.SetResolveCoincidentTopologyToPolygonOffset()  # draw lines above the surface they lie on
            mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-2.0, -2.0)


def _add_zero_set(plotter: Any, field: Any) -> None:
    """Add the surface φ = 0, translucent."""
    with suppress(OutsideError, GeometryError):  # the zero set may be empty
        plotter.add_mesh(field.contour(0.0).to_pyvista(), color=BODY, opacity=0.6)


def _add_section(plotter: Any, mesh: Any, look: dict[str, Any]) -> None:
    """Add the section of a PyVista mesh with the plane normal to y through its middle, and the box around it.

    `look` is what `_options_of` returns.
    """
    plotter.add_mesh(mesh.outline(), color=LINE)
    section = mesh.slice(normal="y")
    _add_colors(plotter, section, look, lighting=False)
    _add_isolines(plotter, section, look)
