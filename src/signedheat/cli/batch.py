"""``signedheat batch``: the same for many shapes."""

from __future__ import annotations

import sys
from argparse import Namespace

from ..batches.job import BatchJob, Sampling
from ..batches.manifest import Outcome
from ..batches.run import batch, duration
from ..errors import SourceError
from .computing import RESOLUTION, Summary, constraint_of
from .progress import ProgressBar
from .streams import say


def run(arguments: Namespace) -> Summary:
    """Do the job for every shape; a line on standard error for each that is not done."""
    with ProgressBar(arguments.quiet or arguments.json) as progress:

        def report(outcome: Outcome) -> None:
            if not outcome.is_done:
                progress.clear()
                say(f"signedheat: {outcome.input}: {outcome.state}: {outcome.message}")

        done = batch(
            listed(arguments.inputs),
            arguments.output,
            job_of(arguments),
            workers=arguments.workers,
            threads=arguments.threads,
            scheduler=arguments.scheduler,
            time_limit=arguments.time_limit,
            progress=progress,
            report=report,
        )
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
    return summary, f"{done.manifest}: {len(states)} shapes, {told}{before}, {duration(seconds)} of work"


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


def job_of(arguments: Namespace) -> BatchJob:
    """The job that the options ask for."""
    sampling = None
    if arguments.sample is not None:
        sampling = Sampling(
            n=arguments.sample,
            near=arguments.near,
            widths=tuple(arguments.widths),
            seed=arguments.seed,
            normalize=arguments.normalize,
            layout=arguments.layout,
        )
    spacing = None if arguments.spacing is None else tuple(arguments.spacing)
    return BatchJob(
        volume=f".{arguments.volume}" if arguments.volume else None,
        offsets=tuple(arguments.offset),
        surfaces=f".{arguments.surface}",
        samples=sampling,
        info=arguments.info,
        resolution=arguments.resolution or RESOLUTION,
        spacing=spacing[0] if spacing is not None and len(spacing) == 1 else spacing,
        padding=arguments.padding,
        band=arguments.band,
        constraint=constraint_of(arguments.constraint),
        diffusion=arguments.diffusion,
        as_oriented=arguments.as_oriented,
        keep_overlaps=arguments.keep_overlaps,
        plain=arguments.plain,
    )
