"""Compiled kernels on disk: kept, found by what they are made of, and never a reason to fail."""

from __future__ import annotations

import importlib
import importlib.util
import os
import pty
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import signedheat as sh
from signedheat import kernel_cache
from signedheat.compiled import announce

HALF = """
from signedheat.compiled import compiled

FACTOR = {factor}

@compiled
def scaled(x):
    return FACTOR * x

@compiled
def shifted(x):
    return scaled(x) + {shift}
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "signedheat"


@pytest.fixture
def shifted(tmp_path, monkeypatch):
    """Makes a kernel that calls another one, as a fresh process would; tells what was compiled."""
    compiled = []
    monkeypatch.setattr(type(announce), "__call__", lambda self, name: compiled.append(name.rpartition(".")[2]))

    def make(factor=2.0, shift=1.0):
        compiled.clear()
        path = tmp_path / "kernels.py"
        path.write_text(HALF.format(factor=factor, shift=shift))
        spec = importlib.util.spec_from_file_location("kernels", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.shifted(3.0), sorted(compiled)

    return make


def test_kept_by_what_they_are_made_of(cache, shifted):
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, [])
    assert shifted(shift=2.0) == (8.0, ["shifted"])
    assert shifted(factor=3.0, shift=2.0) == (11.0, ["scaled", "shifted"])  # a constant of a kernel that is called
    assert shifted() == (7.0, [])
    assert len(list(cache.iterdir())) == 5 and not list(cache.glob(".*"))


@pytest.mark.parametrize("damage", [b"", b"x" * 100, None])
def test_damaged_files_are_compiled_again(cache, shifted, damage):
    shifted()
    for path in cache.iterdir():
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2] if damage is None else damage)
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, [])


def test_what_can_be_read_and_not_understood_is_compiled_again(cache, shifted, monkeypatch):
    def renamed(data):
        raise AttributeError("module has no attribute of this name any more")

    shifted()
    monkeypatch.setattr(importlib.import_module("numba.core.serialize"), "loads", renamed)
    assert shifted() == (7.0, ["scaled", "shifted"])


def test_no_folder_can_be_written(tmp_path, shifted, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert shifted() == (7.0, ["scaled", "shifted"])


def test_full_disk(cache, shifted, monkeypatch):
    def full(self, data):
        with open(self, "wb") as file:
            file.write(data[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert shifted() == (7.0, ["scaled", "shifted"])
    assert list(cache.iterdir()) == []


def test_files_of_other_versions_go_after_a_while(cache, shifted):
    shifted()
    for path in cache.iterdir():
        os.utime(path, (0, 0))
    shifted(factor=5.0)
    assert len(list(cache.iterdir())) == 2


def test_folders(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first, *others = kernel_cache.folders()
    if sys.platform == "linux":
        assert first == tmp_path / "signedheat" / "kernels"
    assert others == [Path(kernel_cache.__file__).parent / "__pycache__"]


def test_several_processes_at_once(cache, tmp_path):
    code = HALF.format(factor=2.0, shift=1.0) + "\nimport sys\nprint(shifted(3.0), shifted(3))\n"
    (tmp_path / "own.py").write_text(code)
    jobs = [subprocess.Popen([sys.executable, tmp_path / "own.py"], stdout=subprocess.PIPE) for _ in range(4)]
    assert {job.communicate(timeout=200)[0] for job in jobs} == {b"7.0 7.0\n"}
    assert not list(cache.glob(".*"))


def test_digests_are_the_same_in_every_process():
    code = """
        import importlib, pkgutil
        import signedheat.operators
        from signedheat.compiled import Kernel, _parts
        from signedheat.kernel_cache import digest_of
        kernels = {}
        for module in pkgutil.walk_packages(signedheat.operators.__path__, "signedheat.operators."):
            kernels |= vars(importlib.import_module(module.name))
        kernels = {n: digest_of(k.function, k.options, _parts) for n, k in kernels.items() if isinstance(k, Kernel)}
        def constants(x):
            return x in ("one", "two") or x in {"three", "four", "five"}
        print(len(kernels) > 50, *sorted(kernels.items()), digest_of(constants, {}, _parts))
    """
    told = {
        subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            check=True,
            text=True,
        ).stdout
        for seed in ("1", "3")
    }
    assert len(told) == 1 and told.pop().startswith("True")


@pytest.mark.parametrize("threads", ["0", "-1", "many", "1000000"])
def test_numbers_of_threads_that_are_none(monkeypatch, threads, cache, shifted):
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    with pytest.raises(sh.SignedHeatError) as caught:
        shifted()
    assert caught.value.element == "NUMBA_NUM_THREADS" and caught.value.remedy


@pytest.mark.skipif(sys.platform == "win32", reason="needs a terminal")
@pytest.mark.parametrize("wanted", [True, False])
def test_compiling_is_announced_on_a_terminal(tmp_path, wanted):
    code = textwrap.dedent(
        f"""
        from signedheat.compiled import announce, compiled
        announce.is_wanted = {wanted}
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
