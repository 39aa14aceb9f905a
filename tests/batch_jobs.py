"""Jobs that fail in every way, for workers to import."""

from __future__ import annotations

import os
import pickle
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat.batches.pool import Done, Task
from signedheat.compiled import _folder_of_this_process


def measure(path: Path, stem: Path) -> dict[str, object]:
    """Does what the name of the file says; otherwise writes two files and returns a figure."""
    name = path.stem
    Path(f"{stem}.begun").write_text("half")
    if name.startswith("slow"):
        time.sleep(60)
    if name.startswith("killed"):
        path.with_suffix(".own").write_text(_folder_of_this_process().name)
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("crashed"):
        os._exit(3)
    if name.startswith("wrong"):
        raise sh.errors.GeometryError("there is\nno face", remedy="add one")
    if name.startswith("bug"):
        raise KeyError("missing")
    if name.startswith("loud"):
        print("on standard output")
    if name.startswith("hungry") and not path.with_suffix(".fed").exists():
        path.with_suffix(".fed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    Path(f"{stem}.txt").write_text(path.read_text())
    return {"length": len(path.read_text()), "notes": ["this is known"]}


@dataclass(frozen=True)
class Text:
    """A job whose method is given to workers."""

    text: str

    def write(self, path: Path, stem: Path) -> dict[str, object]:
        Path(f"{stem}.txt").write_text(self.text)
        return {}


class Here:
    """Does tasks as a worker would, in this process: for tests of all but processes, each of which takes a second."""

    def __init__(self, threads: int) -> None:
        pass

    def do(self, task: Task, time_limit: float | None) -> Done:
        done: Done = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(task)).attempt()))
        return done

    def stop(self) -> None:
        pass

    def close(self) -> None:
        pass


def counted(path: Path, stem: Path) -> dict[str, object]:
    """Returns a figure that JSON does not hold."""
    Path(f"{stem}.txt").write_text("whole")
    return {"length": np.int64(3)}
