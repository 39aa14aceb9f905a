"""From options to a field."""

from __future__ import annotations

import multiprocessing
from argparse import Namespace
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, overload

from ..constraints import Constraint, EachComponent, Free, LevelValues, Soft, ZeroSet
from ..curves.plane import distance_to_lines
from ..diagnostics import SampledSource
from ..domains.grid import Grid, room_around
from ..domains.polygon_mesh import PolygonMesh
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SignedHeatError
from ..extensions.figures import describe as describe
from ..extensions.figures import told
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..io import read_mask
from ..lowering.area_elements import bounds_around
from ..orientation.orient import orient
from ..progress import Progress, within
from ..solids.complete import complete
from ..solids.distance import distance_to_shapes
from ..solver import SignedHeatSolver, as_list
from .progress import ProgressBar
from .streams import say

RESOLUTION = 128
COMPLETED = 0.3
"""Share of the progress of a band that completing the shape is."""
MOST = 0.9
"""Fraction of the area that may cancel without a warning."""


@contextmanager
def prefix_errors(path: Any) -> Iterator[None]:
    """Prefix the messages of errors with the name of the input."""
    try:
        yield
    except SignedHeatError as error:
        if error.path is not None:
            raise
        raise error.at(path) from error


def grid_for(shape: Any, arguments: Namespace, reach: float = 0.0) -> Grid:
    """The grid given by the options, by default with room for offsets up to `reach`."""
    spacing = arguments.spacing
    if spacing is not None and len(spacing) == 1:
        spacing = spacing[0]
    if arguments.mask is not None:
        with prefix_errors(arguments.mask):
            return read_mask(arguments.mask, origin=arguments.origin, spacing=spacing)
    if arguments.origin is not None:
        return Grid(arguments.origin, spacing, arguments.grid_shape)
    options = {"resolution": arguments.resolution or RESOLUTION, "spacing": spacing}
    bounds = bounds_around(as_list(shape))
    padding = room_around(bounds, reach) if arguments.padding is None else arguments.padding
    return Grid.around(bounds, padding=padding, **options)


def constraint_of(word: str) -> Constraint:
    """A constraint from its name on the command line.

    Examples
    --------
    >>> constraint_of("soft:0.5")
    Soft(weight=0.5)
    """
    name, _, values = word.partition(":")
    if name == "levels":
        return LevelValues([float(value) for value in values.split(",")])
    if name == "soft":
        return Soft(float(values)) if values else Soft()
    named: dict[str, Constraint] = {
        "free": Free(),
        "zero-set": ZeroSet(),
        "hard": ZeroSet(hard=True),
        "each-component": EachComponent(),
    }
    return named[word]


@overload
def compute(shape: Any, domain: Grid, arguments: Namespace) -> GridField: ...
@overload
def compute(shape: Any, domain: TetMesh, arguments: Namespace) -> TetField: ...
def compute(shape: Any, domain: Grid | TetMesh, arguments: Namespace) -> GridField | TetField:
    """Distance to a solid in space, to polylines in the plane; what matters about it goes to standard error."""
    field: GridField | TetField
    with ProgressBar(arguments.quiet or arguments.json) as progress:
        if isinstance(domain, Grid) and arguments.band is not None:
            field = in_band(shape, domain, arguments, progress)
        elif arguments.plain or not isinstance(constraint_of(arguments.constraint), Free | ZeroSet | Soft):
            field = plain_distance(shape, domain, arguments, progress)
        else:
            shared = {"diffusion": arguments.diffusion, "progress": progress}
            shared["constraint"] = constraint_of(arguments.constraint)
            if isinstance(domain, Grid) and domain.dimension == 2:
                field = distance_to_lines(shape, domain, **shared)
            else:
                shared |= {"as_oriented": arguments.as_oriented, "keep_overlaps": arguments.keep_overlaps}
                field = distance_to_shapes(shape, domain, **shared)
    if not arguments.quiet:
        for line in told(field):
            say(f"signedheat: {line}")
    return field


def in_band(shape: Any, grid: Grid, arguments: Namespace, progress: Progress) -> GridField:
    """Distance in a band: all of it in memory, or tile by tile."""
    shared: dict[str, Any] = {"as_oriented": arguments.as_oriented, "keep_overlaps": arguments.keep_overlaps}
    shared |= {"constraint": constraint_of(arguments.constraint), "diffusion": arguments.diffusion}
    solid = complete(shape, **shared, progress=within(progress, 0.0, COMPLETED))
    options: dict[str, Any] = {
        "grid": grid,
        "band": arguments.band,
        "store": getattr(arguments, "tiles", None),
        "progress": within(progress, COMPLETED, 1.0),
    }
    if options["store"] is None:
        return solid.field(**options)
    if arguments.workers is None:
        return solid.field(scheduler=arguments.scheduler, **options)
    with ProcessPoolExecutor(arguments.workers, multiprocessing.get_context("spawn")) as pool:
        return solid.field(scheduler=pool, **options)


def plain_distance(shape: Any, domain: Grid | TetMesh, arguments: Namespace, progress: Progress) -> Any:
    """φ as the method gives it, of meshes whose faces are turned outwards first."""
    if isinstance(shape, TriangleMesh | PolygonMesh) and not arguments.as_oriented:
        shape = orient(shape)
    return SignedHeatSolver(domain, arguments.diffusion, progress).distance(shape, constraint_of(arguments.constraint))


def hint(field: GridField) -> str:
    """A further line of output about sources that may have been given twice, or nothing."""
    note = field.diagnostics.note(SampledSource)
    cancelled = note.area_cancelled if note else 0.0
    if cancelled < MOST:
        return ""
    return (
        f"\n{cancelled:.4%} of the area lies within a cell of area that faces the other way, as on thin sheets: if "
        "faces are doubled, remove one copy"
    )
