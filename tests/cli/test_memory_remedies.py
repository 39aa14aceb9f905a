"""What a command says that would fit in memory does: it is done as it says, until it is done."""

import re

import pytest

import signedheat as sh
from signedheat import memory, samples
from signedheat.cli import main
from signedheat.io import files
from signedheat.io import shape_files as shapes

LINES = 3
"""Refusals after which a command must be done: its parts are refused one by one."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    samples.sphere(3).save(tmp_path / "ball.ply")
    samples.without_patches(samples.sphere(3), 3, 0.2).save(tmp_path / "holes.ply")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told_by(error):
    """The options that an error asks for, in the place of those that were given."""
    line = error.strip().splitlines()[-1]
    assert line.startswith("signedheat: ") and "GB" in line, error
    spacing = re.search(r"spacing of ([0-9.e-]+)", line)
    resolution = re.search(r"resolution from [0-9]+ to (?:at most )?([0-9]+)", line)
    assert spacing or resolution, line
    return ["--spacing", spacing.group(1)] if spacing else ["--resolution", resolution.group(1)]


@pytest.mark.parametrize(
    ("command", "size", "megabytes"),
    [
        ("volume ball.ply -o out.npz", "--resolution 700", 95),
        ("volume holes.ply -o out.npz", "--resolution 700", 60),
        ("volume holes.ply -o out.npz --plain", "--spacing 1e-6", 60),
        ("volume holes.ply -o out.vtu --tets", "--resolution 500", 120),
        ("volume holes.ply -o out.npz --band 0.02", "--spacing 1e-7", 60),
        ("volume ball.ply -o out.npz --band 0.02", "--spacing 2e-3", 145),
        ("thickness ball.ply -o out.npz", "--resolution 700", 60),
        ("offset holes.ply 0.1 -o out.stl", "--resolution 700", 60),
        ("morph dilate ball.ply 0.1 -o out.stl", "--resolution 700", 60),
        ("morph shell ball.ply 0 0.2 -o out.stl", "--resolution 700", 60),
        ("morph thicken holes.ply 0.3 -o out.stl", "--resolution 700", 8),
    ],
)
def test_what_is_told_to_fit_does(folder, command, size, megabytes, monkeypatch, capsys):
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + megabytes * 1_000_000)
    options = size.split()
    assert main([*command.split(), *options]) == 1
    for _ in range(LINES):
        options = told_by(capsys.readouterr().err)
        if main([*command.split(), *options]) == 0:
            break
    else:
        pytest.fail(capsys.readouterr().err)
    assert len(list(folder.glob("out.*"))) == 1


@pytest.mark.parametrize("command", ["surface", "close"])
def test_surfaces_of_as_many_triangles_as_are_told_fit(folder, command, monkeypatch, capsys):
    (folder / "curve.csv").write_text("0.6,0,0.8\n0,0.6,0.8\n-0.6,0,0.8\n0,-0.6,0.8\n0.6,0,0.8\n")
    output = {"surface": "out.ply", "close": "out.json"}[command]
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 1_500_000)
    assert main([command, "ball.ply", "curve.csv", "-o", output]) == 1
    most = int(re.search(r"at most ([0-9,]+) triangles", capsys.readouterr().err).group(1).replace(",", ""))
    coarser = next(ball for ball in map(samples.sphere, (2, 1, 0)) if ball.n_faces <= most)
    coarser.save(folder / "ball.ply")
    assert main([command, "ball.ply", "curve.csv", "-o", output]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("ending", [*files.BYTES_PER_FILE_BYTE, ".obj", ".glb"])
def test_files_that_would_not_fit_while_they_are_read_are_refused(tmp_path, ending, monkeypatch):
    """By their size, or by what they announce."""
    path = tmp_path / f"ball{ending}"
    ball = samples.sphere(4)
    if ending == ".glb":
        ball.to_trimesh().export(path)
    else:
        (samples.oriented_points(ball, 5000) if ending == ".xyz" else ball).save(path)
    size, taken = path.stat().st_size, files.BYTES_PER_FILE_BYTE.get(ending, 40)
    least = {".obj": 900_000, ".glb": 500_000}.get(ending, (taken - 1) * size)
    monkeypatch.setattr(memory, "_free", lambda: least)
    with pytest.raises(sh.errors.MemoryLimitError) as caught:
        sh.read(path)
    assert caught.value.path == str(path) and caught.value.remedy
    monkeypatch.setattr(memory, "_free", lambda: (taken + 1) * size)
    sh.read(path)


def test_surfaces_of_too_many_faces_to_do_anything_with_are_refused(tmp_path, monkeypatch):
    ball = samples.sphere(5)
    ball.save(tmp_path / "ball.ply")
    monkeypatch.setattr(shapes, "CHECKED_FACES", 1000)
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 1_000_000)
    monkeypatch.setattr(files, "BYTES_PER_FILE_BYTE", {})
    with pytest.raises(sh.errors.MemoryLimitError) as caught:
        sh.read(tmp_path / "ball.ply")
    most = int(re.search(r"at most ([0-9,]+) faces", caught.value.remedy).group(1).replace(",", ""))
    assert 1000 < most < ball.n_faces


def test_where_faces_alone_take_all_memory_no_spacing_is_told(folder, monkeypatch, capsys):
    samples.sphere(5).save(folder / "ball.ply")
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 2_000_000)
    assert main(["volume", "ball.ply", "-o", "out.npz"]) == 1
    told = capsys.readouterr().err
    assert "simplify it" in told and "spacing" not in told
