"""``signedheat volume --tets``: signed distance on tets instead of a grid."""

from __future__ import annotations

import math
from argparse import Namespace
from typing import Any

from ..domains.grid import Grid
from ..domains.tet_mesh import TetMesh
from ..errors import GeometryError
from ..fields.grid_field import GridField
from ..fields.tet_field import TetField
from ..io import ensure_writable, read
from ..io.tets import TET_FIELD_FORMATS
from ..lowering.tets.discretization import memory_estimate
from ..memory import refuse_beyond_memory
from ..packages import require
from ..tets.tetrahedralize import tetrahedralize
from ..view import ensure_picture_writable, save_slices
from .computing import compute, describe, prefix_errors
from .options import Summary
from .placing import read_source

RESOLUTION = 32
PREVIEW_NODES = 64


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, write."""
    given = arguments.tets
    ensure_writable(arguments.output, TET_FIELD_FORMATS, "a field on tets")
    require("meshio", "fields on tets")
    if arguments.preview:
        ensure_picture_writable(arguments.preview)
    shape = read_source(arguments)
    mesh = read(given) if given else None
    if mesh is not None and not isinstance(mesh, TetMesh):
        raise GeometryError(
            f"{given} holds no tets, but a {type(mesh).__name__}", remedy="use a .mesh, .msh, .vtu or .ele file"
        )
    with prefix_errors(arguments.shape):
        if mesh is None:
            resolution = arguments.resolution or RESOLUTION
            mesh = tetrahedralize(shape, resolution=resolution, padding=arguments.padding)
            _refuse_beyond_memory(mesh.n_tets, resolution)
        field = compute(shape, mesh, arguments)
    field.save(arguments.output)
    if arguments.preview:
        save_slices(on_grid(field), arguments.preview, shape)
    summary: dict[str, Any] = {
        "input": arguments.shape,
        "output": arguments.output,
        **describe(field),
        "n_tets": mesh.n_tets,
    }
    text = f"{arguments.output}: {mesh.n_tets} tets, φ from {summary['minimum']:.4g} to {summary['maximum']:.4g}"
    return summary, text


def _refuse_beyond_memory(n_tets: int, resolution: int) -> None:
    """Raise `MemoryLimitError` if distance on a lattice will not fit, and tell the resolution at which it does.

    The number of tets grows at least with its square.
    """
    refuse_beyond_memory(
        f"distance on {n_tets:,} tets",
        n_tets,
        memory_estimate,
        lambda fitting: f"lower the resolution from {resolution} to {int(resolution * math.sqrt(fitting / n_tets))}",
    )


def on_grid(field: TetField) -> GridField:
    """The field at the nodes of a coarse grid around its mesh, for previews."""
    grid = Grid.around(field.mesh.bounds, resolution=PREVIEW_NODES, padding=0.0)
    return GridField(grid, field(grid.points.reshape(-1, 3)).reshape(grid.shape))
