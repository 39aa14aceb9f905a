"""What `view` does where no window can be opened."""

from __future__ import annotations

import socket

import pytest

from signedheat import samples
from signedheat.cli import main
from signedheat.cli import view_commands as view


@pytest.mark.parametrize("display", ["", ":77", "nonsense", "silent"])
def test_displays_that_do_not_answer_give_a_picture(tmp_path, monkeypatch, capsys, display):
    """VTK draws nowhere there, with two warnings and success."""
    samples.sphere(1).save(tmp_path / "ball.ply")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(view, "PATIENCE", 0.3)
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
