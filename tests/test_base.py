"""Small functions that all of the package uses."""

from __future__ import annotations

import copy
import subprocess
from dataclasses import dataclass

import numpy as np
import pytest

from signedheat.arrays import Frozen, LastUsed, ShortRepr, fingerprint, short
from signedheat.batches.inputs import _without_extension
from signedheat.batches.pool import duration
from signedheat.errors import MissingPackageError, SignedHeatError
from signedheat.jobs import command_for, part_of_work, report, reporting, run_cancellable, run_limited
from signedheat.memory import fitting_count, untouched_zeros
from signedheat.methods import LinearElements
from signedheat.packages import ensure_installed, missing_package, require
from signedheat.parallel import connected, in_chunks
from signedheat.shapes.foreign import is_pair, package_of, what_to_pass
from signedheat.shapes.inspection import inspect
from signedheat.shapes.transforms import concatenated, placed
from signedheat.surfaces.triangle_mesh import TriangleMesh
from signedheat.validation import coordinates, finite_number, numbers, shaped, used_bounds


def test_values_are_made_once_while_they_are_kept():
    squares = LastUsed[int, int]()
    values = squares(3, lambda: 9), squares(3, lambda: 0), squares(2, lambda: 4), squares(3, lambda: 0)
    assert values == (9, 9, 4, 0)


def test_fingerprints_tell_arrays_apart():
    assert fingerprint(np.zeros(3)) == fingerprint(np.zeros(3)) != fingerprint(np.ones(3))
    assert fingerprint(np.zeros(4)) != fingerprint(np.zeros((2, 2)))


def test_what_is_taken_for_a_shape():
    assert what_to_pass("part.stl") == 'pass sh.read("part.stl")'
    assert package_of([1, 2]) is None
    assert is_pair(([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    assert not is_pair(([0.0, 1], [0.0, 1]))


def test_copies_of_frozen_objects_stay_read_only():
    @dataclass(frozen=True)
    class Row(Frozen):
        values: np.ndarray

    row = Row(np.zeros(3))
    row.values.flags.writeable = False
    assert not copy.deepcopy(row).values.flags.writeable


def test_reports_count_defects():
    report = inspect(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 2, 3]]))
    assert (report.open_edges, report.inconsistent_edges, report.borders) == (4, 1, 1)


def test_jobs_return_their_results():
    assert run_cancellable(lambda: 6 * 7) == 42
    assert run_limited(lambda: 6 * 7, 10.0) == 42
    printed = subprocess.run(command_for("builtins:print", "a b"), capture_output=True, check=True).stdout
    assert printed.decode().strip() == "a b"


def test_bodies_are_joined_and_placed():
    body = np.eye(3), np.array([[0, 1, 2]])
    assert concatenated([body, body])[1].tolist() == [[0, 1, 2], [3, 4, 5]]
    vertices, faces = placed(body, np.vstack([np.diag([-1.0, 1, 1]), [5, 0, 0]]))
    assert vertices[0].tolist() == [4.0, 0.0, 0.0] and faces.tolist() == [[2, 1, 0]]


def test_linear_elements_on_a_line():
    hats = np.array([[[-1.0], [1.0]], [[-0.5], [0.5]]])
    line = LinearElements.of(np.array([[0, 1], [1, 2]]), np.array([1.0, 2.0]), hats, 3)
    assert line.slopes(np.array([0.0, 1.0, 4.0])).ravel().tolist() == [1.0, 1.5]
    assert line.masses.tolist() == [0.5, 1.5, 1.0]


def test_memory():
    assert untouched_zeros((2, 2), np.float32).tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert fitting_count(10**9, lambda n: 100 * n, 1e6) == 10000


def test_missing_packages_are_named():
    assert require("json", "examples").__name__ == "json"
    ensure_installed("json", "examples")
    with pytest.raises(MissingPackageError, match="examples need the package no_such_package, which is not installed"):
        require("no_such_package", "examples")
    assert str(missing_package("PIL", "pictures")).endswith(
        "the package PIL, which is not installed: pip install pillow"
    )


def test_chunks_are_put_together():
    sums, large = in_chunks(lambda x: (x.sum(axis=1), x > 1), np.array([[1.0, 2.0], [3.0, 0.0]]))
    assert sums.tolist() == [3.0, 3.0] and large.tolist() == [[False, True], [True, False]]


def test_an_address_without_a_scheduler_is_refused():
    with pytest.raises(SignedHeatError, match=r"no Dask scheduler answers at 'nobody' \(missing port number"):
        connected("nobody")


def test_progress_of_a_part():
    seen = []
    with reporting(lambda fraction, step: seen.append(fraction)):
        with part_of_work(0.5, 1.0):
            report(0.5, "halfway")
        report(0.5, "not back")
    assert seen == [0.75, 0.75, 1.0]


def test_short_texts():
    @dataclass(repr=False)
    class Heap(ShortRepr):
        height: float
        grains: np.ndarray

    assert repr(Heap(1 / 3, np.zeros((500, 3)))) == "Heap(height=0.3333, grains=500 × 3 numbers)"
    values = 0.1 + 0.2, np.array([1.0, 2.5]), np.arange(1000), (1, 2), {"a": 1 / 3}
    assert [short(value) for value in values] == ["0.3", "[1, 2.5]", "1000 numbers", "(1, 2)", "{a: 0.3333}"]


def test_numbers_become_arrays():
    assert numbers([[1, 2]], "points").tolist() == [[1.0, 2.0]]
    assert coordinates([[0, 0], [1, 1e-200]], "points").tolist() == [[0.0, 0.0], [1.0, 1e-200]]
    assert finite_number(2, "the distance", least=0) == 2.0
    assert used_bounds(np.array([[0.0, 1.0], [2.0, 0.0], [9.0, 9.0]]), np.array([0, 1, 0])).tolist() == [[0, 0], [2, 1]]


def test_values_have_the_shape_of_their_points():
    assert shaped(np.zeros((6, 4)), (2, 3)).shape == (2, 3, 4)
    assert shaped(np.ones((1, 4)), ()).tolist() == [1.0] * 4
    assert shaped(np.ones(1), ()) == 1.0 and np.ndim(shaped(np.ones(1), ())) == 0


def test_names_and_durations_of_batches():
    assert [_without_extension(name) for name in ("parts/a.stl", "..stl")] == ["parts/a", "..stl"]
    assert [duration(seconds) for seconds in (42.3, 400, 8000)] == ["42 s", "7 min", "2.2 h"]
