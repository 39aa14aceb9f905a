"""Compiled kernels on disk: kept, found by what they are made of, announced, and never a reason to fail."""

from __future__ import annotations

import importlib
import os
import pty
import re
import shutil
import subprocess
import sys
import textwrap

import pytest

import signedheat as sh
from signedheat import compiled
from signedheat.compiled import Kernel
from signedheat.parallel import n_threads

SCALING = """
from signedheat.compiled import compiled

FACTOR = {factor}

@compiled
def scaled(x):
    return FACTOR * x
"""
SHIFTING = """
from scaling import scaled
from signedheat.compiled import compiled

@compiled
def shifted(x):
    return scaled(x) + {shift}
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(Kernel, "is_kept", True)
    return tmp_path / "cache" / "signedheat"


@pytest.fixture
def shifted(tmp_path, monkeypatch):
    """Makes a kernel that calls one of another file, as a fresh process would; tells what was compiled."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(factor=2.0, shift=1.0):
        for name in ("scaling", "shifting"):
            sys.modules.pop(name, None)
        (tmp_path / "scaling.py").write_text(SCALING.format(factor=factor))
        (tmp_path / "shifting.py").write_text(SHIFTING.format(shift=shift))
        importlib.invalidate_caches()
        shifting = importlib.import_module("shifting")
        value, made = shifting.shifted(3.0), (shifting.scaled.part, shifting.shifted.dispatcher)
        return value, [kernel.__name__ for kernel in made if kernel.stats.cache_misses]

    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # files of the same size and second are told apart
    return make


def test_kept_by_what_they_are_made_of(cache, shifted):
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, [])
    assert shifted(shift=2.0) == (8.0, ["shifted"])
    assert shifted(factor=3.0, shift=2.0) == (11.0, ["scaled", "shifted"])  # a constant of a file that is called
    assert shifted() == (7.0, [])
    assert len(list(cache.rglob("*.nbc"))) == 5


def test_a_file_edited_before_the_first_call(cache, shifted, tmp_path):
    shifted()
    module = sys.modules["scaling"] = importlib.reload(sys.modules["scaling"])
    (tmp_path / "scaling.py").write_text(SCALING.format(factor=9.0))
    assert module.scaled(1.0) == 2.0
    assert shifted(factor=9.0)[0] == 28.0


def test_named_tuples_that_move_are_other_types(cache, tmp_path, monkeypatch):
    """Numba's cache has them by the names of their modules, and would not find them where they were."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    pair = "from __future__ import annotations\nfrom typing import NamedTuple\nclass Pair(NamedTuple):\n    x: float\n"
    kernel = """from __future__ import annotations
from {module} import Pair
from signedheat.compiled import compiled

@compiled
def first(pair: Pair) -> float:
    return pair.x
