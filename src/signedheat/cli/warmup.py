"""``signedheat warmup``: compile everything now."""

from __future__ import annotations

import os
import time
import warnings
from argparse import Namespace
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from ..progress import Announcement
from .options import Summary, add_command
from .parts import compiled, kernel_runs, parallel
from .progress import ProgressBar


def add_to(commands: Any) -> None:
    """Declare the command."""
    add_command(
        commands,
        "warmup",
        run,
        help="compile everything now, instead of at its first use",
        description="Runs everything once on small shapes. What is compiled is kept in the folder that NUMBA_CACHE_DIR "
        "names, or else in the cache of the user; run it again after an update.",
    )


def run(arguments: Namespace) -> Summary:
    """Run everything once on small shapes, where the system allows one of each kind, in several processes."""
    begin, spent = time.perf_counter(), sum(os.times()[:4])
    with (
        ProgressBar(arguments.quiet or arguments.json) as progress,
        ProcessPoolExecutor(parallel.n_threads(), get_context("spawn")) as pool,
    ):
        jobs = [pool.submit(_job, name) for name in kernel_runs.JOBS]
        for number, job in enumerate(as_completed(jobs)):
            job.result()
            progress((number + 1) / len(jobs), "compile")
    seconds, cpu = time.perf_counter() - begin, sum(os.times()[:4]) - spent
    folder = str(compiled.cache_folder())
    summary = {"seconds": round(seconds, 2), "cpu_seconds": round(cpu, 2), "folder": folder}
    return summary, f"everything is compiled, in {seconds:.0f} s; kept in {folder}"


def _job(name: str) -> None:
    """Run one in a process of its own, which tells nothing."""
    Announcement.are_wanted = False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about shapes too small to say anything
        kernel_runs.JOBS[name]()
