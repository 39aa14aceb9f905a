"""Completion, by a bash that sources the script."""

import shutil
import subprocess

import pytest

from signedheat.cli import main
from signedheat.cli.options import parser_of
from signedheat.cli.shell import COMMANDS, commands_of

BASH = shutil.which("bash")


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """What bash offers after some words."""
    script = tmp_path_factory.mktemp("completion") / "script"

    def ask(capsys, *words):
        assert main(["completion", "bash"]) == 0
        script.write_text(capsys.readouterr().out)
        call = 'source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($#-1)); _signedheat; printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run([BASH, "-c", call, script, *words], capture_output=True, text=True, check=True)
        assert done.stderr == ""
        return done.stdout.split()

    return ask


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_bash_completes_commands_options_and_choices(complete, capsys):
    assert complete(capsys, "signedheat", "vol") == ["volume"]
    assert set(complete(capsys, "signedheat", "")) == set(commands_of(parser_of(COMMANDS)))
    assert complete(capsys, "signedheat", "offset", "a.stl", "--pad") == ["--padding"]
    assert complete(capsys, "signedheat", "sample", "--layout", "") == ["arrays", "deepsdf"]
    assert "closing" in complete(capsys, "signedheat", "morph", "")
    assert complete(capsys, "signedheat", "volume", "") == []  # files, which bash itself offers


@pytest.mark.skipif(shutil.which("zsh") is None, reason="there is no zsh")
def test_zsh_takes_the_script(capsys):
    assert main(["completion", "zsh"]) == 0
    subprocess.run(["zsh", "-n"], input=capsys.readouterr().out, text=True, check=True)


def test_every_command_and_option_is_in_the_script(capsys):
    assert main(["completion", "zsh"]) == 0
    text = capsys.readouterr().out
    for name, command in commands_of(parser_of(COMMANDS)).items():
        assert f"{name}) offered=" in text
        assert all(option in text for action in command._actions for option in action.option_strings)
