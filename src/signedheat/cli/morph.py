"""``signedheat morph``: morphological operations on a broken shape."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from typing import Any, cast

from ..domains.grid import Grid
from ..domains.triangle_mesh import TriangleMesh
from ..extensions.morphology import closing, dilate, erode, opening, shell, thicken
from ..fields.grid_field import GridField
from ..io import SHAPE_FORMATS, ensure_writable, save
from ..visualization import ensure_picture_writable, save_scene, save_slices
from .computing import Summary, compute, describe, grid_for, prefix_errors
from .placing import read_source

OPERATIONS: dict[str, Callable[..., TriangleMesh]] = {
    "dilate": dilate,
    "erode": erode,
    "opening": opening,
    "closing": closing,
    "shell": shell,
    "thicken": thicken,
}


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    ensure_writable(arguments.output, SHAPE_FORMATS - {".xyz", ".pc"}, "a surface")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments)
    fields: list[GridField] = []

    def measure(part: Any, grid: Grid) -> GridField:
        fields.append(cast("GridField", compute(part, grid, arguments)))
        return fields[-1]

    options = {} if arguments.operation == "thicken" else {"measure": measure}
    with prefix_errors(arguments.shape):
        grid = grid_for(shape, arguments, max(abs(distance) for distance in arguments.distances))
        surface = OPERATIONS[arguments.operation](shape, *arguments.distances, domain=grid, **options)
    save(surface, arguments.output)
    if arguments.preview and fields:
        save_slices(fields[0], arguments.preview, shape, levels(arguments))
    elif arguments.preview:
        save_scene(surface, arguments.preview)
    summary = {
        "input": arguments.shape,
        "operation": arguments.operation,
        "distances": arguments.distances,
        "output": arguments.output,
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
        **({"field": describe(fields[0])} if fields else {}),
    }
    return summary, f"{arguments.output}: {arguments.operation}, closed surface of {surface.n_faces} faces"


def levels(arguments: Namespace) -> list[float]:
    """Where the first offsets lie: those of the distance to the shape itself."""
    inwards = arguments.operation in ("erode", "opening")
    return [-distance if inwards else distance for distance in arguments.distances]
