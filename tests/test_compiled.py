"""Kernels: compiled and not, they say the same; and they may call one another."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shapes import small_runs
from signedheat.compiled import compiled
from signedheat.jobs import Announcement


def test_the_same_values_without_compiling(tmp_path):
    """Python's own arithmetic, an oracle for indices out of range and integers that overflow as well."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    folder = Path(__file__).parents[1]
    command = [sys.executable, "-m", "shapes.small_runs", str(tmp_path / "plain.npz")]
    subprocess.run(command, check=True, cwd=folder, env=environment)
    with np.load(tmp_path / "plain.npz") as plain:
        for name, values in small_runs.runs().items():
            scale = np.nanmax(np.abs(values))
            tolerance = (1e-5 if "grid" in name else 1e-9) * scale  # grids hold directions in single precision
            np.testing.assert_allclose(plain[name], values, rtol=0, atol=tolerance, err_msg=name)


def test_kernels_call_kernels_and_themselves():
    @compiled
    def half(x):
        return x // 2

    @compiled
    def bits(x):
        if x == 0:
            return 0
        return 1 + bits(half(x))

    assert bits(1000) == 10
    assert bits.__name__ == "bits"


def test_a_number_written_in_a_kernel_needs_no_compilation_of_its_own():
    @compiled
    def half(x):
        return x // 2

    @compiled
    def quarters(x):
        return half(4) * half(half(x))

    assert quarters(12) == 6
    assert len(half.part.signatures) == 1


def test_compiling_is_announced_once_wherever_standard_error_goes(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment.pop("NUMBA_DISABLE_JIT", None)
    (tmp_path / "own.py").write_text(
        """from signedheat.compiled import compiled
@compiled
def one(x):
    return x
@compiled
def two(x):
    return one(x)
one(1), two(2)"""
    )
    for wanted in (1, 0):  # compiled, then read from the cache
        command = [sys.executable, tmp_path / "own.py"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stderr.count("signedheat: compiling what this needs") == wanted and done.stdout == ""


def test_what_compiles_in_the_processes_of_a_batch_is_announced_once(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    environment.pop("NUMBA_DISABLE_JIT", None)
    (tmp_path / "job.py").write_text(
        """from signedheat.compiled import compiled
@compiled
def one(x):
    return x
def run(file, beginning):
    return {"one": one(1)}"""
    )
    (tmp_path / "own.py").write_text(
        """import job
from signedheat import batches
print([outcome.state for outcome in batches.run(["a.obj", "b.obj"], "out", job.run, workers=2).outcomes])"""
    )
    for name in ("a.obj", "b.obj"):
        (tmp_path / name).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    command = [sys.executable, "own.py"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "['done', 'done']\n"
    assert done.stderr.count("signedheat: compiling what this needs") == 1


@pytest.mark.parametrize("fault", [OSError("no space is left"), BrokenPipeError(), ValueError("a closed file")])
def test_announcements_break_no_call_where_nobody_can_read_them(monkeypatch, fault):
    class Full(io.StringIO):
        def write(self, text):
            raise fault

    monkeypatch.setattr(sys, "stderr", Full())
    announce = Announcement("compiling", everywhere=True)
    monkeypatch.setattr(Announcement, "are_wanted", True)
    announce()
    assert announce.is_made


def test_kernels_are_compiled_once():
    """By `warmup`, all that Python calls; arrays that are read-only, or lie otherwise in memory, make no second."""
    code = """
import importlib, pkgutil, warnings
import signedheat
from signedheat import compiled
from signedheat.cli.kernel_runs import JOBS
warnings.simplefilter("ignore")
for job in JOBS.values():
    job()
ball = signedheat.samples.sphere(1)
two = signedheat.samples.union(ball, signedheat.samples.sphere(1, center=(1, 0, 0)))
signedheat.complete(two, seal=0.5)  # its vertices are read-only
modules = [entry.name for entry in pkgutil.walk_packages(signedheat.__path__, "signedheat.")]
values = {value for name in modules for value in vars(importlib.import_module(name)).values() if callable(value)}
kernels = {value for value in values if isinstance(value, compiled.Kernel)}
parts = {called for kernel in kernels for called in compiled._with_called(kernel) if called is not kernel}
for kernel in {*compiled.made} | kernels - parts:
    made = {vars(kernel).get("dispatcher"), vars(kernel).get("part")} - {None}
    print(f"{kernel.__module__}.{kernel.__name__}", sum(len(each.overloads) for each in made))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    counts = {name: int(count) for name, count in map(str.split, done.stdout.splitlines())}
    for name in ("_substitute", "_substitute_columns"):
        assert counts.pop(f"signedheat.linear.superlu.{name}") == 2  # for real and for complex numbers
    assert set(counts.values()) == {1}, counts
    assert len(counts) > 70


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signal to one process")
def test_ctrl_c_within_a_kernel_is_a_keyboard_interrupt():
    """Numba makes a SystemError of it; that of another process, so that this one is not stopped by a slip."""
    code = (
        "import os, signal, threading, numpy as np\n"
        "from signedheat.compiled import compiled\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "def busy(a, n):\n"
        "    b = np.zeros_like(a)\n"
        "    for k in range(n):\n"
        "        for i in range(len(a)):\n"
        "            b[i] += a[i] * k\n"
        "    return b\n"
        "busy = compiled(busy)\n"
        "a = np.ones(1000)\n"
        "busy(a, 2)\n"
        "for wait in (0.05, 0.06):\n"
        "    threading.Timer(wait, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
        "    try:\n"
        "        while True:\n"
        "            busy(a, 20_000)\n"
        "    except KeyboardInterrupt:\n"
        "        print('stopped')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["stopped", "stopped"], done.stderr
