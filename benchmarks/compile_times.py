"""Seconds of CPU time that compiling takes: by job of `signedheat warmup`, with an empty cache, and by kernel.

``python benchmarks/compile_times.py [JOB …]``; each job runs in a process of its own, with a cache of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile

MEASURE = """
import json, sys, time, warnings
import numba.core.event as event
import signedheat
from signedheat.cli.warmup import JOBS

stack, own = [], {}

class Timer(event.Listener):
    def on_start(self, e):
        stack.append([time.process_time(), 0.0])
    def on_end(self, e):
        begin, within = stack.pop()
        spent = time.process_time() - begin
        if stack:
            stack[-1][1] += spent
        function = e.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('signedheat.')}.{function.__qualname__}"
        old = own.get(name, (0, 0.0))
        own[name] = (old[0] + 1, old[1] + spent - within)

event.register("numba:compile", Timer())
warnings.simplefilter("ignore")
begin = time.process_time()
JOBS[sys.argv[1]]()
cold = time.process_time() - begin
print(json.dumps({"cold": cold, "kernels": own}))
"""


def measured(job: str) -> dict:
    """CPU seconds of a job with an empty cache, and number and own time of the specialisations of each kernel."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "NUMBA_NUM_THREADS": "1"}
        done = subprocess.run(
            [sys.executable, "-c", MEASURE, job], env=environment, stdout=subprocess.PIPE, text=True, check=True
        )
    return json.loads(done.stdout.splitlines()[-1])


def main(jobs: list[str]) -> None:
    """One table by job, one by kernel."""
    from signedheat.cli.warmup import JOBS

    kernels: dict[str, tuple[int, float]] = {}
    for job in jobs or list(JOBS):
        found = measured(job)
        total = sum(seconds for _, seconds in found["kernels"].values())
        print(f"{job:<28}{found['cold']:8.1f} s, compiling {total:6.1f} s, {len(found['kernels'])} kernels", flush=True)
        for name, (number, seconds) in found["kernels"].items():
            kernels[name] = max(kernels.get(name, (0, 0.0)), (number, seconds), key=lambda entry: entry[1])
    print(f"\nall kernels once: {sum(seconds for _, seconds in kernels.values()):.1f} s")
    for name, (number, seconds) in sorted(kernels.items(), key=lambda entry: -entry[1][1])[:40]:
        print(f"{seconds:7.2f} s  {number}×  {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
