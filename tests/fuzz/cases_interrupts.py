"""Ctrl-C at any moment of a long call: `interrupts complete`, `interrupts volume` and so on, one family for each call.

The call ends within a second, its threads end by themselves, and what is called next is right.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import signedheat as sh
from fuzz.frame import PATIENCE, Wrong, family
from signedheat import samples

LATEST = 1.0
"""Seconds until a call has ended after Ctrl-C, on the clock and of a processor, since other work delays it."""
LONGEST = 30.0
"""Seconds until threads that nobody waits for have ended."""


@cache
def _broken(level: int) -> sh.TriangleMesh:
    return samples.without_faces(samples.sphere(level), 0.3)


@cache
def _ball(level: int) -> sh.TriangleMesh:
    return samples.sphere(level)


def _path() -> Any:
    mesh = _ball(6)
    return mesh.path([0, 900, 3000])


def _scan() -> sh.PointCloud:
    return samples.oriented_points(_ball(4), 20_000)


LONG_CALLS: dict[str, tuple[float, Callable[[], Any]]] = {
    "complete": (2.0, lambda: sh.complete(_broken(5))),
    "volume": (3.0, lambda: sh.signed_distance(_broken(4), sh.Grid((-1.2,) * 3, 2.4 / 79, (80,) * 3))),
    "method": (2.0, lambda: sh.SignedHeatSolver(sh.Grid((-1.2,) * 3, 2.4 / 79, (80,) * 3)).distance(_broken(4))),
    "surface": (3.0, lambda: sh.signed_distance(_path(), _ball(6))),
    "factor": (2.0, lambda: sh.SignedHeatSolver(_ball(6)).distance(_path())),
    "close": (2.0, lambda: sh.close_curves(_path(), _ball(6))),
    "paths": (1.0, lambda: [_path() for _ in range(200)]),
    "points": (3.0, lambda: sh.complete(_scan())),
    "offset": (3.0, lambda: sh.offset(_broken(4), 0.05)),
    "thickness": (2.0, lambda: sh.wall_thickness(_ball(6))),
    "deviation": (2.0, lambda: sh.deviation(_broken(5), _ball(5))),
    "sample": (1.0, lambda: sh.sample_distances(_broken(4), 300_000, seed=0)),
    "distances": (2.0, lambda: sh.complete(_broken(3)).distance(np.random.default_rng(0).random((2_000_000, 3)))),
    "watertight": (2.0, lambda: sh.complete(_broken(4)).surface()),
    "tets": (2.0, lambda: sh.tetrahedralize(_ball(4), resolution=24)),
}
"""Calls that take some seconds, and about how many."""


def build(seconds: float, random: np.random.Generator, folder: Path) -> float:
    """When Ctrl-C comes."""
    return float(random.uniform(0.0, seconds))


def ended(seconds: float = LONGEST) -> bool:
    """Whether all threads but this one end."""
    deadline = time.monotonic() + seconds
    while threading.active_count() > 1 and time.monotonic() < deadline:
        time.sleep(0.01)
    return threading.active_count() == 1


def check(call: Callable[[], Any], delay: float) -> str:
    """Interrupt the call, and see that it ends, that its threads do, and that another call is right."""
    sent: list[tuple[float, float]] = []
    finished = threading.Event()

    def kick() -> None:
        if not finished.wait(delay):
            sent.append((time.perf_counter(), time.process_time()))
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    kicking = threading.Thread(target=kick, daemon=True)
    try:
        kicking.start()
        call()
        finished.set()
        kicking.join()
        kind = "done"
    except KeyboardInterrupt:
        kind = "stopped"
    finally:
        finished.set()
        signal.signal(signal.SIGINT, before)
    now = time.perf_counter(), time.process_time()
    if kind == "stopped":
        clock, computed = (end - begin for end, begin in zip(now, sent[0], strict=True))
        if clock > LATEST and (computed > LATEST or clock > PATIENCE * LATEST):
            raise Wrong("late", f"{clock:.2f} s after Ctrl-C, {computed:.2f} of a processor")
    if not ended():
        raise Wrong("threads", f"{threading.active_count() - 1} have not ended")
    volume = sh.complete(_ball(2)).volume
    if not 4.0 < volume < 4.2:
        raise Wrong("wrong afterwards", f"{volume}")
    return kind


for name, (seconds, call) in LONG_CALLS.items():
    family(f"interrupts {name}", partial(build, seconds), partial(check, call))
