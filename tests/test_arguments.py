"""Words, numbers and functions that are given as arguments: refused by name where they are not what they must be."""

from __future__ import annotations

import inspect
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import batches, samples
from signedheat.errors import GeometryError, SignedHeatError, UnsupportedTypeError

BALL = samples.sphere(1)
GRID = sh.Grid((-1.5,) * 3, 0.5, (7, 7, 7))
PLANE = sh.Grid((-1, -1), 0.25, (13, 13))
LINE = sh.Polyline([[0, 0], [1, 0], [1, 1]], closed=True)
CURVE = BALL.path([0, 9, 20])
SOLID = sh.complete(BALL)
TETS = sh.tetrahedralize(BALL, resolution=3)
FIELDS = {
    "grid": sh.SignedHeatSolver(GRID).distance(BALL),
    "exact": sh.signed_distance(BALL, GRID),
    "plane": sh.signed_distance(LINE, PLANE),
    "surface": sh.SignedHeatSolver(BALL).distance(CURVE),
    "tets": sh.SignedHeatSolver(TETS).distance(BALL),
}

WORDS = {
    "nested": [partial(sh.orientation, BALL), partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID)],
    "lids": [partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID)],
    "completion": [partial(sh.complete, BALL), partial(sh.signed_distance, BALL, GRID)],
    "corners": [partial(sh.offset, BALL, 0.1), partial(SOLID.offset, 0.1)],
    "side": [partial(sh.morphology.thicken, BALL, 0.1)],
    "fill": [partial(sh.signed_distance, LINE, PLANE)],
    "intrinsic": [partial(sh.SignedHeatSolver, BALL), partial(sh.signed_distance, CURVE, BALL)],
    "layout": [partial(sh.sample_distances(BALL, 10).save, "a.npz")],
}
"""Calls that take one of some words."""


@pytest.mark.parametrize("name", WORDS)
@pytest.mark.parametrize(
    "word",
    ["abc", "", "Round", None, 3.0, b"round", ["round"], {}, np.zeros(3), np.zeros(2, "f8,f8"), np.nan],
    ids=repr,
)
def test_words(name, word):
    for call in WORDS[name]:
        with refused(SignedHeatError, element=name):
            call(**{name: word})


REPORTING = {
    "volume": partial(sh.signed_distance, BALL, GRID),
    "curves": partial(sh.signed_distance, CURVE, BALL),
    "plane": partial(sh.signed_distance, LINE, PLANE),
    "complete": partial(sh.complete, BALL),
    "piecewise": partial(sh.piecewise_distance, CURVE, BALL),
    **{f"sharpen {name}": partial(sh.sharpen, field) for name, field in FIELDS.items() if name != "plane"},
    "solver": lambda progress: sh.SignedHeatSolver(BALL, progress=progress).distance(CURVE),
    "deviation": partial(sh.deviation, BALL, BALL),
    "offset": partial(sh.offset, BALL, 0.1, resolution=8),
    "of solid": partial(SOLID.offset, 0.1, resolution=8),
    "field": partial(SOLID.field, 8),
    "band": partial(SOLID.field, 40, band=0.1),
    "surface": SOLID.surface,
    "intrinsic": partial(sh.intrinsic_delaunay, BALL),
}


@pytest.mark.filterwarnings("ignore:the region depends")  # the open curve closes by a guess
@pytest.mark.parametrize("name", REPORTING)
def test_progress_is_called_or_refused(name):
    seen = []
    REPORTING[name](progress=lambda fraction, step: seen.append(fraction))
    assert seen and min(seen) >= 0.0 and seen[-1] == max(seen) == 1.0, seen
    for odd in ("x", 3, [print], np.zeros(3), True, lambda: None, lambda fraction: None):
        with refused(UnsupportedTypeError, element="progress"):
            REPORTING[name](progress=odd)


def test_all_public_functions_with_progress_are_tested():
    """Except batches, whose progress has other arguments."""
    taking = {name for name in sh.__all__ if callable(getattr(sh, name)) and not inspect.isclass(getattr(sh, name))}
    taking = {name for name in taking if "progress" in inspect.signature(getattr(sh, name)).parameters}
    called = {each.func.__name__ for each in REPORTING.values() if isinstance(each, partial)}
    assert taking <= called


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, np.float32("nan"), 10**400], ids=lambda n: f"{n!r:.9}")
def test_numbers_that_fields_are_combined_with_are_finite(name, number):
    field = FIELDS[name]
    operations = [
        lambda: field + number, lambda: number + field, lambda: field - number, lambda: number - field,
        lambda: field * number, lambda: number * field, lambda: field / number,
    ]  # fmt: skip
    for operation in operations:
        with refused(SignedHeatError):
            operation()


def test_fields_are_not_divided_by_zero():
    for field in FIELDS.values():
        with refused(SignedHeatError):
            _ = field / 0


@pytest.mark.parametrize("domain", [b"x", None, 3, object(), {}, np.nan])
def test_solvers_refuse_at_once_what_is_no_domain(domain):
    with refused(SignedHeatError):
        sh.SignedHeatSolver(domain)


@pytest.mark.parametrize("space", [np.nan, 3, b"left", ["left"]], ids=repr)
def test_spaces_of_images_are_names(space):
    with refused(GeometryError, element="space"):
        sh.io.LabelImage(np.zeros((2, 2, 2)), np.eye(3), np.zeros(3), space)


def test_batches_refuse_what_cannot_be_called(tmp_path):
    with refused(UnsupportedTypeError, element="progress"):
        batches.run(tmp_path, tmp_path / "out", batches.Job(volume=".npz", resolution=8), progress="x")


GONE = """
import os, sys, tempfile
import signedheat as sh
from signedheat import batches, samples
ball = samples.sphere(1)
ball.save(sys.argv[1])
folder = tempfile.mkdtemp()
os.chdir(folder)
os.rmdir(folder)
sh.read(sys.argv[1])
for call in (
    lambda: sh.read("a.stl"),
    lambda: ball.save("a.stl"),
    lambda: sh.complete(ball).field(20, band=0.1, store="tiles"),
    lambda: batches.run("in", "out", batches.Job(volume=".npz", resolution=8)),
):
    try:
        call()
    except sh.errors.FileFormatError as error:
        print("deleted" in error.cause and error.path is not None)
"""


def test_a_working_folder_that_was_deleted_is_named(tmp_path):
    done = subprocess.run([sys.executable, "-c", GONE, str(tmp_path / "a.stl")], capture_output=True, text=True)
    assert done.stdout.split() == ["True"] * 4, done
