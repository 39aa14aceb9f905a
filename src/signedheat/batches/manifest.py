"""The manifest of a batch: one line of JSON for each shape, written as soon as its task ends."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..io.files import contents, replacing, writing

State = Literal["done", "failed", "timed out", "died"]
"""How a task ended: all results written, an error, stopped at the time limit, or its process died."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of the job for one shape of a batch, which is a line of the manifest.

    Attributes
    ----------
    name : str
        Path of the results without extension, relative to the folder of the batch.
    input : str
        Path of the file of the shape.
    state : "done", "failed", "timed out" or "died"
        How the job ended: all results written, an error, stopped at the time limit, or its process died.
    seconds : float
        Seconds that it took.
    message : str
        The error, or if all results were written, important notes and warnings about them.
    outputs : tuple of str
        Files of the results, relative to the folder of the batch.
    figures : mapping
        The dictionary of figures that the job returned, such as sizes and counts.
    job : str
        A description of the job, with the version of this package.
    source : tuple of int
        Size of the file in bytes, and its time of modification in nanoseconds.

    See Also
    --------
    batches.run : Run a job on many shapes.
    batches.Batch : What became of all shapes.

    Examples
    --------
    >>> Outcome("ball", "parts/ball.stl", "failed", 0.1, "the file is empty").is_done
    False
    """

    name: str
    input: str
    state: State
    seconds: float
    message: str = ""
    outputs: tuple[str, ...] = ()
    figures: Mapping[str, object] = field(default_factory=dict)
    job: str = ""
    source: tuple[int, int] = (0, 0)

    @property
    def is_done(self) -> bool:
        """Whether all results were written."""
        return self.state == "done"


class Manifest:
    """The manifest in a folder, with the outcomes of earlier runs."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "manifest.jsonl"
        self.outcomes = _read(self.path)

    def earlier_outcome(self, name: str, path: Path, job: str) -> Outcome | None:
        """Return the outcome of a shape in an earlier run, or None if it must run again.

        It runs again unless it was done, file and job are the same, and all results still exist.
        """
        outcome = self.outcomes.get(name)
        if outcome is None or not outcome.is_done or outcome.job != job or outcome.source != source_of(path):
            return None
        return outcome if all((self.path.parent / output).is_file() for output in outcome.outputs) else None

    def add(self, outcome: Outcome) -> None:
        """Append an outcome to the file, and flush it to disk."""
        with writing(self.path), self.path.open("a", encoding="utf-8") as file:
            file.write(_line(outcome))
            file.flush()
            os.fsync(file.fileno())

    def write(self, outcomes: Iterable[Outcome]) -> None:
        """Replace the file by one with these outcomes."""
        with replacing(self.path) as temporary:
            temporary.write_text("".join(map(_line, outcomes)), encoding="utf-8")


def source_of(path: Path) -> tuple[int, int]:
    """Return the size of a file in bytes and its time of modification in nanoseconds; zeros if there is no file."""
    with suppress(OSError):
        status = path.stat()
        return status.st_size, status.st_mtime_ns
    return 0, 0


def _line(outcome: Outcome) -> str:
    """Return an outcome as a line of JSON.

    It is in ASCII if names of files hold line separators or bytes that are not text.
    """
    line = json.dumps(asdict(outcome), ensure_ascii=False)
    return (line if line.isprintable() else json.dumps(asdict(outcome))) + "\n"


def _read(path: Path) -> dict[str, Outcome]:
    """Read the outcomes in a manifest by the name of their results. Later lines count, damaged ones are skipped."""
    outcomes: dict[str, Outcome] = {}
    if not os.path.lexists(path) or (path.is_file() and not path.stat().st_size):
        return outcomes
    for line in contents(path).decode("utf-8", errors="replace").split("\n"):
        with suppress(ValueError, TypeError, KeyError, RecursionError):
            outcome = _outcome(json.loads(line))
            outcomes[outcome.name] = outcome
    return outcomes


def _outcome(entries: dict[str, Any]) -> Outcome:
    """Convert the entries of a line to an outcome; raise ValueError, TypeError or KeyError if they are damaged."""
    outcome = Outcome(**{**entries, "outputs": tuple(entries["outputs"]), "source": tuple(entries["source"])})
    texts = (outcome.name, outcome.input, outcome.state, outcome.message, outcome.job, *outcome.outputs)
    if not all(isinstance(text, str) and "\0" not in text for text in texts):
        raise TypeError("this is not an outcome")
    return outcome
