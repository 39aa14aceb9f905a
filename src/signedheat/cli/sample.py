"""``signedheat sample``: points with distances and gradients, to learn from."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any, get_args

from ..extensions.sampling import WIDTHS, Layout, sample
from ..io import ensure_writable, read
from ..io.samples import SAMPLE_FORMATS
from .computing import check_grid_options, compute, describe, grid_for, prefix_errors
from .options import Parser, Summary, add_command, add_solid_options, fraction, not_negative, whole_number


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "sample",
        run=lambda arguments: run(parser, arguments),
        help="points with distances, to learn from",
        description="Points near a shape and around it, with exact signed distances and gradients: training data for "
        "networks that learn a distance.",
    )
    parser.usage = "%(prog)s SHAPE -o OUT.npz [options]"
    parser.add_argument(
        "shape", metavar="SHAPE", help="surface or oriented points: .stl .obj .ply .off .vtp .glb .xyz .pc"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="samples: .npz")
    parser.add_argument("-n", "--samples", type=whole_number(1), default=250_000, metavar="N", help="points (250000)")
    add_sampling_options(parser)
    add_solid_options(parser)


def add_sampling_options(parser: ArgumentParser) -> None:
    """Add the options that say where samples are taken and how they are kept."""
    group = parser.add_argument_group("samples")
    group.add_argument(
        "--near", type=fraction, default=0.8, metavar="S", help="share near the surface, from 0 to 1 (.8)"
    )
    group.add_argument(
        "--widths",
        type=not_negative,
        nargs="+",
        default=list(WIDTHS),
        metavar="W",
        help="standard deviations of the noise, over the radius of the shape; each gets the same share (.05 .0158)",
    )
    group.add_argument("--seed", type=whole_number(0), default=0, metavar="K", help="of the random numbers (0)")
    group.add_argument("--normalize", action="store_true", help="move and scale the shape into the unit sphere")
    group.add_argument(
        "--layout",
        choices=get_args(Layout),
        default="arrays",
        help="arrays: points, distances, gradients, …; deepsdf: pos and neg, single precision (arrays)",
    )


def run(parser: Parser, arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, sample, write."""
    check_grid_options(parser, arguments)
    ensure_writable(arguments.output, SAMPLE_FORMATS, "samples")
    shape = read(arguments.shape)
    with prefix_errors(arguments.shape):
        field = compute(shape, grid_for(shape, arguments), arguments)
        taken = sample(field, arguments.samples, near=arguments.near, widths=arguments.widths, seed=arguments.seed)
    (taken.normalized() if arguments.normalize else taken).save(arguments.output, arguments.layout)
    inside = float((taken.distances < 0).mean())
    figures = {
        "samples": len(taken.points),
        "near": int(taken.near.sum()),
        "inside_share": inside,
        "completed_share": float(taken.completed.mean()),
        "center": taken.center.tolist(),
        "radius": taken.radius,
    }
    summary = {"input": arguments.shape, "output": arguments.output, **figures, "field": describe(field)}
    text = f"{arguments.output}: {len(taken.points)} points, {figures['near']} near the surface, {inside:.1%} inside"
    return summary, text
