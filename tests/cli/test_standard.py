"""``-`` for standard input and output."""

import io
import json
import subprocess
import sys

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def run(monkeypatch, capsysbinary):
    """A command with what it reads on standard input: its status, and what it writes on both outputs."""

    def ran(*arguments, data=b""):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        return main(list(arguments)), *capsysbinary.readouterr()

    return ran


def test_a_shape_goes_through_a_pipe(tmp_path, run):
    """Of a process the first time."""
    ball = tmp_path / "ball.ply"
    samples.sphere(2).save(ball)
    arguments = ["--resolution", "20"]
    command = [
        sys.executable,
        "-m",
        "signedheat",
        "offset",
        "-",
        "0.5",
        "--from",
        "ply",
        "-o",
        "-",
        "--format",
        "obj",
        *arguments,
    ]
    done = subprocess.run(command, input=ball.read_bytes(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    (tmp_path / "grown.obj").write_bytes(done.stdout)
    assert np.linalg.norm(sh.read(tmp_path / "grown.obj").vertices, axis=1) == pytest.approx(1.5, abs=0.05)
    status, printed, _ = run("volume", "-", "--from", ".ply", "-o", "-", "--json", *arguments, data=ball.read_bytes())
    assert status == 0
    with np.load(io.BytesIO(printed)) as arrays:
        same = sh.signed_distance(sh.read(ball), resolution=20)
        np.testing.assert_array_equal(arrays["values"], same.values)
    told = json.loads(run("info", "-", "--from", "ply", "--json", data=ball.read_bytes())[1])
    assert told["file"] == "standard input" and told["n_vertices"] == 162


def test_what_goes_wrong_names_standard_input(tmp_path, run):
    status, _, said = run(
        "volume", "-", "--from", "ply", "-o", str(tmp_path / "a.npz"), data=b"ply\nformat ascii 1.0\nelement vertex 9\n"
    )
    assert status == 1 and said.startswith(b"signedheat: standard input: ") and said.count(b"\n") == 1
    status, _, said = run("volume", "-", "-o", str(tmp_path / "a.npz"))
    assert status == 1 and b"standard input" in said and b"--from" in said
    samples.sphere(1).save(tmp_path / "ball.ply")
    status, printed, said = run("offset", str(tmp_path / "ball.ply"), "0.1", "0.2", "-o", "-", "--resolution", "16")
    assert status == 2 and b"one surface" in said and printed == b""
    status, printed, said = run("offset", str(tmp_path / "ball.ply"), "0.1", "-o", "-", "--format", "txt")
    assert status == 1 and said.startswith(b"signedheat: standard output: ") and printed == b""


@pytest.mark.parametrize(
    "arguments", [["watertight", "x.stl"], ["batch", "x.stl", "--info"], ["view", "x.stl"], ["demo"]]
)
def test_commands_that_write_files_do_not_write_to_standard_output(run, arguments):
    status, out, err = run(*arguments, "-o", "-")
    assert status == 1 and not out and b"this command writes files" in err


def test_isolines_need_a_named_output(run):
    status, _, err = run("surface", "x.obj", "c.json", "-o", "-", "--contours", "3")
    assert status == 2 and b"--contours writes a file next to the output" in err
