"""``signedheat close``: broken curves on a surface in, whole ones out."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from ..constraints import ZeroSet
from ..io import CURVE_FORMATS, ensure_writable, read_curves, write_curves
from ..viewing import PICTURE_FORMATS
from .computing import naming
from .options import Summary, add_command, positive
from .progress import ProgressBar
from .surface import read_surface, surface_constraint


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "close",
        run=run,
        help="complete broken curves on a surface",
        description="The zero set of the signed distance to broken curves: closed, but for ends at the boundary of the "
        "surface.",
    )
    parser.add_argument(
        "mesh",
        metavar="MESH",
        help="surface, points or voxels: .obj .ply .stl .off .vtp .glb .pc .xyz .npy .nrrd .vti",
    )
    parser.add_argument("curves", metavar="CURVES", help="broken curves on it: .txt .obj .json .csv")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="completed curves: .txt .obj .json")
    parser.add_argument(
        "--constraint",
        type=surface_constraint,
        default=ZeroSet(),
        metavar="C",
        help="free, zero-set (default: the result passes through the curves), each-component, soft:WEIGHT",
    )
    parser.add_argument(
        "--diffusion", type=positive, default=1.0, metavar="T", help="larger values close gaps more roundly (1)"
    )
    parser.add_argument("--preview", metavar="PNG", help="draw the distance, with the completed curves")


def run(arguments: Namespace) -> Summary:
    """Read, check that the results can be written, complete, write."""
    ensure_writable(arguments.output, CURVE_FORMATS, "curves")
    if arguments.preview:
        ensure_writable(arguments.preview, PICTURE_FORMATS, "a picture")
    surface = read_surface(arguments.mesh)
    curves = read_curves(arguments.curves, surface)
    from ..solver import SignedHeatSolver

    with naming(arguments.curves), ProgressBar(arguments.quiet or arguments.json) as progress:
        field = SignedHeatSolver(surface, arguments.diffusion, progress).distance(curves, arguments.constraint)
        found = field.contour(0.0)
    write_curves(arguments.output, found, surface)
    if arguments.preview:
        from ..surface_pictures import save_surface

        save_surface(field, arguments.preview, found)
    closed = sum(curve.closed for curve in found)
    summary = {
        "mesh": arguments.mesh,
        "curves": arguments.curves,
        "output": arguments.output,
        "n_curves": len(found),
        "n_closed": closed,
    }
    return summary, f"{arguments.output}: {len(found)} curves, {closed} of them closed"
