"""Commands about many shapes: `batch` and `watertight`."""

from __future__ import annotations

import os
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import signedheat as sh

from ..errors import SignedHeatError, SourceError, counted, percent, printable
from ..jobs import MOST_THREADS
from .late_imports import files, inputs, pool, shape_files
from .late_imports import operands as shapes
from .options import (
    COMPLETION_STEPS,
    GRID_AROUND,
    LABEL,
    METHOD,
    SAMPLING,
    SCHEDULER,
    UNITS_OPTION,
    Summary,
    command,
    finite,
    group,
    is_given,
    is_quiet,
    option,
    output,
    positive,
    whole_number,
    workers,
)
from .terminal import ProgressBar, say, write_out

SURFACE_FILES = ("stl", "obj", "ply", "off", "vtp")
MANY_SHAPES = (
    option(
        "inputs",
        metavar="FILE",
        nargs="+",
        help="files, folders (searched recursively) or quoted patterns; - reads a list from standard input, one a line",
    ),
    option("--surface", choices=SURFACE_FILES, help="format of surfaces (stl)"),
    workers("processes (one for each processor)"),
    option("--time-limit", type=positive, metavar="S", help="seconds after which a shape is abandoned"),
)
"""Options that both commands on many shapes have."""
WANTED_RESULTS = group(
    "results for each shape, at least one of",
    option("--volume", nargs="?", const="npz", choices=("npz", "vti", "nrrd", "npy", "vdb"), help="the field (npz)"),
    option("--offset", type=finite, nargs="+", default=[], metavar="D", help="closed surfaces at distances"),
    option("--sample", type=whole_number(1), nargs="?", const=250_000, metavar="N", help="training points (250000)"),
    option("--info", action="store_true", help="counts and defects, in the manifest"),
)
RUNNING = group(
    "running",
    option("--threads", type=whole_number(1, MOST_THREADS), default=1, metavar="N", help="threads of each process (1)"),
    SCHEDULER,
)


def check_batch(arguments: Namespace) -> None:
    """Exit with an error if no results are asked for, they contradict each other, or options have no effect on them."""
    try:
        job_of(arguments)
    except SignedHeatError as problem:
        arguments.parser.error(str(problem))
    if not (arguments.volume or arguments.offset or arguments.sample):
        for option in (*GRID_AROUND.options, *COMPLETION_STEPS.options, *METHOD.options):
            if is_given(arguments, option.names[-1]):
                arguments.parser.error(f"{option.names[-1]} goes with --volume, --offset or --sample")


@command(
    "batch",
    "run one job on many shapes",
    "Fields, offsets, samples and reports of many shapes, each in a separate process, with a manifest of the outcomes. "
    "A batch that is started again skips the shapes that are done.",
    output("results, and manifest.jsonl", "FOLDER"),
    *(*MANY_SHAPES, WANTED_RESULTS, RUNNING, SAMPLING, GRID_AROUND, COMPLETION_STEPS, METHOD),
    check=check_batch,
    usage="FILE [FILE ...] -o FOLDER [--volume] [--offset D ...] [--sample] [--info] [options]",
)
def batch(arguments: Namespace) -> Summary:
    """Run the job that the options describe on every shape, and return the manifest and how many shapes are done."""
    options = {"threads": arguments.threads, "scheduler": arguments.scheduler}
    done = run_on_each(arguments, arguments.output, job_of(arguments), **options)
    states = [outcome.state for outcome in done.outcomes]
    counts = {state: states.count(state) for state in dict.fromkeys(states)}
    seconds = sum(outcome.seconds for outcome in done.outcomes)
    summary = {
        "inputs": arguments.inputs,
        "manifest": str(done.manifest),
        "shapes": len(done.outcomes),
        "states": counts,
        "skipped": done.skipped,
        "seconds": round(seconds, 3),
        "failed": len(done.failures),
    }
    by_state = ", ".join(f"{number} {state}" for state, number in counts.items())
    before = f" ({done.skipped} of them before)" if done.skipped else ""
    total = f"{counted(len(states), 'shape')}, {by_state}{before}, {pool.duration(seconds)} of work"
    return summary, f"{printable(str(done.manifest))}: {total}"


def names_file(output: str) -> bool:
    """Whether an output names a file of a shape rather than a folder."""
    is_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    return not is_folder and Path(output).suffix.lower() in shape_files.READERS


