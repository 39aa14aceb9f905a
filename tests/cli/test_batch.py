"""``signedheat batch``, as a user meets it."""

import io
import json

import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "in").mkdir()
    samples.sphere(2).save(tmp_path / "in" / "ball.ply")
    (tmp_path / "in" / "bad.stl").write_bytes(b"nothing that makes sense")
    return tmp_path / "in"


def test_batch_makes_what_is_asked_for_and_says_what_failed(tmp_path, folder, capsys):
    out = tmp_path / "out"
    wanted = ["--volume", "--offset", "0.1", "-0.2", "--sample", "100", "--info", "--surface", "ply", "--normalize"]
    options = [*wanted, "--resolution", "16", "--workers", "1", "--time-limit", "200"]
    assert main(["batch", str(folder), "-o", str(out), *options, "--json"]) == 1
    printed, said = capsys.readouterr()
    assert said.count("\n") == 1 and "bad.stl: failed: " in said
    summary = json.loads(printed)
    assert summary["states"] == {"failed": 1, "done": 1} and summary["shapes"] == 2 and summary["skipped"] == 0
    names = {"ball.npz", "ball_samples.npz", "ball_+0.1.ply", "ball_-0.2.ply", "manifest.jsonl"}
    assert {path.name for path in out.iterdir()} == names
    assert max(sh.read_field(out / "ball.npz").domain.shape) == 16
    (folder / "bad.stl").unlink()
    assert main(["batch", str(folder), "-o", str(out), *options]) == 0
    assert "1 done (1 of them before)" in capsys.readouterr().out


@pytest.mark.usefixtures("in_this_process")
def test_a_list_on_standard_input(tmp_path, folder, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(f"{folder / 'ball.ply'}\n\n"))
    assert main(["batch", "-", "-o", str(tmp_path / "out"), "--info", "--workers", "1"]) == 0
    assert "1 shape, 1 done" in capsys.readouterr().out
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert main(["batch", "-", "-o", str(tmp_path / "out"), "--info"]) == 1
    assert "standard input" in capsys.readouterr().err


@pytest.mark.usefixtures("in_this_process")
def test_bands_of_many_shapes(tmp_path, folder, capsys):
    (folder / "bad.stl").unlink()
    out, options = tmp_path / "out", ["--resolution", "40", "--band", "0.3", "--workers", "1"]
    assert (
        main(["batch", str(folder), "-o", str(out), "--volume", "vdb", "--offset", "0.1", "--sample", "50", *options])
        == 0
    )
    names = {"ball.vdb", "ball.npz", "ball_+0.1.stl", "manifest.jsonl"}
    assert {path.name for path in out.iterdir()} == names
    lines = [json.loads(line) for line in (out / "manifest.jsonl").read_text().splitlines()]
    assert lines[0]["figures"]["field"]["band"] == 0.3
    for wrong in (["--volume", "nrrd"], ["--offset", "0.4"], ["--info", "--plain"]):
        assert main(["batch", str(folder), "-o", str(out), *wrong, *options]) == 2
