"""Faults injected: full disks, signals and kills at any moment, odd environments, forks, threads."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.io import budgets
from signedheat.view import save_scene

resource = pytest.importorskip("resource", reason="limits and signals of POSIX")

BALL = samples.sphere(2)
GRID = sh.Grid([0, 0, 0], 0.5, [12, 12, 12])
FIELD = sh.Field(GRID, np.random.default_rng(0).normal(size=GRID.shape))
CLOUD = sh.PointCloud(BALL.vertices, BALL.vertices)
ON_BALL = sh.Field(BALL, BALL.vertices[:, 0])
TETS = sh.TetMesh(np.random.default_rng(1).random((400, 3)), np.arange(400).reshape(100, 4))
ON_TETS = sh.Field(TETS, np.arange(400.0))
LINE = sh.Polyline(np.random.default_rng(2).random((99, 2)))
CURVE = BALL.path(list(range(40)))

WRITERS = {
    **{ending: BALL.save for ending in ("stl", "ply", "obj", "off", "vtp")},
    **{ending: CLOUD.save for ending in ("xyz", "pc")},
    **{f"field.{ending}": FIELD.save for ending in ("npz", "npy", "nrrd", "vti")},
    **{f"surface.{ending}": ON_BALL.save for ending in ("npz", "ply", "vtp", "obj")},
    **{f"tets.{ending}": TETS.save for ending in ("node", "ele", "mesh", "msh", "vtk", "vtu")},
    **{f"values.{ending}": ON_TETS.save for ending in ("msh", "vtk", "vtu")},
    **{f"lines.{ending}": lambda path: sh.io.write_polylines(LINE, path) for ending in ("svg", "csv")},
    **{f"curves.{ending}": lambda path: sh.io.write_curves(CURVE, path, BALL) for ending in ("txt", "json", "obj")},
    **{f"picture.{ending}": lambda path: save_scene(BALL, path) for ending in ("png", "svg")},
}
"""Everything that writes a file, by the end of its name."""


@contextlib.contextmanager
def disk_of(size):
    """No file can become larger than this, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("size", [0, 100])
def test_full_disk(tmp_path, name, size):
    path = tmp_path / (name if "." in name else f"shape.{name}")
    beside = [path.with_suffix(e) for e in (".json", ".node", ".ele") if path.suffix in (".npy", ".node", ".ele")]
    old = {p: b"old" for p in [path, *beside] if p.suffix != path.suffix or p == path}
    for p, data in old.items():
        p.write_bytes(data)
    with disk_of(size), pytest.raises(sh.errors.FileFormatError) as caught:
        WRITERS[name](path)
    assert caught.value.path and caught.value.remedy
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == old


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_files_and_folders(tmp_path):
    (tmp_path / "ball.stl").write_bytes(b"old")
    (tmp_path / "ball.stl").chmod(0o444)
    with pytest.raises(sh.errors.FileFormatError):
        BALL.save(tmp_path / "ball.stl")
    tmp_path.chmod(0o555)
    with pytest.raises(sh.errors.FileFormatError):
        BALL.save(tmp_path / "new.stl")
    tmp_path.chmod(0o755)
    assert [p.name for p in tmp_path.iterdir()] == ["ball.stl"]


DRIVER = """
import sys
from signedheat.cli import main
print("ready", flush=True)
sys.exit(main(sys.argv[1:]))
"""


def stopped(folder, number, delay):
    """A command that gets a signal after a while: its status, and what it says."""
    command = ["volume", "ball.stl", "-o", "phi.npz", "--resolution", "40", "--preview", "phi.png"]
    running = subprocess.Popen(
        [sys.executable, "-c", DRIVER, *command],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert running.stdout.readline() == "ready\n"
    time.sleep(delay)
    running.send_signal(number)
    _, told = running.communicate(timeout=120)
    return running.returncode, told


def whole(folder):
    """Outputs are whole: the old ones or the new ones."""
    phi = sh.read_field(folder / "phi.npz")
    assert phi.domain.shape in ((12, 12, 12), (40, 40, 40))


def ready(folder):
    folder.mkdir(exist_ok=True)
    BALL.save(folder / "ball.stl")
    FIELD.save(folder / "phi.npz")
    return folder


def stop_and_look(folder, number, delay):
    status, told = stopped(ready(folder), number, delay)
    if number == signal.SIGKILL:
        assert status in (-number, 0)
    else:
        assert status in (128 + number, 0), told
        assert "Traceback" not in told and told.count("\n") <= 1, told
        assert not [p.name for p in folder.iterdir() if p.name.startswith(".")]
    whole(folder)


@pytest.mark.parametrize(
    "number, delay", [(signal.SIGINT, 0.2), (signal.SIGINT, 1.2), (signal.SIGTERM, 0.7), (signal.SIGKILL, 1.5)]
)
def test_signals_at_any_moment(tmp_path, number, delay):
    stop_and_look(tmp_path / "run", number, delay)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_signals_at_many_moments(tmp_path, number):
    for delay in np.random.default_rng(number).uniform(0.02, 5.0, 25):
        stop_and_look(tmp_path / "run", number, delay)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_library_calls_python_is_not_lost(tmp_path, number):
    """As the one that compiles kernels does: exceptions in what it calls go nowhere."""
    code = f"""
import ctypes, os, sys, time
from signedheat.cli import main, reports
def signalled():
    os.kill(os.getpid(), {int(number)})
def waiting(path):
    ctypes.CFUNCTYPE(None)(signalled)()
    time.sleep(20)
    print("waited", file=sys.stderr)
reports.read = waiting
sys.exit(main(["info", "ball.stl"]))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ready(tmp_path / "run"), capture_output=True, text=True)
    assert done.returncode == 128 + number and done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_file_is_written(tmp_path, number):
    code = f"""
import os, sys
from signedheat.cli import main, reports
from signedheat.io import files
import signedheat as sh
def halfway(path):
    with files.replacing("out.stl") as temporary:
        temporary.write_bytes(b"half")
        os.kill(os.getpid(), {int(number)})
        import time; time.sleep(5)
reports.read = halfway
sys.exit(main(["info", "ball.stl"]))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ready(tmp_path / "run"), capture_output=True, text=True)
    assert done.returncode == 128 + number and done.stderr.count("\n") == 1
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"ball.stl", "phi.npz"}


