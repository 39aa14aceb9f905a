"""Ctrl-C ends the wait for whatever runs, nothing is used after it was freed, and threads end when nobody waits."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
import scipy.spatial

from fuzz.cases_interrupts import LATEST, LONG_CALLS, ended
from fuzz.frame import families, run_case
from signedheat.compiled import compiled
from signedheat.jobs import Abandoned, briefly, interruptible, own_flag, run_watched, start_thread
from signedheat.parallel import PointTree, in_chunks, in_threads

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


@contextmanager
def interrupted(delay=0.3):
    """Ctrl-C after a while, which must come through soon."""
    sent = []

    def kick():
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(delay, kick)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        yield
    assert time.perf_counter() - sent[0] < LATEST
    timer.join()


def test_nobody_waits_for_compiled_code():
    with interrupted():
        interruptible(time.sleep, 4)


def test_nobody_waits_for_threads_and_these_end():
    begun = []

    def work(item):
        begun.append(item)
        time.sleep(1.5)

    with interrupted():
        list(in_threads(work, range(100)))
    time.sleep(2.0)
    assert len(begun) <= 2 * (os.cpu_count() or 1)


def test_threads_within_threads_end():
    begun = []

    def inner(item):
        begun.append(item)
        time.sleep(0.05)

    with interrupted():
        list(in_threads(lambda _: list(in_threads(inner, range(1000))), range(4)))
    time.sleep(1.0)
    count = len(begun)
    time.sleep(0.5)
    assert len(begun) == count


def test_results_of_threads_are_in_order_and_few_are_held():
    held, most = set(), []

    def work(item):
        held.add(item)
        most.append(len(held))
        return item

    for k, result in enumerate(in_threads(work, range(1000))):
        assert result == k
        held.discard(k)
    assert max(most) <= 4 * (os.cpu_count() or 1) + 4


def test_what_a_thread_raises_comes_through_and_the_others_end():
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError):
        list(in_threads(lambda item: 1 / (item - 3), range(1000)))
    assert threading.active_count() == before


@compiled
def busy(values: np.ndarray, rounds: int) -> float:
    total = 0.0
    for _ in range(rounds):
        for k in range(len(values)):
            total += np.sin(values[k] + total)
    return total


def test_nobody_waits_for_a_kernel():
    values = np.zeros(100_000)
    busy(values, 1)
    with interrupted():
        busy(values, 1500)


def test_a_job_that_nobody_waits_for_ends_at_its_next_kernel():
    values, seen = np.zeros(10), []

    def job():
        try:
            for _ in range(10_000):
                busy(values, 1)
                time.sleep(0.01)
        except Abandoned:
            seen.append("abandoned")
            raise

    def report():
        raise ValueError

    with pytest.raises(ValueError):
        run_watched(job, report)
    deadline = time.monotonic() + 5
    while not seen and time.monotonic() < deadline:
        time.sleep(0.01)
    assert seen


@pytest.mark.parametrize("depth", [1, 2, 3])
@pytest.mark.parametrize("by", ["__cause__", "__context__"])
def test_an_interrupt_is_found_however_deep_it_lies(depth, by):
    """Numba, and Python's calls of types, raise other errors because of it."""
    error: BaseException = KeyboardInterrupt("here")
    for _ in range(depth):
        outer = SystemError("returned a result with an exception set")
        setattr(outer, by, error)
        error = outer

    def raises(*_):
        raise error

    kernel = compiled(lambda: None)
    vars(kernel)["dispatcher"] = raises
    with pytest.raises(KeyboardInterrupt, match="here"):
        kernel()


def test_brief_calls_start_no_thread():
    seen = []
    with briefly():
        interruptible(lambda: seen.append(threading.get_ident()))
    in_chunks(lambda rows: (interruptible(lambda: seen.append(threading.get_ident())) or rows,), np.arange(9))
    interruptible(lambda: seen.append(threading.get_ident()))
    here = threading.get_ident()
    assert [ident == here for ident in seen] == [True, True, False]


def test_flags_hold_for_what_threads_start():
    flag, told = own_flag(), []
    child = start_thread(lambda: told.append(own_flag().parent is flag), flag)
    child.join()
    assert told == [True]


@pytest.mark.parametrize("n", [10, 30_000])
def test_trees_answer_as_those_of_scipy(n):
    points = np.random.default_rng(n).random((n, 3))
    ours, theirs = PointTree(points), scipy.spatial.cKDTree(points)
    for options in ({"k": 1}, {"k": 3}, {"k": [2]}, {"k": 2, "distance_upper_bound": 0.01}):
        for a, b in zip(ours.query(points, **options), theirs.query(points, **options), strict=True):
            np.testing.assert_array_equal(a, b)
    assert ours.query(points[0])[1] == theirs.query(points[0])[1]
    radii = 0.03 * points[:, 0]
    for radius in (0.01, radii):
        found, expected = ours.query_ball_point(points, radius), theirs.query_ball_point(points, radius)
        assert [sorted(row) for row in found] == [sorted(row) for row in expected]


def test_a_tree_that_is_interrupted_is_not_freed():
    points = np.random.default_rng(0).random((200_000, 3))
    with interrupted(0.2):
        for _ in range(100):
            PointTree(points).query(points, k=20)
    junk = [np.random.default_rng(k).random(10**6) for k in range(20)]
    assert len(junk) == 20
    assert ended()


@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("name", [name for name in families() if name.startswith("interrupts ")])
def test_long_calls_end_soon(name, number):
    outcome = run_case(families()[name], 3, number)
    assert not outcome.failed, str(outcome)


def test_there_are_long_calls():
    assert len(LONG_CALLS) > 8
