"""Worker processes that run one task after another under a time limit, and are replaced when they die.

`concurrent.futures`, loky and Dask cannot stop a running task, and fail other tasks when a process dies. The workers
use `subprocess`, because `multiprocessing` would run the user's script in each process. A process serves many tasks,
because starting one takes two seconds.
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
from ..jobs import command_for
from .inputs import Input
from .manifest import Outcome, State, source_of

Function = Callable[[Path, Path], Mapping[str, object]]
"""Takes a file and the common beginning of the names of its results; returns figures that JSON can hold."""
Done = tuple[Outcome, bool]
"""The outcome of a shape, and whether memory ran out, so that it may succeed once other processes have ended."""
DEATHS = (EOFError, OSError, pickle.UnpicklingError)
"""Exceptions when reading from or writing to a process that has died."""
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that set the number of threads of a process."""


@dataclass(frozen=True)
class Task:
    """A job for one shape. Results are written to `scratch` and moved to `folder` once they are complete."""

    job: Function
    description: str
    shape: Input
    folder: Path
    scratch: Path

    def attempt(self) -> Done:
        """Run the job and turn errors into outcomes."""
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
                warned = [str(warning.message) for warning in caught if issubclass(warning.category, UserWarning)]
                message = "; ".join(map(str, [*figures.pop("notes", []), *dict.fromkeys(warned)]))
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
        """Make the outcome of this task for the manifest."""
        name, path, seconds = self.shape.name, self.shape.path, round(seconds, 3)
        ended = name, str(path), state, seconds, message, outputs, figures or {}
        return Outcome(*ended, job=self.description, source=source_of(path))

    def _move_to(self, folder: Path) -> list[str]:
        """Move all results to the folder, or none unless the disk fails, and return their names."""
        results = sorted(self.scratch.iterdir())
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        for file in results:
            if os.path.realpath(folder / file.name) == os.path.realpath(self.shape.path):
                cause = "the result would replace its own input"
                raise FileFormatError(cause, remedy="choose another folder", path=folder / file.name)
            with writing(folder / file.name):
                replaceable(folder / file.name)
        for file in results:
            move_into_place(file, folder / file.name)
        return [file.name for file in results]


class Worker:
    """A process that runs one task after another; it is started at the first task, and again after it has died."""

    def __init__(self, threads: int) -> None:
        self.threads, self.is_closed = threads, False
        self._process: subprocess.Popen[bytes] | None = None

    def do(self, task: Task, time_limit: float | None) -> Done:
        """Run a task, and stop it after `time_limit` seconds."""
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
        """Return the process once it waits for a task; replace it once if it dies before.

        That happens, for example, while the package is being updated, and has nothing to do with the shape.
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
        """Kill the process and start no other; its current task ends as one whose process died."""
        self.is_closed = True
        if self._process is not None:
            self._process.kill()

    def close(self) -> str:
        """Wait for the process to end, and describe how it ended."""
        process, self._process = self._process, None
        if process is None:
            return "it was stopped"
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)  # it may still be exiting
        process.kill()
        process.communicate()
        with self._errors:
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", errors="replace").splitlines()
        code = process.returncode
        if code < 0 and Signals(-code).name == "SIGKILL":
            return "its process was killed, probably because memory ran out"
        last = next((line.strip() for line in reversed(lines) if line.strip()), "no error message")
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
"""Holds one `Worker` for each thread of a Dask worker."""


def do_apart(task: Task, threads: int, time_limit: float | None) -> Done:
    """Run a task in a separate process on the machine of a Dask worker, since Dask cannot stop a running task."""
    if getattr(_here, "worker", None) is None or _here.worker.threads != threads:
        _here.worker = Worker(threads)
    return _here.worker.do(task, time_limit)


def serve() -> None:
    """Serve tasks from standard input: announce readiness, run a task and write its result, in turn."""
    signal(SIGINT, SIG_IGN)  # the parent process handles it
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # printed text must not mix with the answers
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")  # when memory runs out, the system should kill this process
    tasks: queue.Queue[Task | str] = queue.Queue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    import_module(f"{__name__.partition('.')[0]}.public")  # so that imports do not count towards the time of a shape
    with suppress(BrokenPipeError):
        while True:
            pickle.dump("ready", answers)
            answers.flush()
            task = tasks.get()
            pickle.dump(task if isinstance(task, str) else task.attempt(), answers)
            answers.flush()
    os._exit(0)


def _receive(tasks: queue.Queue[Task | str]) -> None:
    """Queue the tasks that arrive, and exit at once when the parent process closes the pipe or ends."""
    while True:
        try:
            tasks.put(pickle.load(sys.stdin.buffer))
        except EOFError:
            os._exit(0)
        except Exception as error:  # most likely, its module cannot be imported here
            tasks.put(f"the job cannot be received by a worker ({type(error).__name__}: {error})")
