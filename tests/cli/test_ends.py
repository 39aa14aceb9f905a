"""However a command ends: one line, a status that tells why, and no traceback."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main, reports
from signedheat.cli.options import PLANAR
from signedheat.io.drawing_files import POLYLINE_READERS

COMMAND = [sys.executable, "-m", "signedheat"]


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    path = tmp_path_factory.mktemp("ends") / "bäll.stl"
    sh.save(samples.sphere(2), path)
    return path


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    """What `info` describes without compiled code."""
    path = tmp_path_factory.mktemp("ends") / "φ.npz"
    sh.Field(sh.Grid((0, 0), 1.0, (3, 3)), np.arange(9.0).reshape(3, 3)).save(path)
    return path


def run(*arguments, **options):
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 100, **options}
    return subprocess.run([*COMMAND, *map(str, arguments)], text=True, **options)


def assert_one_line(text):
    assert text.startswith("signedheat") and text.count("\n") == 1 and "Traceback" not in text


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["volume", "--help"], ["morph", "shell", "a", "1"]])
def test_help_and_bad_usage_come_before_anything_is_imported(arguments):
    code = "import sys, signedheat.cli as cli; status = cli.main(sys.argv[1:]); print(status, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=100)
    status = 2 if "morph" in arguments else 0
    assert done.stdout.splitlines()[-1] == f"{status} False", done.stderr


def test_usage_knows_the_formats_of_polylines():
    assert set(PLANAR) == set(POLYLINE_READERS)


def test_output_that_cannot_hold_the_text(ball, tmp_path):
    done = run("volume", ball, "-o", tmp_path / "phi.npz", "--resolution", 6, env={**os.environ, "LC_ALL": "C",
               "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"})  # fmt: skip
    assert done.returncode == 0 and "6 x 6 x 6 nodes" in done.stdout and "phi from" in done.stdout, done.stderr
    assert (tmp_path / "phi.npz").exists()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_full_output(field):
    with open("/dev/full", "w") as full:
        done = run("info", field, stdout=full)
    assert done.returncode == 1
    assert_one_line(done.stderr)


@pytest.mark.skipif(sys.platform == "win32", reason="closes file descriptors")
def test_closed_output_and_errors(field):
    done = run("info", field, stdout=None, preexec_fn=lambda: os.close(1))
    assert done.returncode == 1
    assert_one_line(done.stderr)
    assert run("info", field, "--quiet", stdout=None, preexec_fn=lambda: os.close(1)).returncode == 0
    assert run("info", "nowhere.stl", stderr=None, preexec_fn=lambda: os.close(2)).returncode == 1


def test_a_reader_that_has_read_enough(field):
    reading, writing = os.pipe()
    os.close(reading)
    done = run("info", field, stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("error", [KeyError("x"), RecursionError("deep\ndown"), AttributeError("no 'x'")])
def test_what_nobody_expected_is_called_a_bug(ball, capsys, monkeypatch, error):
    def fail(path):
        raise error

    monkeypatch.setattr(reports, "read", fail)
    assert main(["info", str(ball)]) == 70
    told = capsys.readouterr().err
    assert_one_line(told)
    assert type(error).__name__ in told and "test_ends.py" in told and sh.__version__ in told
    monkeypatch.setenv("SIGNEDHEAT_TRACEBACK", "1")
    with pytest.raises(type(error)):
        main(["info", str(ball)])


@pytest.mark.parametrize("error", [MemoryError(), OSError(28, "No space left on device"), UserWarning("it\nis odd")])
def test_what_is_due_to_the_system_is_told(ball, capsys, monkeypatch, error):
    def fail(path):
        raise error

    monkeypatch.setattr(reports, "read", fail)
    assert main(["info", str(ball)]) == 1
    assert_one_line(capsys.readouterr().err)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_stop_with_one_line_whatever_becomes_of_them(ball, capsys, monkeypatch, number):
    def stopped(path):
        try:
            os.kill(os.getpid(), number)
            time.sleep(5)
        except BaseException:
            raise ImportError("as some packages do") from None

    monkeypatch.setattr(reports, "read", stopped)
    before = signal.getsignal(number)
    assert main(["info", str(ball)]) == 128 + number
    assert_one_line(capsys.readouterr().err)
    assert signal.getsignal(number) is before


def test_what_other_packages_print_about_damaged_files_is_left_out(ball, tmp_path, capfd):
    path = tmp_path / "cut.msh"
    path.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1 1 1\n3 1 0 1\n1\n0 0 0\n")
    assert main(["info", str(path)]) == 1
    assert_one_line(capfd.readouterr().err)


@pytest.mark.parametrize(
    "options",
    [
        ["volume", "--transform", "x\0y"],
        ["volume", "--transform", "/dev/zero"],
        ["volume", "--transform", *["inf"] * 12],
        ["sample", "--samples", "1" + "0" * 20],
        ["sample", "--samples", "1" + "0" * 5000],
        ["surface", "--contours", "1" + "0" * 20],
    ],
)
def test_options_beyond_reason_are_refused_in_one_line(ball, tmp_path, capsys, options):
    command, *given = options
    curves = ["curves.json"] if command == "surface" else []
    assert main([command, str(ball), *curves, "-o", str(tmp_path / "a.npz"), "--quiet", *given]) in (1, 2)
    assert_one_line(capsys.readouterr().err)


def test_names_that_are_no_text(tmp_path):
    name = os.fsdecode(b"b\xe4ll.stl")
    done = run("info", name, cwd=tmp_path)
    assert done.returncode == 1
    assert_one_line(done.stderr)


def test_streams_without_a_file(monkeypatch, ball):
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert main(["info", str(ball), "--json"]) == 0
    assert sys.stdout.getvalue().startswith("{")
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["info", str(ball)]) == 1