"""
    for module in ("old_home", "new_home"):
        for name in ("pairs", "old_home"):
            sys.modules.pop(name, None)
            (tmp_path / f"{name}.py").unlink(missing_ok=True)
        (tmp_path / f"{module}.py").write_text(pair)
        (tmp_path / "pairs.py").write_text(kernel.format(module=module))
        importlib.invalidate_caches()
        pairs = importlib.import_module("pairs")
        assert pairs.first(pairs.Pair(2.0)) == 2.0


def test_digests_are_the_same_in_every_process():
    code = """
        from signedheat.compiled import _digest, compiled
        @compiled
        def constants(x):
            return x in ("one", "two") or x in {"three", "four", "five"}
        print(_digest(constants))
    """
    told = {
        subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
        for seed in ("1", "3")
    }
    assert len(told) == 1


@pytest.mark.parametrize("damage", [b"", b"x" * 100, None])
@pytest.mark.parametrize("kind", ["*.nbi", "*.nbc"])
def test_damaged_files_are_compiled_again(cache, shifted, monkeypatch, damage, kind):
    shifted()
    for path in cache.rglob(kind):
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2] if damage is None else damage)
    value, told = shifted()
    assert value == 7.0 and told[-2:] == ["scaled", "shifted"]
    monkeypatch.setattr(Kernel, "is_kept", True)  # as in the next process
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, [])


def test_processes_that_compile_at_once_share_what_is_kept(cache, shifted, tmp_path):
    (tmp_path / "scaling.py").write_text(SCALING.format(factor=2.0))
    (tmp_path / "shifting.py").write_text(SHIFTING.format(shift=1.0))
    code = "import shifting; print('ready', flush=True); input(); print(shifting.shifted(3.0))"
    processes = [
        subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stdin=-1, stdout=-1, text=True) for _ in range(3)
    ]
    assert [process.stdout.readline() for process in processes] == 3 * ["ready\n"]
    for process in processes:  # all begin to compile now
        process.stdin.write("\n")
        process.stdin.flush()
    assert [process.communicate(timeout=120)[0] for process in processes] == 3 * ["7.0\n"]
    assert shifted() == (7.0, [])


def test_no_folder_can_be_written(tmp_path, shifted, monkeypatch):
    def none(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "makedirs", none)
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert not list(tmp_path.rglob("*.nbc"))


@pytest.fixture(scope="module")
def compiled_for_wheels(tmp_path_factory):
    """A folder with both files and, in `wheel`, their kernels, compiled once as for wheels."""
    if compiled._kind_of_code() is None:
        pytest.skip("this processor does not run what wheels carry, or other code is asked for")
    folder = tmp_path_factory.mktemp("built")
    (folder / "scaling.py").write_text(SCALING.format(factor=2.0))
    (folder / "shifting.py").write_text(SHIFTING.format(shift=1.0))
    baseline = {"NUMBA_CPU_NAME": compiled.BASELINE, "NUMBA_CPU_FEATURES": ""}
    environment = {**os.environ, **baseline, "NUMBA_CACHE_DIR": str(folder / "wheel")}
    command = [sys.executable, "-c", "import shifting; shifting.shifted(3.0)"]
    subprocess.run(command, cwd=folder, env=environment, check=True)
    return folder


@pytest.fixture
def carried(compiled_for_wheels, tmp_path, monkeypatch):
    """The folder of kernels as a wheel carries them, for the test alone."""
    shutil.copytree(compiled_for_wheels, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(compiled, "CARRIED", tmp_path / "wheel" / "signedheat")
    return compiled.CARRIED


def test_kernels_that_a_wheel_carries_are_not_compiled(carried, cache, shifted, caplog, monkeypatch):
    monkeypatch.setattr(compiled, "announce", type(compiled.announce)("compiling what this needs"))
    with caplog.at_level("INFO", logger="signedheat"):
        assert shifted() == (7.0, []) and not caplog.records
    assert {path.parts[-3] for path in cache.rglob("*.nbc")} == {path.name for path in carried.iterdir()}
    assert shifted(shift=2.0) == (8.0, ["shifted"])  # what it does not carry is compiled


def test_kernels_that_a_wheel_carries_need_no_folder_that_can_be_written(carried, shifted, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(compiled, "_folder_beside_the_source", lambda: tmp_path / "file")
    monkeypatch.setattr(Kernel, "is_kept", True)
    assert shifted() == (7.0, [])


@pytest.mark.parametrize("kind", ["*.nbi", "*.nbc"])
def test_damaged_kernels_in_a_wheel_are_compiled_again(carried, cache, shifted, kind):
    for path in carried.rglob(kind):
        path.write_bytes(b"x" * 100)
    value, told = shifted()
    assert value == 7.0 and told[-2:] == ["scaled", "shifted"]


def test_other_processors_compile_what_a_wheel_carries_and_say_so(carried, tmp_path):
    code = f"""
        from pathlib import Path
        from signedheat import compiled
        compiled.CARRIED = Path({str(carried)!r})
        import shifting
        assert shifting.shifted(3.0) == 7.0
        print(len(shifting.shifted.dispatcher.stats.cache_misses))
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "own")}
    generic = {"NUMBA_CPU_NAME": "generic"}
    for more, misses in (generic, "1"), ({}, "0"), ({"NUMBA_ENABLE_AVX": "0"}, "1"), (generic, "0"):
        command = [sys.executable, "-c", textwrap.dedent(code)]
        done = subprocess.run(
            command, cwd=tmp_path, env={**environment, **more}, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == misses
        assert ("compiling what this needs" in done.stderr) == (misses == "1")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="sets limits of the system's")
def test_full_disk(cache, tmp_path, shifted):
    """As one that takes no more than empty files."""
    shifted()
    code = """
        import resource, signal
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        import shifting
        assert shifting.shifted(3.0) == 7.0 and shifting.shifted(2.0) == 5.0
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "full")}
    child = [sys.executable, "-c", textwrap.dedent(code)]  # writes to a pipe, since no file takes its messages
    subprocess.run(child, cwd=tmp_path, env=environment, check=True, stderr=subprocess.PIPE)


@pytest.mark.parametrize("threads", ["0", "-1", "many", "1000000", "１", "²", "1_0", "9" * 5000])
def test_numbers_of_threads_that_are_none(monkeypatch, threads, cache, shifted):
    compiled._prepare.cache_clear()
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        shifted()
    assert caught.value.element == "NUMBA_NUM_THREADS" and caught.value.remedy
    with pytest.raises(sh.errors.SignedHeatError):
        n_threads()


def test_compiling_is_logged_once(cache, shifted, caplog, capfd, monkeypatch):
    """On the logger of the package, and nowhere else where nobody sits before it."""
    monkeypatch.setattr(compiled, "announce", type(compiled.announce)("compiling what this needs"))
    with caplog.at_level("INFO", logger="signedheat"):
        shifted()
        shifted(shift=5.0)
    assert [record.levelname for record in caplog.records if "compiling" in record.message] == ["INFO"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a terminal")
@pytest.mark.parametrize("wanted", [True, False])
def test_compiling_is_announced_on_a_terminal(tmp_path, wanted):
    code = textwrap.dedent(
        f"""
        from signedheat.compiled import announce, compiled
        announce.are_wanted = {wanted}
        @compiled
        def one(x):
            return x
        @compiled
        def two(x):
            return one(x)
        one(1), two(2)
        """
    )
    (tmp_path / "own.py").write_text(code)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run([sys.executable, tmp_path / "own.py"], stderr=theirs, env=environment, check=True, timeout=100)
    os.close(theirs)
    try:
        told = os.read(ours, 10_000).decode()
    except OSError:
        told = ""
    assert len(re.findall("compiling", told)) == (1 if wanted else 0)
