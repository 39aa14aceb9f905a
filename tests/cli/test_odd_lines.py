"""Every command with a file, a name or a number that is odd: a status that tells, and one line, never a traceback."""

from __future__ import annotations

import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main

LINES = {
    "volume": ["{file}", "-o", "{out}.vti"],
    "offset": ["{file}", "{number}", "-o", "{out}.stl"],
    "morph": ["dilate", "{file}", "{number}", "-o", "{out}.stl"],
    "fill": ["{file}", "-o", "{out}.stl"],
    "sample": ["{file}", "-o", "{out}.npz"],
    "section": ["{file}", "-o", "{out}.svg"],
    "cut": ["{file}", "-o", "{out}.stl"],
    "surface": ["{file}", "{curves}", "-o", "{out}.vtp"],
    "close": ["{file}", "{curves}", "-o", "{out}.obj"],
    "contour": ["{field}", "{number}", "-o", "{out}.stl"],
    "info": ["{file}"],
    "view": ["{file}", "-o", "{out}.png"],
}
WRITING = sorted(set(LINES) - {"info"})
NUMBERS = {
    "volume": ["--resolution", "--spacing", "--padding", "--band", "--diffusion"],
    "offset": ["--resolution", "--spacing", "--padding", "--diffusion"],
    "morph": ["--resolution", "--spacing", "--padding", "--diffusion"],
    "fill": ["--largest", "--rims"],
    "sample": ["--samples", "--diffusion"],
    "section": ["--origin", "--normal", "--heights"],
    "cut": ["--origin", "--normal"],
    "surface": ["--contours", "--diffusion"],
    "close": ["--diffusion"],
    "info": ["--resolution"],
    "demo": ["--resolution"],
}
BATCH = ["batch", "--quiet", "--info", "--volume", "--sample", "9", "--workers", "1"]
NUMBERS_OF_BATCHES = ["--resolution", "--spacing", "--padding", "--band", "--diffusion", "--time-limit", "--workers"]
NUMBERS_OF_BATCHES += ["--threads", "--near", "--widths", "--seed", "--offset", "--sample"]
ODD_FILES = [
    "missing.stl",
    "folder",
    "folder.stl",
    "empty.stl",
    "text.stl",
    "shape.xyzzy",
    "shape",
    "",
    "\0.stl",
    "ä" * 300,
]
ODD_OUTPUTS = ["missing/made", "folder", "ä" * 300, "empty.stl/made"]
ODD_NUMBERS = ["nan", "-inf", "1e400", "-1", "abc", "", "0x10", "1,5", "٣x", "9" * 400]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("odd")
    for ending in ("", ".stl", ".vti", ".npz", ".vtp", ".obj", ".png", ".svg", "_above.stl"):
        (made / f"folder{ending}").mkdir()
    (made / "empty.stl").touch()
    for name in ("text.stl", "shape.xyzzy", "shape"):
        (made / name).write_text("what\nis this\n")
    ball = samples.sphere(1)
    sh.save(ball, made / "ball.stl")
    (made / "curves.csv").write_text("1,0,0\n0,1,0\n")
    sh.SignedHeatSolver(sh.Grid.around(ball, 6)).distance(ball).save(made / "field.npz")
    return made


def ended(folder, capsys, command, changed, *options):
    """The status of a command whose parts are as they should be, but for one."""
    parts = {"file": "ball.stl", "curves": "curves.csv", "field": "field.npz", "number": "0.1", "out": "made"} | changed
    paths = {name: part if name == "number" or not part else f"{folder}/{part}" for name, part in parts.items()}
    status = main([command, *(part.format(**paths) for part in LINES.get(command, [])), "--quiet", *options])
    told = capsys.readouterr().err
    assert "Traceback" not in told
    last = told.rstrip("\n").rpartition("\n")[2]
    assert status in (1, 2) and last.startswith("signedheat") and "bug" not in last, (status, told, changed, options)
    return status


@pytest.mark.parametrize("command", LINES)
def test_odd_inputs(folder, capsys, command):
    names = {part.strip("{}") for part in LINES[command]} & {"file", "curves", "field"}
    for name in names:
        for odd in ODD_FILES:
            assert ended(folder, capsys, command, {name: odd}) in (1, 2)


