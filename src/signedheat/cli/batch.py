"""``signedheat batch``: the same for many shapes."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import signedheat as sh

from ..errors import SignedHeatError, SourceError
from .options import (
    MOST_WORKERS,
    Summary,
    add_command,
    add_many_options,
    add_method_options,
    add_room_options,
    add_sampling_options,
    add_step_options,
    check_grid_options,
    finite,
    whole_number,
)
from .parts import computing, pool
from .progress import ProgressBar
from .streams import say, tell


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "batch",
        run,
        check,
        help="the same for many shapes",
        description="Fields, offsets, samples and reports of many shapes, each in a process of its own, with a "
        "manifest of what came of each. What is done is skipped when the batch is started again.",
    )
    parser.usage = "%(prog)s FILE [FILE ...] -o FOLDER [--volume] [--offset D ...] [--sample] [--info] [options]"
    add_many_options(parser)
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
        "--sample", type=whole_number(1), nargs="?", const=250_000, metavar="N", help="points to learn from (250000)"
    )
    wanted.add_argument("--info", action="store_true", help="counts and defects, in the manifest")
    running = parser.add_argument_group("running")
    running.add_argument(
        "--threads", type=whole_number(1, MOST_WORKERS), default=1, metavar="N", help="threads of each process (1)"
    )
    running.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask cluster instead: tcp://host:port")
    add_sampling_options(parser)
    add_room_options(parser)
    add_step_options(parser)
    add_method_options(parser)
    parser.set_defaults(origin=None, grid_shape=None, mask=None)


def check(arguments: Namespace) -> None:
    """Reject what asks for nothing, and options that contradict each other."""
    check_grid_options(arguments)
    try:
        job_of(arguments)
    except SignedHeatError as problem:
        arguments.parser.error(str(problem))


def run(arguments: Namespace) -> Summary:
    """Do the job for every shape."""
    options = {"threads": arguments.threads, "scheduler": arguments.scheduler}
    done = made_of_each(arguments, job_of(arguments), **options)
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
    told = ", ".join(f"{number} {state}" for state, number in counts.items())
    before = f" ({done.skipped} of them before)" if done.skipped else ""
    return summary, f"{done.manifest}: {len(states)} shapes, {told}{before}, {pool.duration(seconds)} of work"


def made_of_each(
    arguments: Namespace,
    job: Callable[[Path, Path], Mapping[str, object]],
    in_words: Callable[[dict[str, object]], str] | None = None,
    **options: Any,
) -> sh.batches.Batch:
    """Do a job for every shape: a line on standard error for each that is not done, and perhaps one for each that is.

    Parameters
    ----------
    arguments : Namespace
        With those of `add_many_options`.
    job : callable
        As for `signedheat.batches.run`.
    in_words : callable, optional
        The line about a shape that is done, from its figures.
    **options
        Further ones of `signedheat.batches.run`.
    """
    with ProgressBar(arguments.quiet or arguments.json) as progress:

        def report(outcome: sh.batches.Outcome) -> None:
            if not outcome.is_done:
                progress.clear()
                say(f"signedheat: {outcome.input}: {outcome.state}: {outcome.message}")
            elif in_words is not None and not (arguments.quiet or arguments.json):
                progress.clear()
                tell(f"{outcome.outputs[0]}: {in_words(dict(outcome.figures))}")

        return sh.batches.run(
            listed(arguments.inputs),
            arguments.output,
            job,
            workers=arguments.workers,
            time_limit=arguments.time_limit,
            progress=progress,
            report=report,
            **options,
        )


def listed(inputs: list[str]) -> list[str]:
    """Inputs, with the lines of standard input in place of ``-``.

    Raises
    ------
    SourceError
        If standard input is asked for and has no lines.
    """
    if "-" not in inputs:
        return inputs
    lines = [line.rstrip("\r\n") for line in (sys.stdin or ()) if line.strip()]
    if not lines:
        raise SourceError("there is nothing on standard input", remedy="write a file name on each line", path="-")
    at = inputs.index("-")
    return [*inputs[:at], *lines, *(each for each in inputs[at + 1 :] if each != "-")]


def job_of(arguments: Namespace) -> sh.batches.Job:
    """The job that the options ask for."""
    sampling = None
    if arguments.sample is not None:
        sampling = sh.batches.Sampling(
            n=arguments.sample,
            near=arguments.near,
            widths=tuple(arguments.widths),
            seed=arguments.seed,
            normalize=arguments.normalize,
            layout=arguments.layout,
        )
    spacing = None if arguments.spacing is None else tuple(arguments.spacing)
    return sh.batches.Job(
        volume=f".{arguments.volume}" if arguments.volume else None,
        offsets=tuple(arguments.offset),
        surfaces=f".{arguments.surface}",
        samples=sampling,
        info=arguments.info,
        resolution=arguments.resolution or computing.RESOLUTION,
        spacing=spacing[0] if spacing is not None and len(spacing) == 1 else spacing,
        padding=arguments.padding,
        band=arguments.band,
        constraint=computing.constraint_of(arguments.constraint),
        diffusion=arguments.diffusion,
        as_oriented=arguments.as_oriented,
        keep_overlaps=arguments.keep_overlaps,
        plain=arguments.plain,
    )
