"""Progress: who is told, on which thread, and what is left bound after an exception."""

import threading

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import box, sphere
from signedheat.jobs import bound_progress, part_of_work, report, report_again, reporting, run_cancellable


class Stop(Exception):
    pass


def told_by(call):
    """What a call with `progress` reports: its fractions and steps."""
    told = []
    call(progress=lambda fraction, step: told.append((fraction, step)))
    return told


def test_calls_inside_of_a_call_report_nothing():
    """Here that of a function of the user, which completes a shape again at each of its calls."""
    ball, calls = sphere(80), []

    def reach(points):
        calls.append(bound_progress())
        sh.complete(ball)
        sh.SignedHeatSolver(box(6)).distance(ball)
        return np.full(len(points), 0.1)

    def constant(points):
        return np.full(len(points), 0.1)

    told, alone = (
        told_by(lambda reach=reach, **given: sh.offset(ball, reach, resolution=12, **given))
        for reach in (reach, constant)
    )
    assert any(each is not None for each in calls), "the function of the user was called amid the work"
    assert [step for _, step in told] == [step for _, step in alone]


def test_a_call_inside_of_a_call_has_a_callback_of_its_own():
    inner = []

    def outer(fraction, step):
        inner.append(told_by(lambda **given: sh.complete(sphere(80), **given)))

    sh.complete(sphere(80), progress=outer)
    assert len(inner) >= 3
    for told in inner:
        assert (
            told[0] == (0.0, "orient") and told[-1] == (1.0, "done") and told == sorted(told, key=lambda each: each[0])
        )


def test_what_a_callback_calls_does_not_report_to_it():
    """Not even what has no `progress`, and so would report to what is bound."""
    mesh, depth = sphere(80), []
    curve = mesh.level_set(mesh.vertices[:, 2], 0.01)

    def progress(fraction, step):
        depth.append(step)
        assert bound_progress() is None and len(depth) < 100
        sh.close_curves(curve, mesh)

    sh.complete(mesh, progress=progress)
    assert depth[0] == "orient" and depth[-1] == "done"


@pytest.mark.parametrize("step", ["orient", "complete", "distance", "done"])
def test_an_exception_leaves_nothing_bound(step):
    ball = sphere(80)

    def progress(fraction, now):
        if now == step:
            raise Stop

    with pytest.raises(Stop):
        sh.signed_distance(ball, box(8), progress=progress)
    assert bound_progress() is None
    report(0.5, step)
    report_again()
    assert run_cancellable(threading.get_ident) == threading.get_ident()
    with refused(sh.SignedHeatError, element="resolution"):
        sh.signed_distance(ball, box(8), resolution=8, progress=progress)
    assert bound_progress() is None


def test_done_is_told_once_and_not_after_an_error():
    ball, told = sphere(80), []
    for call in (
        lambda **given: sh.signed_distance(ball, box(8), **given),
        lambda **given: sh.deviation(ball, ball, **given),
        lambda **given: sh.SignedHeatSolver(box(8), **given).distance(ball),
        lambda **given: sh.complete(ball).surface(resolution=12, tolerance=0.1, **given),
    ):
        assert [step for _, step in told_by(call)].count("done") == 1
    with refused(sh.SignedHeatError, element="source 0"):
        sh.signed_distance(ball, sh.Grid((0, 0), 1.0, (4, 4)), progress=lambda *each: told.append(each))
    assert not told


def test_two_threads_do_not_mix():
    """Each has its own callback, which is called on it alone."""
    seen, barrier = {}, threading.Barrier(2)

    def work(number):
        def progress(fraction, step):
            if step == "complete" and fraction == 0.5 and (0.5, "complete", threading.get_ident()) not in told:
                barrier.wait(60)  # amid both calls
            told.append((fraction, step, threading.get_ident()))

        told = seen[number] = []
        sh.complete(sphere(400 * number), progress=progress)
        assert bound_progress() is None

    threads = [threading.Thread(target=work, args=[number]) for number in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number, thread in zip((1, 2), threads, strict=True):
        told = seen[number]
        assert {each[2] for each in told} == {thread.ident}
        steps = list(dict.fromkeys(step for _, step, _ in told))
        assert steps == ["orient", "complete", "done"] and [f for f, _, _ in told] == sorted(f for f, _, _ in told)


def test_threads_of_a_bound_call_are_not_bound():
    seen = []
    with reporting(lambda *told: seen.append(threading.get_ident())):
        assert run_cancellable(bound_progress) is None
        assert run_cancellable(threading.get_ident) != threading.get_ident()
    assert set(seen) == {threading.get_ident()}


def test_parts_of_parts():
    told = []
    with reporting(lambda *each: told.append(each)):
        with part_of_work(0.5, 1.0), part_of_work(0.0, 0.5):
            report(1.0, "a")
        with reporting(None):
            report(0.9, "unheard")
        with reporting(bound_progress()):
            report(0.2, "b")
        report(0.8, "c")
        report_again()
    assert told == [(0.75, "a"), (0.75, "b"), (0.8, "c"), (0.8, "c"), (1.0, "done")]


def test_methods_of_users_are_given_what_is_bound():
    """And those of the package, which they call, report to it within their own."""
    mesh = sphere(400)
    phi = sh.SignedHeatSolver(mesh).distance(mesh.level_set(mesh.vertices[:, 2], 0.01))

    class Twice(sh.methods.Convex):
        def sharpened(self, discretization, elements, values, source, progress):
            progress(0.3, "mine")
            return super().sharpened(discretization, elements, values, source, progress)

    told = told_by(lambda **given: sh.sharpen(phi, method=Twice(), **given))
    assert told[:2] == [(0.0, "sharpen"), (0.3, "mine")] and told[-1] == (1.0, "done")
    assert len(told) > 5 and [step for _, step in told].count("done") == 1
    assert sh.sharpen(phi, method=sh.methods.Convex()).values.tolist() == pytest.approx(
        sh.methods.Convex()
        .sharpened(
            sh.SignedHeatSolver(mesh).discretization,
            sh.methods.LinearElements.on_triangles(mesh.intrinsic),
            phi.values,
            phi.source,
            None,
        )[0]
        .tolist()
    )
