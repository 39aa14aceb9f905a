"""The command `warmup`, and the table of all commands, in the order of the help."""

from __future__ import annotations

import os
import subprocess
import time
import warnings
from argparse import Namespace
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

from ..errors import SignedHeatError
from ..jobs import Announcement, command_for
from .batch_commands import batch, watertight
from .curve_commands import close, surface
from .late_imports import compiled, kernel_runs, parallel
from .options import Command, Summary, command, is_quiet
from .solid_commands import (
    contour,
    cut,
    fill,
    intersect,
    morph,
    offset,
    sample,
    section,
    subtract,
    union,
    volume,
)
from .terminal import ProgressBar, say
from .view_commands import demo, deviation, info, thickness, view


@command(
    "warmup",
    "compile everything now, instead of at its first use",
    "Runs everything once on small shapes. What is compiled is kept in the folder that NUMBA_CACHE_DIR names, or else "
    "in the cache of the user; run it again after an update.",
)
def warmup(arguments: Namespace) -> Summary:
    """Run everything once on small shapes, in several processes."""
    begin, spent = time.perf_counter(), sum(os.times()[:4])
    with ProgressBar(is_quiet(arguments)) as progress, ThreadPoolExecutor(parallel.n_threads()) as pool:
        names = {pool.submit(_run_apart, name): name for name in kernel_runs.JOBS}
        waiting = set(names)
        try:
            while waiting:
                n_done = len(names) - len(waiting)
                progress(n_done / len(names), f"compiling, {n_done} of {len(names)} parts done")
                done, waiting = wait(waiting, 0.5, FIRST_COMPLETED)  # at most half a second, to show the progress
                for job in done:
                    job.result()
                    n_done += 1
                    if not is_quiet(arguments):
                        progress.clear()
                        say(f"signedheat: compiled {n_done} of {len(names)}: {names[job]}")
        finally:
            for job in waiting:
                job.cancel()
    seconds, cpu = time.perf_counter() - begin, sum(os.times()[:4]) - spent
    folder = str(compiled.cache_folder())
    summary = {"seconds": round(seconds, 2), "cpu_seconds": round(cpu, 2), "folder": folder}
    return summary, f"everything is compiled, in {seconds:.0f} s; kept in {folder}"


def _run_apart(name: str) -> None:
    """Run a job of `kernel_runs` in a process of its own, since compiling occupies only one processor of a process."""
    done = subprocess.run(command_for(f"{__name__}:run_job", name), stdin=subprocess.DEVNULL, capture_output=True)
    if done.returncode:
        lines = done.stderr.decode("utf-8", errors="replace").split("\n")
        cause = next((line for line in reversed(lines) if line.strip()), f"status {done.returncode}")
        raise SignedHeatError(f"{name} could not be compiled ({cause:.200})", remedy="install numba again")


def run_job(name: str) -> None:
    """Run a job of `kernel_runs` without announcements and warnings, as the main function of a process of `warmup`."""
    Announcement.are_wanted = False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the shapes are too small for warnings to mean anything
        kernel_runs.JOBS[name]()


COMMANDS: tuple[Command, ...] = (
    volume, surface, close, offset, watertight, fill, contour, morph, union, intersect, subtract, section, cut,
    sample, deviation, thickness, batch, info, view, demo, warmup,
)  # fmt: skip
