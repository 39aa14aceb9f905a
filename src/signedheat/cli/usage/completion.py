"""``signedheat completion``: what a shell needs to complete commands and options."""

from __future__ import annotations

from typing import Any

from .options import add_command


def add_to(commands: Any) -> None:
    """Register the command."""
    parser = add_command(
        commands,
        "completion",
        help="completion for bash and zsh",
        description="Prints what a shell needs to complete commands, options and files: in bash, put "
        "'eval \"$(signedheat completion bash)\"' into ~/.bashrc; for zsh, the same with zsh into ~/.zshrc, after "
        "compinit.",
    )
    parser.add_argument("shell", metavar="SHELL", choices=("bash", "zsh"), help="bash or zsh")