def test_a_signal_while_python_runs_text(tmp_path):
    """As where classes are made and kernels compiled: the status is that of the signal all the same."""
    code = f"""
import os, sys
from signedheat.cli import main, reports
def halfway(path):
    exec("os.kill(os.getpid(), {int(signal.SIGTERM)})\\nimport time; time.sleep(5)", globals())
reports.read = halfway
sys.exit(main(["info", "ball.stl"]))
"""
    (ready(tmp_path / "run") / "own.py").write_text(code)
    done = subprocess.run([sys.executable, "-m", "own"], cwd=tmp_path / "run", capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (128 + signal.SIGTERM, 1), done.stderr


@pytest.mark.parametrize(
    "variables",
    [{"NUMBA_NUM_THREADS": "many"}, {"SIGNEDHEAT_BACKEND": "foo"}],
    ids=str,
)
def test_environments_that_make_no_sense(tmp_path, variables):
    ready(tmp_path)
    command = ["-m", "signedheat", "surface", "ball.stl", "curve.json", "-o", "phi.ply"]
    sh.io.write_curves(
        sh.read(tmp_path / "ball.stl").path([0, 1, 2]), tmp_path / "curve.json", sh.read(tmp_path / "ball.stl")
    )
    environment = {**os.environ, **variables}
    done = subprocess.run([sys.executable, *command], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1, done.stderr
    assert next(iter(variables.values())) in done.stderr


def distance():
    """Something on surfaces and grids, as numbers."""
    surface = sh.SignedHeatSolver(BALL).distance(BALL.path([0, 1, 2])).values
    grid = sh.Grid.around(BALL.bounds, 16)
    space = [sh.signed_distance(BALL, grid).values, sh.SignedHeatSolver(grid).distance(BALL).values]
    return np.concatenate([surface, np.ravel(space)])


def test_eight_threads_at_once():
    expected = distance()
    with ThreadPoolExecutor(8) as pool:
        for job in [pool.submit(distance) for _ in range(8)]:
            np.testing.assert_array_equal(job.result(), expected)


def test_spawned_processes_after_use():
    expected = distance()
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        np.testing.assert_array_equal(pool.submit(sh.signed_distance, BALL, resolution=8).result(timeout=200).values,
                                      sh.signed_distance(BALL, resolution=8).values)  # fmt: skip
    np.testing.assert_array_equal(distance(), expected)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_processes_after_use(tmp_path):
    expected, path = distance(), tmp_path / "values.npy"
    child = os.fork()
    if child == 0:
        np.save(path, distance())
        os._exit(0)
    deadline = time.monotonic() + 100
    while (ended := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < deadline:
        time.sleep(0.02)
    if ended[0] == 0:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert ended == (child, 0)
    np.testing.assert_array_equal(np.load(path), expected)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no way to choose processors")
def test_one_processor_and_more_threads_give_the_same_bits(tmp_path):
    code = "import sys, numpy as np, signedheat as sh\nfrom signedheat import samples\nball = samples.sphere(2)\n"
    code += "np.save(sys.argv[1], sh.signed_distance(ball, resolution=12).values)"
    environment = {**os.environ, "NUMBA_NUM_THREADS": "3", "OMP_NUM_THREADS": "3"}
    one = {min(os.sched_getaffinity(0))}
    command = [sys.executable, "-c", code, str(tmp_path / "values.npy")]
    subprocess.run(command, check=True, env=environment, preexec_fn=lambda: os.sched_setaffinity(0, one))
    np.testing.assert_array_equal(np.load(tmp_path / "values.npy"), sh.signed_distance(BALL, resolution=12).values)


def test_memory_that_is_not_free(tmp_path, monkeypatch):
    BALL.save(tmp_path / "ball.stl")
    monkeypatch.setattr(budgets, "available_memory", lambda: 100)
    with pytest.raises(sh.errors.MemoryLimitError):
        sh.read(tmp_path / "ball.stl")


def test_threads_end(tmp_path):
    before = {thread.name for thread in threading.enumerate()}
    ON_TETS.save(tmp_path / "values.vtk")
    sh.read_field(tmp_path / "values.vtk")
    deadline = time.monotonic() + 10
    while {thread.name for thread in threading.enumerate()} - before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert {thread.name for thread in threading.enumerate()} <= before
