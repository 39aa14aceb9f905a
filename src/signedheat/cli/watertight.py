"""``signedheat watertight``: the closed mesh of broken shapes, and the truth about it."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import MOST_WORKERS, Summary, add_command, positive, refuse_together, whole_number
from .parts import watertight
from .progress import ProgressBar
from .streams import say, tell


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "watertight",
        run,
        check,
        help="closed meshes of broken shapes",
        description="The closed mesh of each shape, and a line that says what it is: bodies, volume, what was "
        "completed, how far it is from the faces that were given, and back. Faces are kept where they bound the solid "
        "and join with its completion; otherwise the surface is contoured with its edges and corners. Sheets are "
        "refused unless they are given a thickness.",
    )
    parser.add_argument("inputs", metavar="FILE", nargs="+", help="files, folders with all in them, patterns in quotes")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="meshes, and manifest.jsonl")
    parser.add_argument("--surface", choices=("stl", "obj", "ply", "off", "vtp"), default="stl", help="files (stl)")
    parser.add_argument("--thickness", type=positive, metavar="D", help="of the solids around sheets")
    parser.add_argument("--contour", action="store_true", help="contour everything: even triangles in place of few")
    parser.add_argument(
        "--resolution", type=whole_number(2), metavar="N", help="nodes along the longest side, for contours (256)"
    )
    parser.add_argument("--spacing", type=positive, metavar="H", help="cells of contours, in units of the file")
    parser.add_argument(
        "--workers", type=whole_number(1, MOST_WORKERS), metavar="N", help="processes (one for each processor)"
    )
    parser.add_argument("--time-limit", type=positive, metavar="S", help="seconds after which a shape is given up")


def check(arguments: Namespace) -> None:
    """Reject options that contradict each other."""
    refuse_together(arguments, "--spacing", "--resolution")


def run(arguments: Namespace) -> Summary:
    """Do it for every shape; a line for each."""
    with ProgressBar(arguments.quiet or arguments.json) as progress:

        def report(outcome: sh.batches.Outcome) -> None:
            progress.clear()
            if not outcome.is_done:
                say(f"signedheat: {outcome.input}: {outcome.state}: {outcome.message}")
            elif not (arguments.quiet or arguments.json):
                tell(f"{outcome.outputs[0]}: {watertight.in_words(dict(outcome.figures))}")

        done = sh.batches.run(
            arguments.inputs,
            arguments.output,
            watertight.Watertight(
                surfaces=f".{arguments.surface}",
                thickness=arguments.thickness,
                contoured=arguments.contour,
                resolution=arguments.resolution or 256,
                spacing=arguments.spacing,
            ),
            workers=arguments.workers,
            time_limit=arguments.time_limit,
            progress=progress,
            report=report,
        )
    summary = {
        "inputs": arguments.inputs,
        "manifest": str(done.manifest),
        "shapes": [{"output": each.outputs, **each.figures} for each in done.outcomes if each.is_done],
        "skipped": done.skipped,
        "failed": len(done.failures),
    }
    closed = len(done.outcomes) - len(done.failures)
    return summary, f"{done.manifest}: {closed} of {len(done.outcomes)} shapes closed"
