"""What is free is found, and what cannot fit is refused with what would."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.lowering.grid.discretization import fitting_spacing, memory_estimate
from signedheat.memory import available_memory


def test_some_memory_is_free_but_not_more_than_there_is():
    import os

    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < available_memory() < installed


def test_a_limit_on_address_space_counts():
    """In a process of its own, which lowers its limit to 1 GB more than it holds."""
    code = """
import resource, signedheat as sh
from signedheat.memory import available_memory, _fields
held = 1024 * _fields("/proc/self/status")["VmSize"]
resource.setrlimit(resource.RLIMIT_AS, (held + 10**9, resource.RLIM_INFINITY))
assert 0.9e9 < available_memory() <= 1e9, available_memory()
try:
    sh.SignedHeatSolver(sh.Grid((0, 0, 0), 1.0, (400, 400, 400))).discretization
except sh.MemoryLimitError:
    print("refused")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "refused\n"


@pytest.mark.parametrize("shape", [(10_000, 10_000, 10_000), (20_000, 300, 70_000)])
def test_the_spacing_that_is_proposed_fits(shape):
    grid = sh.Grid((0, 0, 0), (0.1, 0.2, 0.1), shape)
    spacing = fitting_spacing(grid, 8_000_000_000)
    counts = np.floor((grid.upper - grid.origin) / spacing).astype(int) + 1
    fitting = memory_estimate(sh.Grid(grid.origin, spacing, counts))
    assert 0.9 * 8e9 < fitting <= 8e9
    with refused(sh.MemoryLimitError):
        _ = sh.SignedHeatSolver(grid).discretization
