"""``signedheat completion``: what a shell needs to complete commands and options."""

from __future__ import annotations

import argparse
from argparse import Namespace
from typing import Any

from .options import Summary, add_command

BASH = """_signedheat() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" offered=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        offered="{commands}"
    else
        case "${{COMP_WORDS[1]}} $before" in
{choices}
            *) case "${{COMP_WORDS[1]}}" in
{options}
            esac
        esac
    fi
    case "$word" in
        -*) ;;
        *) [ "$COMP_CWORD" -gt 1 ] && case "$offered" in -*) offered="" ;; esac ;;
    esac
    mapfile -t COMPREPLY < <(compgen -W "$offered" -- "$word")
}}
complete -o default -o bashdefault -F _signedheat signedheat
"""
"""Options and choices; where there are none, files."""
ZSH = """autoload -U +X bashcompinit && bashcompinit
{bash}"""


def add_to(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "completion",
        run,
        help="completion for bash and zsh",
        description="Prints what a shell needs to complete commands, options and files: in bash, put "
        "'eval \"$(signedheat completion bash)\"' into ~/.bashrc; for zsh, the same with zsh into ~/.zshrc, after "
        "compinit.",
    )
    parser.add_argument("shell", metavar="SHELL", choices=("bash", "zsh"), help="bash or zsh")


def run(arguments: Namespace) -> Summary:
    """Print the script for a shell."""
    script = script_for(arguments.whole, arguments.shell)
    return {"shell": arguments.shell, "script": script}, script.rstrip()


def script_for(whole: argparse.ArgumentParser, shell: str) -> str:
    """The script that makes a shell complete what the whole parser takes."""
    commands = commands_of(whole)
    choices, options = [], []
    for name, command in commands.items():
        named = [action for action in command._actions if action.option_strings]
        options.append(f'                {name}) offered="{" ".join(o for a in named for o in a.option_strings)}" ;;')
        for action in named:
            if action.choices:
                keys = "|".join(f'"{name} {option}"' for option in action.option_strings)
                choices.append(f'            {keys}) offered="{" ".join(map(str, action.choices))}" ;;')
        places = [action for action in command._actions if not action.option_strings and action.choices]
        if places:
            choices.append(f'            "{name} {name}") offered="{" ".join(map(str, places[0].choices or ()))}" ;;')
    bash = BASH.format(commands=" ".join(commands), choices="\n".join(choices), options="\n".join(options))
    if shell == "bash":
        return bash
    listed = bash.replace('mapfile -t COMPREPLY < <(compgen -W "$offered" -- "$word")', ZSH_REPLY)
    return ZSH.format(bash=listed)


ZSH_REPLY = 'COMPREPLY=($(compgen -W "$offered" -- "$word"))'
"""zsh has no mapfile."""


def commands_of(whole: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parsers of the commands, by name."""
    for action in whole._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}
