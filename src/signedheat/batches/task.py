"""What a worker is asked, and what it answers."""

from __future__ import annotations

import shutil
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import MemoryLimitError, SignedHeatError
from ..io.files import moved, replaceable, writing

Job = Callable[[Path, Path], Mapping[str, object]]
"""Called with a file and the beginning of the names of what it writes; returns figures, ready for JSON."""


@dataclass(frozen=True)
class Task:
    """One shape.

    Attributes
    ----------
    job : callable
        What is to be made of it.
    path : Path
        The file.
    stem : Path
        The beginning of the names of its results.
    scratch : Path
        A folder of its own, in which they are made: what is not finished never gets a name that stays.
    """

    job: Job
    path: Path
    stem: Path
    scratch: Path


@dataclass(frozen=True)
class Answer:
    """What came of a task.

    Attributes
    ----------
    error : str, optional
        What went wrong.
    starved : bool
        Whether memory was short, which it may not be once other workers have ended.
    seconds : float
        How long it took.
    outputs : tuple of str
        Names of the files beside the stem.
    figures : mapping
        Figures that the job returned.
    warnings : tuple of str
        Warnings, each once.
    """

    error: str | None = None
    starved: bool = False
    seconds: float = 0.0
    outputs: tuple[str, ...] = ()
    figures: Mapping[str, object] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def attempt(task: Task) -> Answer:
    """Do a task; errors become answers."""
    begin = time.perf_counter()
    outputs: tuple[str, ...] = ()
    figures: Mapping[str, object] = {}
    error, starved = None, False
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        try:
            shutil.rmtree(task.scratch, ignore_errors=True)  # of a worker that died
            task.scratch.mkdir(parents=True)
            figures = dict(task.job(task.path, task.scratch / task.stem.name))
            outputs = _moved(task.scratch, task.stem.parent)
        except MemoryError:
            error, starved = "there was not enough memory", True
        except (SignedHeatError, OSError) as problem:
            error, starved = " ".join(str(problem).split()), isinstance(problem, MemoryLimitError)
        except Exception as problem:
            error = " ".join(f"{type(problem).__name__}: {problem}".split())
        finally:
            shutil.rmtree(task.scratch, ignore_errors=True)
    said = tuple(dict.fromkeys(str(each.message) for each in caught if issubclass(each.category, UserWarning)))
    return Answer(error, starved, time.perf_counter() - begin, outputs, figures, said)


def _moved(scratch: Path, folder: Path) -> tuple[str, ...]:
    """Give what was made its place, all or nothing of it unless the disk breaks, and return the names."""
    made = sorted(scratch.iterdir())
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for file in made:
        with writing(folder / file.name):
            replaceable(folder / file.name)
    for file in made:
        moved(file, folder / file.name)
    return tuple(file.name for file in made)
