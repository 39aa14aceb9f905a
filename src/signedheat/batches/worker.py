"""Processes that do one shape after the other, under a time limit; when one dies, it is started again.

They are started by `subprocess`: `multiprocessing` would run the script of the user in each of them. A process lives as
long as the batch, because starting one takes two seconds, which is as long as a small shape takes.
"""

from __future__ import annotations

import os
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from signal import SIG_IGN, SIGINT, Signals, signal
from typing import Any

from ..errors import FileFormatError, MemoryLimitError, SignedHeatError, printable
from ..io.files import move_into_place, replaceable, writing
from ..processes import command_for
from .inputs import Input
from .manifest import Outcome, State, source_of

Function = Callable[[Path, Path], Mapping[str, object]]
"""Called with a file and the beginning of the names of what it writes; returns figures, ready for JSON."""
Done = tuple[Outcome, bool]
"""What came of a shape, and whether memory was short: it may suffice when other processes have ended."""
DEATHS = (EOFError, OSError, pickle.UnpicklingError)
"""What reading from a process that has died raises, and writing to it."""
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that say how many threads a process takes."""


@dataclass(frozen=True)
class Task:
    """One shape: what is to be made of it, and the folder of the results.

    They are made in `scratch`, a folder of its own: what is not finished never gets a name that stays.
    """

    job: Function
    description: str
    shape: Input
    folder: Path
    scratch: Path

    def attempt(self) -> Done:
        """Do it; errors become outcomes."""
        begin, target = time.perf_counter(), self.folder / self.shape.name
        state: State = "failed"
        figures: dict[str, Any] = {}
        outputs: list[str] = []
        is_starved = False
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            try:
                self.scratch.mkdir(parents=True)
                figures = dict(self.job(self.shape.path.absolute(), self.scratch / target.name))
                outputs = [(Path(self.shape.name).parent / name).as_posix() for name in self._move_to(target.parent)]
                said = [str(each.message) for each in caught if issubclass(each.category, UserWarning)]
                message = "; ".join(map(str, [*figures.pop("notes", []), *dict.fromkeys(said)]))
                state = "done"
            except MemoryError:
                message, is_starved = "there was not enough memory", True
            except (SignedHeatError, OSError) as error:
                message, is_starved = printable(str(error)), isinstance(error, MemoryLimitError)
            except Exception as error:
                message = printable(" ".join(f"{type(error).__name__}: {error}".split()))
        shutil.rmtree(self.scratch, ignore_errors=True)
        figures = figures if state == "done" else {}
        return self.outcome(state, time.perf_counter() - begin, message, tuple(outputs), figures), is_starved

    def outcome(
        self,
        state: State,
        seconds: float,
        message: str,
        outputs: tuple[str, ...] = (),
        figures: Mapping[str, object] | None = None,
    ) -> Outcome:
        """What came of it."""
        path, found = self.shape.path, (state, round(seconds, 3), message, outputs, figures or {})
        return Outcome(self.shape.name, str(path), *found, self.description, source_of(path))

    def _move_to(self, folder: Path) -> list[str]:
        """Give what was made its place, all or nothing of it unless the disk breaks, and return the names."""
        made = sorted(self.scratch.iterdir())
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        for file in made:
            if os.path.realpath(folder / file.name) == os.path.realpath(self.shape.path):
                cause = "the result would replace the shape that it is made of"
                raise FileFormatError(cause, remedy="choose another folder", path=folder / file.name)
            with writing(folder / file.name):
                replaceable(folder / file.name)
        for file in made:
            move_into_place(file, folder / file.name)
        return [file.name for file in made]


class Worker:
    """A process that does one task after the other, started when it is first needed and again when it has died."""

    def __init__(self, threads: int) -> None:
        self.threads, self.is_closed = threads, False
        self._process: subprocess.Popen[bytes] | None = None

    def do(self, task: Task, time_limit: float | None) -> Done:
        """Do a task; what takes longer than `time_limit` seconds is stopped."""
        try:
            message = pickle.dumps(task)
        except Exception as error:
            cause, remedy = f"the job cannot be sent to a worker ({error})", "define it at the top of a module"
            raise SignedHeatError(cause, remedy=remedy) from error
        begin, timer = time.perf_counter(), None
        try:
            process = self._ready()
            begin = time.perf_counter()
            if time_limit is not None:
                timer = threading.Timer(time_limit, process.kill)
                timer.daemon = True
                timer.start()
            process.stdin.write(message)  # type: ignore[union-attr]
            process.stdin.flush()  # type: ignore[union-attr]
            done: Done | str = pickle.load(process.stdout)  # type: ignore[arg-type]
        except DEATHS:
            seconds, last = time.perf_counter() - begin, self.close()
            shutil.rmtree(task.scratch, ignore_errors=True)
            if timer is not None and time_limit is not None and seconds >= time_limit:
                return task.outcome("timed out", seconds, f"it took longer than {time_limit:g} s"), False
            return task.outcome("died", seconds, last), True
        finally:
            if timer is not None:
                timer.cancel()
        return (task.outcome("failed", 0.0, done), False) if isinstance(done, str) else done

    def _ready(self, tries: int = 2) -> subprocess.Popen[bytes]:
        """The process, once it waits for a task. One that dies before says nothing about the shape, and is replaced.

        So it is where a process cannot start for a moment, as while the package that it imports is being updated, or
        where the system took its memory as it waited. One of `DEATHS` is raised if the next dies, too.
        """
        process = self._process = self._process or self._started()
        try:
            if self.is_closed:
                raise EOFError
            pickle.load(process.stdout)  # type: ignore[arg-type]
        except DEATHS:
            if self.is_closed or tries == 1:
                raise
            self.close()
            return self._ready(tries - 1)
        return process

    def stop(self) -> None:
        """Kill the process, whatever it is doing, and start none again; its task then ends as one that died."""
        self.is_closed = True
        if self._process is not None:
            self._process.kill()

    def close(self) -> str:
        """Wait for the process, which has died or been killed, and return how it ended."""
        process, self._process = self._process, None
        if process is None:
            return "it was stopped"
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)  # after its last word
        process.kill()
        process.communicate()
        with self._errors:
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", errors="replace").splitlines()
        code = process.returncode
        if code < 0 and Signals(-code).name == "SIGKILL":
            return "its process was killed, as it is where memory ends"
        last = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
        return printable(f"its process died (status {code}: {last:.200})")

    def _started(self) -> subprocess.Popen[bytes]:
        self._errors = tempfile.TemporaryFile()
        return subprocess.Popen(
            command_for(f"{__name__}:serve"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, **dict.fromkeys(THREADS, str(self.threads))},
        )


_here = threading.local()
"""The worker of each thread of a Dask worker."""


def do_apart(task: Task, threads: int, time_limit: float | None) -> Done:
    """Do a task in a process of its own on the machine of a Dask worker: Dask cannot stop what takes too long."""
    if getattr(_here, "worker", None) is None or _here.worker.threads != threads:
        _here.worker = Worker(threads)
    return _here.worker.do(task, time_limit)


def serve() -> None:
    """Do tasks from standard input, in a worker's process: say that it is ready, and answer, for each."""
    signal(SIGINT, SIG_IGN)  # for the process that started this one
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anybody prints must not come between the answers
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")  # where memory ends, let it be this process that dies
    tasks: queue.Queue[Task | str] = queue.Queue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    import_module(f"{__name__.partition('.')[0]}.public")  # all of it, so that no shape's time is spent on that
    with suppress(BrokenPipeError):
        while True:
            pickle.dump("ready", answers)
            answers.flush()
            task = tasks.get()
            pickle.dump(task if isinstance(task, str) else task.attempt(), answers)
            answers.flush()
    os._exit(0)


def _receive(tasks: queue.Queue[Task | str]) -> None:
    """Hand tasks on; exit at once if there are no more, or if the process that sends them has ended."""
    while True:
        try:
            tasks.put(pickle.load(sys.stdin.buffer))
        except EOFError:
            os._exit(0)
        except Exception as error:  # its module, most likely, cannot be imported here
            tasks.put(f"the job cannot be received by a worker ({type(error).__name__}: {error})")
