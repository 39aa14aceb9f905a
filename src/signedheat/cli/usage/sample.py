"""``signedheat sample``: points with distances and gradients, to learn from."""

from __future__ import annotations

from argparse import ArgumentParser
from typing import Any

from .options import (
    add_command,
    add_placing_options,
    add_solid_options,
    check_grid_options,
    fraction,
    not_negative,
    whole_number,
)


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "sample",
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
    add_placing_options(parser)
    add_solid_options(parser)
    parser.set_defaults(check=check_grid_options)


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
        default=[0.05, 0.0158],
        metavar="W",
        help="standard deviations of the noise, over the radius of the shape; each gets the same share (.05 .0158)",
    )
    group.add_argument("--seed", type=whole_number(0), default=0, metavar="K", help="of the random numbers (0)")
    group.add_argument("--normalize", action="store_true", help="move and scale the shape into the unit sphere")
    group.add_argument(
        "--layout",
        choices=("arrays", "deepsdf"),
        default="arrays",
        help="arrays: points, distances, gradients, …; deepsdf: pos and neg, single precision (arrays)",
    )
