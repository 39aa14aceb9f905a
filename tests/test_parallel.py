"""Long work on another thread: reports while it runs, and an end when the reports raise."""

import socket
import threading
import time
from contextlib import suppress

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import box, sphere
from signedheat import parallel, samples
from signedheat.jobs import reporting, run_cancellable, run_watched


class Stop(Exception):
    pass


def stop():
    raise Stop


def test_what_the_report_raises_ends_the_wait():
    begin = time.perf_counter()
    with pytest.raises(Stop):
        run_watched(lambda: time.sleep(20), stop)
    assert time.perf_counter() - begin < 10


def test_completion_is_reported_on_and_not_waited_for(monkeypatch):
    """However long one of its steps takes."""
    ended = threading.Event()
    monkeypatch.setattr("signedheat.solids.completion._from_mesh", lambda *_: ended.wait(60))
    calls = []

    def progress(fraction, step):
        calls.append((fraction, step))
        if calls.count((0.5, "complete")) > 5:
            raise Stop

    with pytest.raises(Stop):
        sh.complete(samples.without_faces(sphere(400), 0.1), progress=progress)
    assert not ended.is_set()
    ended.set()


def test_what_the_job_raises_comes_through():
    for error in (ValueError, TimeoutError):
        with pytest.raises(error):
            run_watched(lambda error=error: (_ for _ in ()).throw(error("in the job")), lambda: None)


def test_a_job_is_reported_on_until_it_ends():
    calls = []
    with reporting(lambda fraction, step: calls.append(fraction)):
        assert run_cancellable(lambda: time.sleep(0.6) or "done") == "done"
        assert calls


@pytest.mark.parametrize("seen", [lambda fraction, step: None, None])
def test_sharpening_is_the_same_whoever_watches(seen):
    mesh, field = sphere(2000), sh.SignedHeatSolver(box(24)).distance(sphere(2000))
    on_surface = sh.SignedHeatSolver(mesh).distance(mesh.path(mesh.edges.vertices[0]))
    for each in (field, on_surface):
        np.testing.assert_array_equal(sh.sharpen(each, progress=seen).values, sh.sharpen(each).values)


def test_sharpening_stops_when_asked_to(monkeypatch):
    """However long the search for straight lines takes."""
    monkeypatch.setattr("signedheat.grids.redistancing.redistance", lambda *_: time.sleep(20))
    calls = []

    def progress(fraction, step):
        calls.append(fraction)
        if len(calls) > 1:
            raise Stop

    begin = time.perf_counter()
    with pytest.raises(Stop):
        sh.sharpen(sh.SignedHeatSolver(box(12)).distance(sphere(400)), progress=progress)
    assert time.perf_counter() - begin < 10


@pytest.mark.parametrize("greeting", [b"", b"HTTP/1.1 400 no"])
def test_what_listens_and_is_no_scheduler_is_told(greeting, monkeypatch):
    """Dask itself waits for ever, or takes what it hears for the size of a message."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(parallel, "CLUSTER_SECONDS", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            connection, _ = server.accept()
            with connection, suppress(ConnectionError):
                connection.send(greeting)
                connection.recv(1)  # until the other side has gone

        answering = threading.Thread(target=answer)
        answering.start()
        with refused(sh.errors.SignedHeatError, element="scheduler"):
            parallel.connected(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        answering.join()
