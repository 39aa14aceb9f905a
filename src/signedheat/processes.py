"""Functions of this package that run in Python processes of their own."""

from __future__ import annotations

import json
import os
import sys

RUN = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from importlib import import_module; "
    "module, name = sys.argv[2].split(':'); getattr(import_module(module), name)(*sys.argv[3:])"
)
"""What such a process runs. It is isolated first, and gets the path afterwards."""


def command_for(entry: str, *arguments: str) -> list[str]:
    """The command that calls a function in a new Python process.

    The process imports what this one can import, but nothing from the current folder: neither ``python -c`` nor
    `multiprocessing` can promise that, because they search this folder before they search anything else.

    Parameters
    ----------
    entry : str
        The function, as ``"module:name"``.
    arguments : str
        What it is called with.

    Examples
    --------
    >>> import subprocess
    >>> subprocess.run(command_for("builtins:print", "a b"), capture_output=True).stdout.decode().strip()
    'a b'
    """
    path = [os.path.abspath(folder) for folder in sys.path if folder]
    return [sys.executable, "-I", "-c", RUN, json.dumps(path), entry, *arguments]
