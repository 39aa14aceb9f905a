"""Families that fail, to test the frame; hidden from `python -m fuzz` unless they are named."""

from __future__ import annotations

import os
import signal
import time
from functools import partial
from pathlib import Path

import numpy as np

from fuzz.frame import Wrong, family
from signedheat.errors import GeometryError


def build(random: np.random.Generator, folder: Path) -> float:
    """A number."""
    return float(random.random())


def _say(word: str, _: float) -> str:
    return word


def _refuse(_: float) -> str:
    raise GeometryError("it is broken")


def _wrong(number: float) -> str:
    raise Wrong("changed input", f"{number}")


def _warn(number: float) -> str:
    return f"{np.float64(number) / np.float64(0.0)}"


def _hang(_: float) -> str:
    time.sleep(100)
    return "late"


def _compute(_: float) -> str:
    while True:
        pass


def _crash(_: float) -> str:
    os.kill(os.getpid(), signal.SIGSEGV)
    return "alive"


def _grow(number: float) -> str:
    return "grown" if np.full(1 << 23, number).any() else "empty"


family("frame right", build, partial(_say, "fine"))
family("frame refused", build, _refuse)
family("frame wrong", build, _wrong)
family("frame exception", build, lambda number: {}[str(number)])
family("frame warning", build, _warn)
family("frame hang", build, _hang)
family("frame busy", build, _compute)
family("frame crash", build, _crash)
family("frame memory", build, _grow, memory=1 << 25)
