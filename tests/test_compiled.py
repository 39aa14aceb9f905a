"""Kernels: compiled and not, they say the same; and they may call one another."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from shapes import small_runs
from signedheat.compiled import compiled


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
