"""A process that has made a thousand solvers, grids and fields holds the memory with which it began."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

import signedheat as sh
from signedheat import linear, samples
from signedheat.linear import available_backends, factorize

READS_PROC = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")
LOOP = """
import gc, json, sys, numpy as np, signedheat as sh
from pathlib import Path
from shapes.tet_cases import boxes
from signedheat import samples

ball = samples.sphere(1)
ring = ball.level_set(ball.vertices[:, 2], 0.1)
box, inside = boxes((2, 2, 2), 1.0), sh.TriangleMesh(0.4 * ball.vertices + 1, ball.faces)

def held():
    gc.collect()
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

def once(k):
    mesh = sh.TriangleMesh(ball.vertices * (1 + k), ball.faces)
    solver = sh.SignedHeatSolver(mesh)
    for constraint in (None, sh.constraints.Free()):
        field = solver.distance(ring, constraint)
    if k % 4 == 0:
        sh.sharpen(field)
        sh.SignedHeatSolver(sh.Grid((-2, -2, -2), 0.5, (8, 8, 8))).distance(ball)
    if k % 8 == 1:
        sh.SignedHeatSolver(sh.Grid((-2, -2, -2), 0.5, (8, 8, 8))).distance(ball)
    if k % 8 == 2:
        sh.SignedHeatSolver(box).distance(inside)
    if k % 8 == 3:
        sh.SignedHeatSolver(sh.intrinsic_delaunay(mesh)).distance(ring)

def run(first, last):
    for k in range(first, last):
        once(k)
    return held()

first, last = map(int, sys.argv[1:])
print(json.dumps([run(0, first), run(first, last)]))
"""


def grown(first: int, last: int) -> int:
    """Bytes by which a process grows from the solver `first` to the solver `last`."""
    call = [sys.executable, "-c", LOOP, str(first), str(last)]
    done = subprocess.run(call, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1])
    before, after = json.loads(done.stdout)
    return int(after - before)


@READS_PROC
def test_many_solvers_grids_and_fields_leave_nothing():
    """50 solvers with two fields each, 40 grids and other domains, after 60 that fill what is kept on purpose."""
    assert grown(60, 110) < 4_000_000  # 50 kB a solver; one that is kept takes 400


@pytest.mark.slow
@READS_PROC
def test_a_thousand_solvers_grids_and_fields_leave_nothing():
    """The next thousand leave no more than those before them: what they leave does not grow with their number."""
    assert grown(500, 1500) < 8_000_000


@pytest.mark.parametrize("backend", available_backends())
def test_factors_are_freed_with_what_holds_them(backend):
    factor = factorize(sparse.identity(50, format="csr") * 2.0, backend=backend)
    gone = weakref.ref(factor)
    finalizer = getattr(getattr(factor, "_analysis", factor), "_finalizer", None)
    del factor
    gc.collect()
    assert gone() is None and (finalizer is None or not finalizer.alive)


def test_factors_are_freed_with_their_solver(monkeypatch):
    made = []

    def watched(*arguments, **options):
        factor = linear.factorize(*arguments, **options)
        made.append(weakref.ref(factor))
        return factor

    for module in ("linear.direct_integration", "surfaces.surface_discretization", "surfaces.vector_heat"):
        monkeypatch.setattr(f"signedheat.{module}.factorize", watched)
    ball = samples.sphere(1)
    solver = sh.SignedHeatSolver(ball)
    for source in (ball.level_set(ball.vertices[:, 2], 0.1), ball.points_at(0)):
        for constraint in (None, sh.constraints.Free(), sh.constraints.Soft(1.0)):
            assert np.isfinite(solver.distance(source, constraint).values).all()
    assert 3 <= sum(reference() is not None for reference in made) < len(made)  # the last of each kind is kept
    del solver
    gc.collect()
    assert [reference for reference in made if reference() is not None] == []
