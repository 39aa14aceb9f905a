"""Completion by argcomplete, as its shell function asks for it."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("argcomplete")


def offered(tmp_path, line):
    """What is offered at the end of a line."""
    told = tmp_path / "told"
    variables = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(told), "_ARGCOMPLETE_IFS": "\n"}
    variables |= {"COMP_LINE": line, "COMP_POINT": str(len(line)), "COMP_TYPE": "63", "_ARGCOMPLETE_SHELL": "bash"}
    subprocess.run([sys.executable, "-m", "signedheat"], env={**os.environ, **variables}, check=True)
    return told.read_text().split()


def test_commands_options_and_choices_are_completed(tmp_path):
    assert offered(tmp_path, "signedheat vol") == ["volume"]
    assert offered(tmp_path, "signedheat offset a.stl --pad") == ["--padding"]
    assert set(offered(tmp_path, "signedheat sample a.stl --layout ")) == {"arrays", "deepsdf"}
    assert "closing" in offered(tmp_path, "signedheat morph ")
