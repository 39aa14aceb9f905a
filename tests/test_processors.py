"""The same results on other processors: as many points, and values that differ by rounding."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from code_paths import code_paths
from shapes import small_runs

ROUNDING = 1e-12
"""How far values may differ, over the largest: 2^−53 by the condition of systems of so few unknowns, below 1e3."""


@pytest.mark.parametrize("name", ["AVX2, one maker", "SSE4.2"])
def test_the_same_on_other_code_paths(tmp_path, name):
    """What kernels compute has the same bits, so that they are not compiled again for the test."""
    variables = {key: value for key, value in code_paths()[name].items() if key != "NUMBA_CPU_NAME"}
    command = [sys.executable, "-m", "shapes.small_runs", str(tmp_path / "other.npz")]
    subprocess.run(command, check=True, cwd=Path(__file__).parents[1], env={**os.environ, **variables})
    with np.load(tmp_path / "other.npz") as other:
        for key, values in small_runs.runs().items():
            assert other[key].shape == values.shape, key
            np.testing.assert_allclose(
                other[key], values, rtol=0, atol=ROUNDING * np.nanmax(np.abs(values)), err_msg=key
            )
