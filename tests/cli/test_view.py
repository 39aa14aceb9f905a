"""What `view` does where no window can be opened, and with drawings; which commands take drawings."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from PIL import Image as pillow

import signedheat as sh
from signedheat import samples
from signedheat.cli import main
from signedheat.cli import view_commands as view


@pytest.mark.parametrize("display", ["", ":77", "nonsense", "silent"])
def test_displays_that_do_not_answer_give_a_picture(tmp_path, monkeypatch, capsys, display):
    """VTK draws nowhere there, with two warnings and success."""
    samples.sphere(1).save(tmp_path / "ball.ply")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(view, "DISPLAY_SECONDS", 0.3)
    with socket.socket() as server:
        if display == "silent":
            for number in range(70, 170):  # an X server of this number listens at that port
                try:
                    server.bind(("127.0.0.1", 6000 + number))
                    break
                except OSError:
                    continue
            server.listen()
            display = f"127.0.0.1:{number}"
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
        assert main(["view", "ball.ply"]) == 0
    told = capsys.readouterr()
    assert told.out == "ball.png\n" and (tmp_path / "ball.png").exists()
    assert told.err.count("\n") == (1 if display else 0)


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "square.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0 L9 0 L9 9 L0 9 Z M2 2 L4 2"/></svg>')
    samples.sphere(1).save(tmp_path / "ball.stl")
    return path


def test_drawings_are_looked_at(drawing, tmp_path, capsys):
    picture = tmp_path / "lines.png"
    assert main(["view", str(drawing), "-o", str(picture)]) == 0
    red, green, _ = np.moveaxis(np.asarray(pillow.open(picture).convert("RGB")), 2, 0)
    assert ((red > 150) & (green < 80)).sum() > 1000, "no red lines"


@pytest.mark.parametrize("command", [
    "watertight {} -o out.stl", "fill {} -o out.stl", "surface {} {} -o out.ply", "close {} {} -o out.json",
    "union {} ball.stl -o out.stl", "sample {} -o out.npz", "morph dilate {} 1 -o out.stl", "thickness {}",
    "deviation {} ball.stl", "deviation ball.stl {}", "batch {} -o out --volume", "volume {} --tets -o out.vtu",
    "volume ball.stl --tets {} -o out.vtu",
])  # fmt: skip
def test_drawings_are_no_shapes_in_space(drawing, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    assert main(command.format(*[drawing.name] * 2).split()) == 1
    told = capsys.readouterr().err
    assert "square.svg: a drawing is no shape in space: measure distance to its lines" in told, told


@pytest.mark.parametrize("ending", [".svg", ".csv", ".dxf", ".geojson"])
def test_drawings_of_every_format_are_no_shapes_in_space(ending):
    with pytest.raises(sh.errors.FileFormatError) as caught:
        sh.read(f"drawing{ending}")
    assert "read_polylines" in caught.value.remedy
