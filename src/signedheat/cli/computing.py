"""From options to a field."""

from __future__ import annotations

import multiprocessing
from argparse import Namespace
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, overload

from .. import sharpen
from ..constraints import Constraint, EachComponent, Free, LevelValues, Soft, ZeroSet
from ..diagnostics import SampledSource
from ..domains.grid import Grid, room_around
from ..domains.tet_mesh import TetMesh
from ..errors import SignedHeatError
from ..extensions.figures import describe as describe
from ..extensions.figures import told
from ..extensions.solid_distance import solid_distance
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..io import read_mask
from ..lowering.area_elements import bounds_around
from ..progress import Progress, within
from ..solids.complete import complete
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
        elif isinstance(domain, TetMesh) or domain.dimension == 3:
            field = solid_distance(
                shape,
                domain,
                constraint=constraint_of(arguments.constraint),
                diffusion=arguments.diffusion,
                as_oriented=arguments.as_oriented,
                keep_overlaps=arguments.keep_overlaps,
                plain=arguments.plain,
                progress=progress,
            )
        else:
            field = planar_distance(shape, domain, arguments, progress)
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


def planar_distance(lines: Any, grid: Grid, arguments: Namespace, progress: Progress) -> GridField:
    """Distance to polylines, sharpened unless ``--plain`` is given or the grid has walls."""
    plain = arguments.plain or grid.mask is not None
    share = 1.0 if plain else 0.8
    solver = SignedHeatSolver(grid, arguments.diffusion, lambda done, step: progress(share * done, step))
    field: GridField = solver.distance(lines, constraint_of(arguments.constraint))
    if plain:
        return field
    progress(share, "sharpen")
    return sharpen(field)


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
