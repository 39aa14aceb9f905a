"""``signedheat deviation``: a scan beside a nominal part."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import signedheat as sh

from .options import Summary, add_command, positive
from .parts import computing, io, view
from .progress import ProgressBar


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "deviation",
        run,
        help="how far a scan is off a nominal part",
        description="Signed distances of a scan's points to a nominal part, positive outside of it: percentiles; the "
        "scan in colours, a picture with the histogram, or a table. Both must be in one place: nothing is aligned.",
    )
    parser.add_argument("scan", metavar="SCAN", help="mesh or points: .stl .obj .ply .off .vtp .glb .xyz .pcd")
    parser.add_argument("nominal", metavar="NOMINAL", help="the part as it should be, broken or not")
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="coloured .ply, picture .png .pdf .svg .jpg, or table .csv"
    )
    parser.add_argument("--tolerance", type=positive, metavar="T", help="say which share of the points is within it")


def run(arguments: Namespace) -> Summary:
    """Read, check that the result can be written, measure, write."""
    if arguments.output:
        io.ensure_writable(arguments.output, view.DEVIATION_FORMATS, "deviations")
    scan, nominal = io.read(arguments.scan), io.read(arguments.nominal)
    with computing.prefix_errors(arguments.nominal), ProgressBar(arguments.quiet or arguments.json) as progress:
        found = sh.deviation(scan, nominal, progress)
    summary: dict[str, Any] = {"scan": arguments.scan, "nominal": arguments.nominal, **found.figures}
    low, middle, high = found.percentiles((1, 50, 99))
    text = f"{arguments.scan}: {len(found.distances)} points, 98 % of them {low:.4g} to {high:.4g} off "
    text += f"{arguments.nominal}, median {middle:.4g}, root mean square {found.rms:.4g}"
    if arguments.tolerance is not None:
        share = found.within(arguments.tolerance)
        summary |= {"tolerance": arguments.tolerance, "within": share}
        text += f", {share:.2%} within {arguments.tolerance:g}"
    if arguments.output:
        found.save(arguments.output)
        summary["output"] = arguments.output
        text += f"; {arguments.output}"
    return summary, text