def check_watertight(arguments: Namespace) -> None:
    """Set ``--surface`` to the format in the name of an output file; exit with an error if another one is given."""
    if names_file(arguments.output):
        ending = Path(arguments.output).suffix.lower().lstrip(".")
        if ending not in SURFACE_FILES:
            formats = ", ".join(SURFACE_FILES)
            arguments.parser.error(f"closed meshes are written as {formats}: a folder named .{ending} ends with /")
        if arguments.surface not in (None, ending):
            arguments.parser.error(f"--surface {arguments.surface} and -o {arguments.output} do not go together")
        arguments.surface = ending


@command(
    "watertight",
    "closed meshes of broken shapes",
    "The closed mesh of each shape, and a line that says what it is: bodies, volume, what was completed, how far it is "
    "from the faces that were given, and back. Faces are kept where they bound the solid and join with its completion; "
    "elsewhere, and everywhere if a resolution or spacing is given, the surface is contoured with its edges and "
    "corners. Sheets are refused unless they are given a thickness.",
    output("a file for one shape; or a folder for the files of many, and manifest.jsonl"),
    *(*MANY_SHAPES, LABEL, UNITS_OPTION),
    option(
        "--seal",
        type=positive,
        metavar="D",
        help="make solid: fill what is reached from outside only through openings narrower than this",
    ),
    option("--smallest", type=positive, metavar="D", help="leave out loose parts whose box has a shorter diagonal"),
    option("--thickness", type=positive, metavar="D", help="thickness of solids around sheets"),
    option("--contour", action="store_true", help="contour everything, with even triangles instead of few"),
    option("--tolerance", type=positive, metavar="D", help="use fewer triangles, within this distance (manifold3d)"),
    option("--resolution", type=whole_number(2), metavar="N", help="contour with N nodes along the longest side (256)"),
    option("--spacing", type=positive, metavar="H", help="contour in cells of this size, in units of the file"),
    option(
        "--sample",
        type=whole_number(1),
        metavar="N",
        help="write N points of each kind, for trainers of generators: on the surface and on sharp edges with normals, "
        "in the volume and near both with distances",
    ),
    option("--normalize", action="store_true", help="move and scale the shape of the samples into the unit sphere"),
    check=check_watertight,
    usage="FILE [FILE ...] -o OUT [options]",
)
def watertight(arguments: Namespace) -> Summary:
    """Write the closed mesh of each shape to a file or a folder, and print a line about each."""
    job = sh.batches.Watertight(
        surfaces=f".{arguments.surface or 'stl'}",
        thickness=arguments.thickness,
        contoured=arguments.contour,
        tolerance=arguments.tolerance,
        resolution=arguments.resolution,
        spacing=arguments.spacing,
        seal=arguments.seal,
        smallest=arguments.smallest,
        samples=arguments.sample,
        normalize=arguments.normalize,
        label=arguments.label,
        units=arguments.units,
    )
    if names_file(arguments.output):
        return one_watertight(arguments, job)
    done = run_on_each(arguments, arguments.output, job, in_words)
    summary = {
        "inputs": arguments.inputs,
        "manifest": str(done.manifest),
        "shapes": [{"output": outcome.outputs, **outcome.figures} for outcome in done.outcomes if outcome.is_done],
        "skipped": done.skipped,
        "failed": len(done.failures),
    }
    closed = len(done.outcomes) - len(done.failures)
    return summary, f"{printable(str(done.manifest))}: {closed} of {counted(len(done.outcomes), 'shape')} closed"


def one_watertight(arguments: Namespace, job: sh.batches.Watertight) -> Summary:
    """Write the closed mesh of one shape to files that are named after the output."""
    target = Path(arguments.output)
    n_shapes = len(inputs.expand(listed(arguments.inputs)))
    if n_shapes != 1:
        arguments.parser.error(
            f"{counted(n_shapes, 'shape')} do not go into one file: name a folder, such as -o {target.stem}/"
        )
    sh.io.ensure_writable(target, {target.suffix.lower()}, "a surface")
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.stem}-") as folder:
        done = run_on_each(arguments, folder, job)
        (outcome,) = done.outcomes
        stem = Path(outcome.name).name
        written = []
        for output in outcome.outputs:
            path = target.with_name(target.stem + Path(output).name.removeprefix(stem))
            files.move_into_place(Path(folder, output), path)
            written.append(str(path))
    summary = {
        "inputs": arguments.inputs,
        "manifest": None,
        "shapes": [{"output": written, **outcome.figures}] if outcome.is_done else [],
        "skipped": 0,
        "failed": len(done.failures),
    }
    return summary, f"{target}: {in_words(dict(outcome.figures))}" if outcome.is_done else ""