@pytest.mark.parametrize("command", WRITING)
def test_odd_outputs(folder, capsys, command):
    for odd in ODD_OUTPUTS:
        ended(folder, capsys, command, {"out": odd})
    assert ended(folder, capsys, command, {}, "--output", f"{folder}/made.xyzzy") in (1, 2)
    assert not list(folder.glob("made*"))


@pytest.mark.parametrize("command", NUMBERS)
def test_odd_numbers(folder, capsys, command):
    for option in NUMBERS[command]:
        for odd in ODD_NUMBERS:
            assert ended(folder, capsys, command, {}, f"{option}={odd}") in (1, 2), (option, odd)


@pytest.mark.parametrize("out", ["", "/", ".", "..", "folder/", ".stl"])
def test_names_for_several_distances_that_are_none(folder, capsys, monkeypatch, out):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    assert ended(folder, capsys, "offset", {"out": ""}, "--output", out, "--", "0.1", "0.2") in (1, 2)
    assert sorted(folder.iterdir()) == before


def test_distances_that_nearly_agree_get_files_of_their_own(folder, monkeypatch):
    """One would be written over the other, without a word."""
    monkeypatch.chdir(folder)
    distances = ["0.1234567", "0.1234568", "0.2"]
    assert main(["offset", "ball.stl", *distances, "--resolution", "8", "--quiet", "-o", "near.stl"]) == 0
    written = sorted(folder.glob("near*"))
    assert [path.name for path in written] == [f"near_+{distance}.stl" for distance in distances]
    for path in written:
        path.unlink()


@pytest.mark.parametrize("odd", ["", ".", "../x", "a/b", "p ly", "\0", "ply\n"])
def test_odd_formats_of_standard_input(folder, capsys, odd):
    assert ended(folder, capsys, "info", {}, "-", "--from", odd) == 2


def told_by_batch(capsys, *options):
    """The status of a batch, and what it has told."""
    status, told = main([*BATCH, *options]), capsys.readouterr().err.splitlines()
    assert not any("Traceback" in line or "bug" in line for line in told), told
    assert all(line.startswith("signedheat") for line in told), told
    return status, told


@pytest.mark.usefixtures("in_this_process")
def test_batch_of_odd_files(folder, capsys):
    odd = ["missing.stl", "empty.stl", "text.stl", "shape.xyzzy", "shape"]
    status, told = told_by_batch(capsys, *(f"{folder}/{name}" for name in odd), "-o", f"{folder}/many")
    assert status == 1 and len(told) == len(odd)
    for name in ("", "\0.stl", "ä" * 300, f"{folder}/folder", f"{folder}/*.xyz"):
        status, told = told_by_batch(capsys, name, "-o", f"{folder}/none")
        assert status == 1 and len(told) == 1 and not (folder / "none").exists()


@pytest.mark.parametrize("out", ["", "ball.stl", "ball.stl/made", "ä" * 300, "\0"])
def test_odd_folders_of_batches(folder, capsys, monkeypatch, out):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    status, told = told_by_batch(capsys, "ball.stl", "-o", out)
    assert status == 1 and len(told) == 1 and sorted(folder.iterdir()) == before


@pytest.mark.parametrize("option", NUMBERS_OF_BATCHES)
def test_odd_numbers_of_batches(folder, capsys, option):
    for odd in set(ODD_NUMBERS) - {"-1", "9" * 400} | {"-0.5x"}:
        status, told = told_by_batch(capsys, f"{folder}/ball.stl", "-o", f"{folder}/none", f"{option}={odd}")
        assert status == 2 and len(told) == 1, (option, odd, told)
    assert not (folder / "none").exists()


def test_batches_that_cannot_be_timed(folder, capsys):
    status, told = told_by_batch(capsys, f"{folder}/ball.stl", "-o", f"{folder}/none", "--time-limit=1e30")
    assert status == 1 and len(told) == 1 and not (folder / "none").exists()


@pytest.mark.parametrize("command", ["offset", "morph", "contour"])
@pytest.mark.parametrize("odd", ["nan", "inf", "abc", "", "1e400"])
def test_odd_distances(folder, capsys, command, odd):
    assert ended(folder, capsys, command, {"number": odd}) in (1, 2)
