"""Kernels compiled by our own steps: the same values as with Numba's, and no array freed or kept by mistake."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc

import numba
import numpy as np
import pytest

from signedheat import compiled as compiled_module
from signedheat.compiled import Kernel, compiled


@compiled
def last_row(a):
    return a[len(a) - 1]


@compiled
def doubled(a):
    out = np.empty_like(a)
    for i in range(len(a)):
        out[i] = 2.0 * a[i]
    return out


@compiled
def first_larger(a, bound):
    for i in range(len(a)):
        if a[i] > bound:
            return i
    return -1


@compiled
def rows_doubled(a, bound):
    """Views, arrays made by other kernels, and numbers from kernels that borrow."""
    total, found = 0.0, 0
    for _ in range(3):
        row = doubled(last_row(a))
        found += first_larger(row, bound)
        total += row.sum()
    return total, found, row


@compiled
def comprehended(n):
    return [k * k for k in range(n)]


def test_values_are_those_of_plain_python():
    a = np.arange(12.0).reshape(3, 4)
    total, found, row = rows_doubled(a, 17.0)
    assert (total, found, row.tolist()) == (228.0, 3, [16.0, 18.0, 20.0, 22.0])
    assert comprehended(4) == [0, 1, 4, 9]


def test_views_that_are_returned_keep_their_array():
    a = np.arange(1e5).reshape(10, -1)
    expected = a[-1].copy()
    row = last_row(a)
    del a
    others = [np.ones(100_000) for _ in range(10)]  # would lie where the array was
    assert (row == expected).all()
    assert len(others) == 10


@pytest.mark.parametrize("call", [lambda a: rows_doubled(a, 1.0), last_row, lambda a: first_larger(a[0], 1e9)])
def test_calls_leave_no_references(call):
    a = np.ones((100, 1000))
    call(a)
    before = sys.getrefcount(a)
    tracemalloc.start()
    for _ in range(200):
        call(a)
    left, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert sys.getrefcount(a) == before
    assert left < 100_000


def test_arrays_made_by_kernels_are_freed():
    numba.core.runtime._nrt_python.memsys_enable_stats()
    stats = numba.core.runtime.rtsys.get_allocation_stats
    a = np.ones((4, 1000))
    rows_doubled(a, 1.0)
    before = stats()
    for _ in range(50):
        rows_doubled(a, 1.0)
    after = stats()
    made = after.alloc - before.alloc
    assert made >= 150
    assert made == after.free - before.free


def test_with_another_numba_its_own_steps_are_taken(monkeypatch):
    monkeypatch.setattr(compiled_module, "TRIED", ((0, 1), (0, 2)))
    total = Kernel(rows_doubled.function, {"error_model": "numpy"})(np.ones((2, 3)), 5.0)[0]
    assert total == 18.0
    monkeypatch.undo()
    assert rows_doubled(np.ones((2, 3)), 5.0)[0] == total


CALLERS = """
from signedheat.compiled import compiled

@compiled
def inner(a, k):
    return a[k] + 1.0

@compiled
def {outer}(a):
    return inner(a, 0) * {factor}

import numpy as np
print({outer}(np.array([2.0])))
"""


def test_what_one_process_has_linked_another_finds(tmp_path, monkeypatch):
    """The kernel that is called is found in the cache, by a caller that is not."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    printed = []
    for outer, factor in (("thrice", 3), ("fourfold", 4)):
        (tmp_path / "callers.py").write_text(CALLERS.format(outer=outer, factor=factor))
        done = subprocess.run(
            [sys.executable, "-c", "import callers"], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        printed.append(done.stdout.strip())
    assert printed == ["9.0", "12.0"]
    assert len(list((tmp_path / "cache" / "signedheat").glob("callers.inner-*.nbc"))) == 1


@compiled
def elements(a, flat, i, k):
    """Elements from the front and the end, parts, and what is written to them."""
    row = a[i]
    row[k] += 2.0
    a[-1, 0] = a[i, -2] - a[0][-1]
    flat[-1] = i
    flat[k] *= 3
    b = a[i, k:]
    return row[0] + row[-k], len(b), b[-1] > a[0, 0], flat[i - 3]


@compiled
def counted(a, n):
    """Ranges of one, two and three bounds, none, and within one another."""
    out = []
    for i in range(n):
        for j in range(i, 3):
            out.append(10 * i + j)
    for i in range(n, -n, -2):
        out.append(i)
    for _ in range(2, n - 5):
        out.append(99)
    for i in range(a[0]):
        a[0] = 7  # the bound was taken before
        out.append(i + 0)
    return out


@compiled
def arithmetic(x, y, m, n):
    return x + y * x - y, m * n - m + n, x < y, x != y, y == y, m <= n, m != n, m % n, m // n, 2 - m, 0.5 * m


@pytest.mark.parametrize("layout", ["C", "F", "every other", "a part of numbers"])
@pytest.mark.parametrize("kind", [float, np.float32, np.int32])
def test_elements_are_those_of_plain_python(layout, kind):
    found = []
    for run in (elements, elements.function):
        a = np.arange(24).reshape(4, 6).astype(kind)
        if layout == "every other":
            a = a[:, ::2]
        elif layout == "a part of numbers":
            a = (a + 1j).astype(complex).real
        else:
            a = np.array(a, order=layout)
        flat = np.arange(5)
        values = run(a, flat, 2, 1)
        found.append((*map(float, values), *a.ravel().tolist(), *flat.tolist()))
    assert found[0] == found[1]


@pytest.mark.parametrize("n", [-1, 0, 1, 3, 7])
@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8])
def test_loops_are_those_of_plain_python(n, kind):
    assert counted(np.array([3], kind), n) == counted.function(np.array([3], kind), n)


@pytest.mark.parametrize("x, y", [(1.5, -2.25), (np.nan, 1.0), (np.inf, np.inf), (-0.0, 0.0)])
@pytest.mark.parametrize("m, n", [(7, -3), (-7, 3), (4, 4)])
def test_arithmetic_is_that_of_plain_python(x, y, m, n):
    np.testing.assert_array_equal(arithmetic(x, y, m, n), arithmetic.function(x, y, m, n))
