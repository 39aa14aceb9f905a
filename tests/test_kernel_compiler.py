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


@compiled
def arrays_of(n, m, x):
    a = np.empty(n)
    a[:] = x
    b = np.zeros((n, m), dtype=np.int32)
    c = np.full((n, m), -1)
    d = np.ones((2, n, m), dtype=bool)
    e = np.full(shape=n, fill_value=x, dtype=np.float32)
    return a, b, c, d, e, np.zeros(n, np.uint8)


@pytest.mark.parametrize("n, m", [(3, 4), (1, 0), (0, 2)])
def test_arrays_are_made_as_numpy_makes_them(n, m):
    for ours, theirs in zip(arrays_of(n, m, 0.5), arrays_of.function(n, m, 0.5), strict=True):
        assert (ours.dtype, ours.shape, ours.flags.c_contiguous) == (theirs.dtype, theirs.shape, True)
        assert ours.strides == theirs.strides or not ours.size
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("n, m", [(-1, 4), (3, -1), (1 << 31, 1 << 32)])
def test_sizes_that_are_none_are_refused(n, m):
    @compiled
    def made(n, m):
        return np.empty((n, m))

    with pytest.raises((ValueError, MemoryError)):
        made(n, m)


@compiled
def extremes(a, b, c, n):
    return min(a, b), max(a, b), min(a, b, c), max(a, b, c), min(max(n, 0), 7), max(n, a)


@pytest.mark.parametrize("n", [-3, 5, 11])
def test_extremes_are_those_of_python(n):
    nan = float("nan")
    for a, b, c in [(1.0, 2.0, 0.5), (nan, 1.0, 2.0), (1.0, nan, 2.0), (1.0, 2.0, nan), (-0.0, 0.0, -0.0)]:
        ours, theirs = extremes(a, b, c, n), extremes.function(a, b, c, n)
        assert [repr(float(one)) for one in ours[:5]] == [repr(float(one)) for one in theirs[:5]]
    assert extremes(1.0, 2.0, 3.0, n)[5] == max(n, 1.0)


@compiled(nogil=True)
def taken(a, n, x, is_wanted):
    """What a kernel takes and returns: arrays in any order, numbers, its own arguments."""
    if n < 0:
        raise ValueError("negative")
    return (a.sum() + n) * x if is_wanted else x, n, is_wanted, a, np.zeros(n), a[1:]


def test_arguments_and_results():
    whole = np.arange(24.0).reshape(2, 3, 4)
    for a in (whole[:, 0], whole[:, :, 1], whole[0].T):
        for is_wanted in (True, np.bool_(False)):
            value, n, told, same, made, part = taken(a, np.int64(2), 0.5, is_wanted)
            assert (value, n, told) == ((a.sum() + 2) * 0.5 if is_wanted else 0.5, 2, bool(is_wanted))
            assert same is a and made.tolist() == [0.0, 0.0] and np.shares_memory(part, a)
            assert made.flags.writeable and made.flags.owndata is False and part.tolist() == a[1:].tolist()
    fixed = whole[0].copy()
    fixed.setflags(write=False)
    assert not taken(fixed, 0, 1.0, True)[5].flags.writeable
    with pytest.raises(ValueError, match="negative"):
        taken(whole[0], -1, 1.0, True)
    with pytest.raises(TypeError):
        taken(whole[0], 1, 1.0)


def test_neither_arguments_nor_results_nor_errors_are_kept():
    a, counts = np.ones((3, 4)), []
    for _ in range(2):
        for _ in range(1000):
            taken(a, 3, 1.0, True)
            with pytest.raises(ValueError):
                taken(a, -1, 1.0, True)
        counts.append([sys.getrefcount(one) for one in (a, a.dtype, np.dtype(float), ValueError)])
    assert all(later <= first + 10 for first, later in zip(*counts, strict=True))


@compiled
def parts(a, flat, i, j):
    """Slices with any bounds, of any axes, and of slices."""
    rows, column, row = a[i:j], a[i:j, 1], a[-1, i:]
    middle = flat[i:j][1:]
    return (
        rows.shape,
        rows.sum(),
        column.sum(),
        row.sum(),
        len(middle),
        middle.sum(),
        flat[:j].sum(),
        flat[i:].sum(),
        rows,
    )


@pytest.mark.parametrize("i, j", [(0, 2), (1, 4), (-3, -1), (2, 1), (-9, 9), (5, 7), (0, -9)])
@pytest.mark.parametrize("layout", ["C", "F", "every other"])
def test_parts_are_those_of_plain_python(i, j, layout):
    a = np.arange(24.0).reshape(4, 6)
    a, flat = (a[:, ::2], np.arange(14)[::2]) if layout == "every other" else (np.array(a, order=layout), np.arange(7))
    for ours, theirs in zip(parts(a, flat, i, j), parts.function(a, flat, i, j), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@compiled
def divided(m, x):
    return m // 3, m % 3, m // 8, m % 8, m // 1, m % 1, x**2, m ^ 5


@pytest.mark.parametrize("m", [-17, -16, -3, -1, 0, 2, 8, 23])
@pytest.mark.parametrize("x", [-1.7, 1e-200, 3e100])
def test_quotients_and_squares_are_those_of_plain_python(m, x):
    assert divided(m, x) == divided.function(m, x)


@compiled
def stepped(a, b, step):
    """Ranges upwards and downwards, and elements at their numbers and beside them."""
    out, last = [0 * step], -1
    for i in range(a, b, step):
        last = i
        out.append(i)
    for i in range(3, -1, -1):
        out.append(i - last)
    values = np.arange(5)
    for i in range(2):
        out.append(values[i - 1] + values[i + 1] + values[-1 - i])
        last = i * 2
    count = 0
    for i in range(-2, 2):
        out.append(values[i])
        count += 1
    return out, last, values[count]


@pytest.mark.parametrize("a, b, step", [(0, 7, 2), (7, 0, -3), (-4, 4, 3), (3, 3, 1), (5, 2, 1)])
def test_ranges_are_those_of_plain_python(a, b, step):
    assert stepped(a, b, step) == stepped.function(a, b, step)


@compiled
def wandering(a, n):
    """Variables that are assigned once, in one branch, in a loop, before a break, or several times."""
    total, kept = 0.0, a
    for i in range(n):
        if i % 3 == 0:
            made = doubled(a)
            if made[0] > 50.0:
                break
            kept = made
            continue
        small = kept[1:]
        if i % 4 == 1:
            total += small.sum()
            kept = small.copy()
        else:
            pair = small, doubled(small)
            total += pair[1][0]
        if len(kept) < 3:
            kept = doubled(a)
    return total, kept


@pytest.mark.parametrize("n", [0, 1, 2, 9, 30])
def test_arrays_live_as_long_as_they_are_used(n):
    numba.core.runtime._nrt_python.memsys_enable_stats()
    stats = numba.core.runtime.rtsys.get_allocation_stats
    a = np.arange(1.0, 7.0)
    expected, left = wandering.function(a, n), sys.getrefcount(a)
    wandering(a, n)
    before = stats()
    for _ in range(20):
        total, kept = wandering(a, n)
        assert total == expected[0] and kept.tolist() == expected[1].tolist()
        del kept
    after = stats()
    assert after.alloc - before.alloc == after.free - before.free
    assert sys.getrefcount(a) == left


@compiled
def unassigned(n):
    """A variable that only some paths give a value."""
    for i in range(n):
        if i > 1:
            square = i * i
        if i > 2:
            n += square
    return n


def test_variables_that_some_paths_do_not_assign():
    assert [unassigned(n) for n in range(6)] == [unassigned.function(n) for n in range(6)]
