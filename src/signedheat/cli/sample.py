"""``signedheat sample``: points with distances and gradients, to learn from."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import (
    Summary,
    add_command,
    add_format_option,
    add_placing_options,
    add_sampling_options,
    add_shape,
    add_solid_options,
    check_grid_options,
    whole_number,
)
from .parts import computing, io, placing


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "sample",
        run,
        check_grid_options,
        help="points with distances, to learn from",
        description="Points near a shape and around it, with exact signed distances and gradients: training data for "
        "networks that learn a distance.",
    )
    parser.usage = "%(prog)s SHAPE -o OUT.npz [options]"
    add_shape(parser)
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="samples: .npz")
    parser.add_argument("-n", "--samples", type=whole_number(1), default=250_000, metavar="N", help="points (250000)")
    add_sampling_options(parser)
    add_placing_options(parser)
    add_solid_options(parser)
    add_format_option(parser, "npz")


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, compute, sample, write."""
    io.ensure_writable(arguments.output, io.SAMPLE_FORMATS, "samples")
    shape = placing.read_source(arguments)
    with computing.prefix_errors(arguments.shape):
        field = computing.compute(shape, computing.grid_for(shape, arguments), arguments)
        taken = sh.sample(field, arguments.samples, near=arguments.near, widths=arguments.widths, seed=arguments.seed)
    (taken.normalized() if arguments.normalize else taken).save(arguments.output, arguments.layout)
    figures = taken.figures
    summary = {"input": arguments.shape, "output": arguments.output, **figures, "field": computing.describe(field)}
    inside = figures["inside_share"]
    text = f"{arguments.output}: {len(taken.points)} points, {figures['near']} near the surface, {inside:.1%} inside"
    return summary, text
