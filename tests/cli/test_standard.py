"""``-`` for standard input and output, in processes of their own."""

import io
import json
import subprocess
import sys

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli.standard import sniffed


def run(*arguments, data=b""):
    command = [sys.executable, "-m", "signedheat", *arguments]
    return subprocess.run(command, input=data, capture_output=True, check=False)


@pytest.mark.parametrize("ending", [".stl", ".obj", ".ply", ".off", ".vtp"])
def test_formats_are_told_from_their_beginning(tmp_path, ending):
    path = tmp_path / f"ball{ending}"
    samples.sphere(1).save(path)
    assert sniffed(path.read_bytes()) == ending


def test_points_curves_and_fields_too(tmp_path):
    for name in ("a.xyz", "a.pc"):
        samples.oriented_points(samples.sphere(1), 20).save(tmp_path / name)
    assert sniffed((tmp_path / "a.xyz").read_bytes()) == ".xyz"
    assert sniffed((tmp_path / "a.pc").read_bytes()) == ".obj"  # which reads the same lines
    sh.io.write_polylines(tmp_path / "a.svg", [sh.Polyline([[0, 0], [1, 0], [1, 1]], closed=True)])
    assert sniffed((tmp_path / "a.svg").read_bytes()) == ".svg"
    assert sniffed(b"0,1\n2,3\n") == ".csv"
    for nothing in (b"", b"what is this\n", b"\0\1\2"):
        with pytest.raises(sh.errors.FileFormatError) as caught:
            sniffed(nothing)
        assert caught.value.path == "standard input"


def test_a_shape_goes_through_a_pipe(tmp_path):
    ball = tmp_path / "ball.ply"
    samples.sphere(2).save(ball)
    arguments = ["--resolution", "20"]
    done = run("offset", "-", "0.5", "-o", "-", "--format", "obj", *arguments, data=ball.read_bytes())
    assert done.returncode == 0, done.stderr
    (tmp_path / "grown.obj").write_bytes(done.stdout)
    assert np.linalg.norm(sh.read(tmp_path / "grown.obj").vertices, axis=1) == pytest.approx(1.5, abs=0.05)
    done = run("volume", "-", "-o", "-", "--json", *arguments, data=ball.read_bytes())
    with np.load(io.BytesIO(done.stdout)) as arrays:
        same = sh.signed_distance(sh.read(ball), resolution=20)
        np.testing.assert_array_equal(arrays["values"], same.values)
    told = json.loads(run("info", "-", "--json", data=ball.read_bytes()).stdout)
    assert told["file"] == "standard input" and told["n_vertices"] == 162


def test_what_goes_wrong_names_standard_input(tmp_path):
    done = run("volume", "-", "-o", str(tmp_path / "a.npz"), data=b"ply\nformat ascii 1.0\nelement vertex 9\n")
    assert done.returncode == 1 and done.stderr.startswith(b"signedheat: standard input: ")
    assert done.stderr.count(b"\n") == 1
    done = run("volume", "-", "-o", str(tmp_path / "a.npz"))
    assert done.returncode == 1 and b"standard input" in done.stderr
    samples.sphere(1).save(tmp_path / "ball.ply")
    done = run("offset", str(tmp_path / "ball.ply"), "0.1", "0.2", "-o", "-", "--resolution", "16")
    assert done.returncode == 2 and b"one surface" in done.stderr and done.stdout == b""
    done = run("offset", str(tmp_path / "ball.ply"), "0.1", "-o", "-", "--format", "txt")
    assert done.returncode == 1 and done.stderr.startswith(b"signedheat: standard output: ") and done.stdout == b""