def in_words(figures: dict[str, object]) -> str:
    """Return the figures of a closed mesh that `signedheat.batches.Watertight` returns as a line of text."""
    bodies, openings, crossings = (figures[key] for key in ("bodies", "openings", "self_intersections"))
    bad_edges = (
        f"{counted(int(str(figures['bad_edges'])), 'edge')} that two faces do not share, "
        if figures["bad_edges"]
        else ""
    )
    unit = "" if figures["units"] is None else f" {figures['units']}"
    volume = f"{figures['volume']:.4g}{unit}{'³' if unit else ''}"
    share = float(str(figures["completed_area"])) / max(float(str(figures["area"])), 1e-300)
    return (
        f"{bodies} {'body' if bodies == 1 else 'bodies'}, volume {volume}, {figures['faces']} faces, "
        f"{openings} {'opening' if openings == 1 else 'openings'} completed ({percent(share, 2)} of the area), "
        f"{_distances_in_words(figures['to_faces'], figures['from_faces'], unit)}"
        f"{bad_edges}{crossings or 'no'} self-intersections; {figures['way']}"
    )


def _distances_in_words(to_faces: Any, from_faces: Any, unit: str) -> str:
    """Return words for the largest distances from a surface to the faces that were given, and back, or None if none."""
    if from_faces is None:
        return ""
    if to_faces is None:
        return f"{from_faces:.2g}{unit} from the given faces to it at most, "
    return f"{to_faces:.2g}{unit} from the faces and {from_faces:.2g}{unit} back at most, "


def run_on_each(
    arguments: Namespace,
    folder: str,
    job: Callable[[Path, Path], Mapping[str, object]],
    line: Callable[[dict[str, object]], str] | None = None,
    **options: Any,
) -> sh.batches.Batch:
    """Run a job on every input with its results in a folder, and report shapes that fail on standard error.

    ``job(path, stem)`` writes files whose names begin with `stem`, and returns figures. If `line` is given,
    it returns a line to print for each shape that is done, from the figures of the job. `options` are further arguments
    of `signedheat.batches.run`.
    """
    with ProgressBar(is_quiet(arguments)) as progress:

        def report(outcome: sh.batches.Outcome) -> None:
            if not outcome.is_done:
                progress.clear()
                say(printable(f"signedheat: {outcome.input}: {outcome.state}: {outcome.message}"))
            elif line is not None and not is_quiet(arguments):
                progress.clear()
                write_out(printable(f"{outcome.outputs[0]}: {line(dict(outcome.figures))}"))

        return sh.batches.run(
            listed(arguments.inputs),
            folder,
            job,
            workers=arguments.workers,
            time_limit=arguments.time_limit,
            progress=progress,
            report=report,
            **options,
        )


def listed(inputs: list[str]) -> list[str]:
    """Return the names of inputs, with ``-`` replaced by the names on the lines of standard input."""
    if "-" not in inputs:
        return inputs
    lines = [line.rstrip("\r\n") for line in (sys.stdin or ()) if line.strip()]
    if not lines:
        raise SourceError("standard input is empty", remedy="write a file name on each line", path="-")
    position = inputs.index("-")
    return [*inputs[:position], *lines, *(name for name in inputs[position + 1 :] if name != "-")]


def job_of(arguments: Namespace) -> sh.batches.Job:
    """Return the job that the options of `batch` describe."""
    sampling = None
    if arguments.sample is not None:
        named = {name: getattr(arguments, name) for name in ("near", "seed", "normalize", "layout")}
        sampling = sh.batches.Sampling(n=arguments.sample, widths=tuple(arguments.widths), **named)
    same = ("info", "padding", "band", "diffusion", "as_oriented", "keep_overlaps", "lids", "nested", "plain")
    spacing = None if arguments.spacing is None else tuple(arguments.spacing)
    completing: Literal["none", "lids"] = "none" if arguments.unsigned else "lids"
    return sh.batches.Job(
        volume=f".{arguments.volume}" if arguments.volume else None,
        offsets=tuple(arguments.offset),
        surfaces=f".{arguments.surface or 'stl'}",
        samples=sampling,
        resolution=arguments.resolution or sh.batches.Job.resolution,
        spacing=spacing[0] if spacing is not None and len(spacing) == 1 else spacing,
        constraint=shapes.constraint_of(arguments.constraint),
        completion=completing,
        **{name: getattr(arguments, name) for name in same},
    )
