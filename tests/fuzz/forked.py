"""Parsers of other packages in processes that are forked, not started: a hundred files a second in place of a few.

This process imports the packages. A child of it does what a parser's own process does, with the same limits, but that
what it holds when it begins is not counted in its memory.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from signedheat.io import parsers, sandbox

PACKAGES = {
    "las": ("laspy", "lazrs"),
    "e57": ("pye57",),
    "step": ("OCP.STEPControl", "OCP.BRepMesh", "OCP.TopoDS"),
    "dae": ("trimesh", "collada"),
    "cells": ("meshio",),
    "nifti": ("nibabel",),
    "dxf": ("ezdxf",),
}
"""What each parser imports."""


class Forked:
    """A child, in place of the `subprocess.Popen` of `sandbox`."""

    def __init__(self, command: list[str], *, stderr: Any, **_: object) -> None:
        *_, function, path, options, memory, seconds = command
        for name in PACKAGES[function]:
            with suppress(ImportError):
                import_module(name)
        receiver, sender = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python 3.12 warns where there are threads
            self.pid, self.returncode = os.fork(), None
        if not self.pid:
            try:
                os.dup2(sender, 1)
                os.dup2(stderr.fileno(), 2)
                parsers.main(function, path, options, str(int(memory) + held()), seconds)
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(1)
        os.close(sender)
        self.stdout = os.fdopen(receiver, "rb")

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *_: object) -> None:
        self.stdout.close()
        self.wait()

    def wait(self, _: float | None = None) -> None:
        """Wait until it has ended: once its answer has been read, nothing is left to do."""
        if self.returncode is None:
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def kill(self) -> None:
        """End it, unless it has been waited for."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)


def held() -> int:
    """Bytes of data that this process has, as its limit counts them."""
    return 1024 * int(Path("/proc/self/status").read_text().partition("VmData:")[2].split()[0])


@contextmanager
def forked() -> Iterator[None]:
    """Parsers are forked from this process, on Linux."""
    changed = SimpleNamespace(**{**vars(subprocess), "Popen": Forked})
    with patch.object(sandbox, "subprocess", changed) if sys.platform == "linux" else nullcontext():
        yield
