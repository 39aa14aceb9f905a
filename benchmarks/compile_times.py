"""Seconds of CPU time that compiling takes: by job of `signedheat warmup`, with an empty cache, and by kernel.

``python benchmarks/compile_times.py [JOB …]``; each job runs in a process of its own, with a cache of its own.
``python benchmarks/compile_times.py commands [NAME …]``: by command, its first use less its second; the status says
whether each keeps to `MOST`.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

MEASURE = """
import json, sys, time, warnings
import numba.core.event as event
import signedheat
from signedheat.cli.kernel_runs import JOBS

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


MOST = 20.0
"""Core-seconds that compiling may take in any one command."""
COMMANDS = {
    "demo": "demo -o demo",
    "volume, closed": "volume ball.stl -o phi.npz",
    "volume, broken": "volume duck.stl -o phi.npz",
    "offset, broken": "offset duck.stl 0.05 -o offset.stl",
    "sample": "sample ball.stl -o points.npz",
    "info": "info duck.stl",
    "info, closed": "info ball.stl",
    "watertight, closed": "watertight ball.stl -o whole.stl",
    "surface": "surface ball.stl curve.csv -o phi.ply",
    "close": "close ball.stl curve.csv -o curve.json",
    "tets": "volume ball.stl --tets -o phi.vtu",
}


def of_command(name: str) -> tuple[float, int]:
    """Core-seconds of the first use of a command beyond those of the second, and how many kernels were compiled."""
    from signedheat import samples

    with tempfile.TemporaryDirectory() as folder:
        samples.sphere(4).save(Path(folder, "ball.stl"))
        samples.broken_duck().save(Path(folder, "duck.stl"))
        Path(folder, "curve.csv").write_text("x,y,z\n1,0.1,0.2\n0,1,-0.1\n-1,0,0.3\n")
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = [usage.ru_utime + usage.ru_stime]
        for _ in range(3):
            command = [sys.executable, "-m", "signedheat", *COMMANDS[name].split(), "--quiet"]
            subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
            usage = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(usage.ru_utime + usage.ru_stime)
        first, *others = (after - before for before, after in pairwise(spent))
        return first - min(others), len(list(Path(folder, "signedheat").rglob("*.nbc")))


def commands(names: list[str]) -> bool:
    """A table by command; returns whether each keeps to `MOST`."""
    keep = True
    for name in names or COMMANDS:
        seconds, kernels = of_command(name)
        keep &= seconds <= MOST
        print(f"{name:<20}{seconds:6.1f} s, {kernels} kernels{'' if seconds <= MOST else ', too much'}", flush=True)
    return keep


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
    from signedheat.cli.kernel_runs import JOBS

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
    if sys.argv[1:2] == ["commands"]:
        sys.exit(not commands(sys.argv[2:]))
    main(sys.argv[1:])
