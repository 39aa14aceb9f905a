"""Files that name their parts again and again: `expansions`; they are read or refused, soon, and in little memory."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import signedheat as sh
from expanding_files import EXPANSIONS
from fuzz.frame import Wrong, family

SECONDS, BYTES = 12.0, 1 << 30
"""Processor time and memory that a file may take: budgets are 10 s, and at most so many bytes; memory is seen to be
within twice as many."""


@dataclass(frozen=True)
class Expanding:
    """A file, what reads it, and its budget."""

    kind: str
    path: Path
    budget: sh.io.Budget

    def read(self) -> Any:
        """Read the file within its budget."""
        with self.budget:
            return EXPANSIONS[self.kind][2](self.path)


def build(random: np.random.Generator, folder: Path) -> Expanding:
    """A file of any number of levels, within a budget of memory, and often of something else."""
    kind = str(random.choice(list(EXPANSIONS)))
    name, write, _, levels = EXPANSIONS[kind]
    write(folder / name, int(random.integers(0, levels + 1)))
    limits: dict[str, Any] = {"bytes": BYTES, "seconds": 10.0}
    if random.random() < 0.5:
        limit = str(random.choice(["bytes", "elements", "points", "seconds"]))
        limits[limit] = 10.0 ** random.uniform(-3, 1) if limit == "seconds" else int(10.0 ** random.uniform(0, 9))
    return Expanding(kind, folder / name, sh.io.Budget(**limits))


def check(given: Expanding) -> str:
    """Read it, and see how long that takes; memory is counted by the frame."""
    begin = time.process_time()
    try:
        given.read()
    except sh.SignedHeatError as error:
        if error.path is None or Path(error.path).name != given.path.name:
            raise Wrong("no name", str(error)) from error
        kind = f"refused ({type(error).__name__})"
    else:
        kind = f"{given.kind} read"
    if time.process_time() - begin > SECONDS:
        raise Wrong("slow", f"{time.process_time() - begin:.1f} s")
    return kind


family("expansions", build, check, memory=2 * BYTES)
