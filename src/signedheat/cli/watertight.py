"""``signedheat watertight``: the closed mesh of broken shapes, and the truth about it."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from .batch import made_of_each
from .options import Summary, add_command, add_many_options, positive, refuse_together, whole_number
from .parts import watertight


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
    add_many_options(parser)
    parser.add_argument("--thickness", type=positive, metavar="D", help="of the solids around sheets")
    parser.add_argument("--contour", action="store_true", help="contour everything: even triangles in place of few")
    parser.add_argument(
        "--resolution", type=whole_number(2), metavar="N", help="nodes along the longest side, for contours (256)"
    )
    parser.add_argument("--spacing", type=positive, metavar="H", help="cells of contours, in units of the file")


def check(arguments: Namespace) -> None:
    """Reject options that contradict each other."""
    refuse_together(arguments, "--spacing", "--resolution")


def run(arguments: Namespace) -> Summary:
    """Do it for every shape; a line for each."""
    job = watertight.Watertight(
        surfaces=f".{arguments.surface}",
        thickness=arguments.thickness,
        contoured=arguments.contour,
        resolution=arguments.resolution or 256,
        spacing=arguments.spacing,
    )
    done = made_of_each(arguments, job, watertight.in_words)
    summary = {
        "inputs": arguments.inputs,
        "manifest": str(done.manifest),
        "shapes": [{"output": each.outputs, **each.figures} for each in done.outcomes if each.is_done],
        "skipped": done.skipped,
        "failed": len(done.failures),
    }
    closed = len(done.outcomes) - len(done.failures)
    return summary, f"{done.manifest}: {closed} of {len(done.outcomes)} shapes closed"
