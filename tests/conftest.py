"""Settings that all tests share."""

from __future__ import annotations

import gc
import hashlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

if "PYTEST_XDIST_WORKER" in os.environ:  # as many workers as processors: more threads would wait for one another
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")

settings.register_profile(
    "suite",
    max_examples=20,
    deadline=None,
    derandomize=True,  # the same cases every time; `HYPOTHESIS_PROFILE=search` looks for new ones
    suppress_health_check=list(HealthCheck),
)
settings.register_profile("search", max_examples=500, deadline=None, suppress_health_check=list(HealthCheck))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

gc.set_threshold(50_000)  # while tests are collected, it would look at them again and again
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as shells leave it to what they start in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile all kernels before workers begin, each of which would compile them, unless this source's are compiled."""
    is_worker = hasattr(session.config, "workerinput")
    if is_worker or not session.config.getoption("numprocesses", None) or (stamp := _stamp()).exists():
        return
    done = subprocess.run([sys.executable, "-m", "signedheat", "warmup", "--quiet"], check=False)
    if done.returncode:  # it says why on standard error; what it could not compile, tests would report many times
        pytest.exit(f"signedheat warmup failed with status {done.returncode}", returncode=1)
    with suppress(OSError):  # kernels are kept nowhere
        stamp.touch()


def _stamp() -> Path:
    """Return a file beside the kernels, there once those of this source are compiled for this processor."""
    import numba

    from signedheat import compiled

    digest = hashlib.sha256(repr((numba.__version__, compiled._processor())).encode())
    for path in sorted(Path(compiled.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return compiled.cache_folder() / f"{digest.hexdigest()[:16]}.compiled"


@pytest.fixture(autouse=True)
def nothing_to_announce() -> None:
    """What a test must not print does not depend on what is compiled already."""
    from signedheat.compiled import announce  # imports NumPy, which must know the number of threads

    announce.is_made = True


def pytest_collection_finish() -> None:
    """Spare the garbage collector what packages and tests hold until the end, a million objects."""
    gc.freeze()


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches start no processes."""
    from batch_jobs import Here  # imports NumPy, which must know the number of threads

    monkeypatch.setattr("signedheat.batches.pool.Worker", Here)


@pytest.fixture
def forked_parsers() -> Iterator[None]:
    """Parsers of other packages are forked, which saves them a start; `tests/io/test_sandbox.py` starts them."""
    from fuzz.forked import forked

    with forked():
        yield


@pytest.fixture
def coarse_duck(monkeypatch: pytest.MonkeyPatch) -> None:
    """The duck of the samples has a fifth of its faces, for tests in which it is any broken shape."""
    from signedheat import samples  # imports NumPy, which must know the number of threads

    monkeypatch.setattr(samples.duck, "__defaults__", (24,))


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures have a tenth of their pixels, which take as long as what they show."""
    from matplotlib.figure import Figure

    from signedheat.view import surface_pictures

    save = Figure.savefig

    def smaller(figure: Figure, path: object, *, dpi: float = 100, **options: object) -> None:
        save(figure, path, dpi=dpi / 3, **options)

    monkeypatch.setattr(Figure, "savefig", smaller)
    monkeypatch.setattr(surface_pictures, "LONGER_SIDE", surface_pictures.LONGER_SIDE // 3)
