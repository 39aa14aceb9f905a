"""``signedheat batch``: the same for many shapes."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .options import (
    MOST_WORKERS,
    add_command,
    add_method_options,
    add_room_options,
    add_step_options,
    finite,
    positive,
    whole_number,
)
from .sample import add_sampling_options


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "batch",
        help="the same for many shapes",
        description="Fields, offsets, samples and reports of many shapes, each in a process of its own, with a "
        "manifest of what came of each. What is done is skipped when the batch is started again.",
    )
    parser.usage = "%(prog)s INPUT [INPUT ...] -o FOLDER [--volume] [--offset D ...] [--sample] [--info] [options]"
    parser.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="+",
        help="files, folders with all in them, patterns in quotes; - takes a list from standard input, a line for each",
    )
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="results, and manifest.jsonl")
    wanted = parser.add_argument_group("what is made of each shape, one or more of")
    wanted.add_argument(
        "--volume",
        nargs="?",
        const="npz",
        choices=("npz", "vti", "nrrd", "npy", "vdb"),
        help="the field, as .npz if nothing is said",
    )
    wanted.add_argument(
        "--offset", type=finite, nargs="+", default=[], metavar="D", help="closed surfaces at distances"
    )
    wanted.add_argument(
        "--surface", choices=("stl", "obj", "ply", "off", "vtp"), default="stl", help="their files (stl)"
    )
    wanted.add_argument(
        "--sample", type=whole_number(1), nargs="?", const=250_000, metavar="N", help="points to learn from (250000)"
    )
    wanted.add_argument("--info", action="store_true", help="counts and defects, in the manifest")
    running = parser.add_argument_group("running")
    running.add_argument(
        "--workers", type=whole_number(1, MOST_WORKERS), metavar="N", help="processes (one for each processor)"
    )
    running.add_argument(
        "--threads", type=whole_number(1, MOST_WORKERS), default=1, metavar="N", help="threads of each process (1)"
    )
    running.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask cluster instead: tcp://host:port")
    running.add_argument("--time-limit", type=positive, metavar="S", help="seconds after which a shape is given up")
    add_sampling_options(parser)
    add_room_options(parser)
    add_step_options(parser)
    add_method_options(parser)
    parser.set_defaults(check=check)


def check(arguments: Namespace) -> None:
    """Reject what asks for nothing, and options that contradict each other."""
    error = arguments.parser.error
    if not (arguments.volume or arguments.offset or arguments.sample or arguments.info):
        error("say what is to be made: --volume, --offset D, --sample or --info")
    if arguments.plain and arguments.sample:
        error("--plain does not go with --sample, whose distances are those to the shape itself")
    if arguments.spacing is not None and len(arguments.spacing) not in (1, 3):
        error(f"argument --spacing: one number or 3, not {len(arguments.spacing)}")
    if arguments.spacing is not None and arguments.resolution is not None:
        error("--resolution does not go with --spacing: give one of them")
    if arguments.band is not None:
        if arguments.plain:
            error("--band does not go with --plain")
        if arguments.volume not in (None, "npz", "vdb"):
            error("a band is written as .npz or .vdb")
        reach = max((abs(distance) for distance in arguments.offset), default=0.0)
        if reach > arguments.band:
            error(f"the band reaches to {arguments.band:g}, and the distances to {reach:g}")
    if arguments.scheduler is not None and arguments.workers is not None:
        error("--workers does not go with --scheduler, which has workers of its own")
