"""Processes that make what is asked for of one shape after the other, under a time limit, whose death is survived.

They are started anew, not forked, so it does not matter what the process that starts them is doing; and not by
`multiprocessing`, which would run the script of the user in each of them.
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
from typing import IO, Any

from ..errors import MemoryLimitError, SignedHeatError
from ..io.files import moved, replaceable, writing
from .inputs import Input
from .manifest import Outcome, State, source_of

Job = Callable[[Path, Path], Mapping[str, object]]
"""Called with a file and the beginning of the names of what it writes; returns figures, ready for JSON."""
Done = tuple[Outcome, bool]
"""What came of a shape, and whether memory was short: then it may not be once others have ended."""
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that say how many threads a process takes."""
STARTS = 3
"""How often a process is started that is killed before it is ready, as memory may end then."""
ENDING = 10.0
"""Seconds that a process takes at the most to end which answers no more."""


@dataclass(frozen=True)
class Task:
    """One shape: what is to be made of it, and the folder of the results.

    They are made in `scratch`, a folder of its own: what is not finished never gets a name that stays.
    """

    job: Job
    named: str
    shape: Input
    folder: Path
    scratch: Path

    def attempt(self) -> Done:
        """Do it; errors become outcomes."""
        begin, figures, outputs, error, starved = time.perf_counter(), dict[str, object](), [], None, False
        stem = self.folder / self.shape.name
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            try:
                shutil.rmtree(self.scratch, ignore_errors=True)  # of a worker that died
                self.scratch.mkdir(parents=True)
                figures = dict(self.job(self.shape.path.absolute(), self.scratch / stem.name))
                outputs = [(Path(self.shape.name).parent / name).as_posix() for name in self._moved(stem.parent)]
            except MemoryError:
                error, starved = "there was not enough memory", True
            except (SignedHeatError, OSError) as problem:
                error, starved = str(problem), isinstance(problem, MemoryLimitError)
            except Exception as problem:
                error = f"{type(problem).__name__}: {problem}"
            finally:
                shutil.rmtree(self.scratch, ignore_errors=True)
        told = figures.pop("told", [])
        said = [str(each.message) for each in caught if issubclass(each.category, UserWarning)]
        message = "; ".join(map(str, [*(told if isinstance(told, list) else []), *dict.fromkeys(said)]))
        state: State = "done" if error is None else "failed"
        message = message if error is None else " ".join(error.split())
        seconds = time.perf_counter() - begin
        return self.outcome(state, seconds, message, tuple(outputs), {} if error else figures), starved

    def outcome(
        self, state: State, seconds: float, message: str, outputs: tuple[str, ...] = (), figures: Any = None
    ) -> Outcome:
        """What came of it."""
        path = self.shape.path
        said = (state, round(seconds, 3), message, outputs, figures or {})
        return Outcome(self.shape.name, str(path), *said, self.named, source_of(path))

    def _moved(self, folder: Path) -> list[str]:
        """Give what was made its place, all or nothing of it unless the disk breaks, and return the names."""
        made = sorted(self.scratch.iterdir())
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        for file in made:
            with writing(folder / file.name):
                replaceable(folder / file.name)
        for file in made:
            moved(file, folder / file.name)
        return [file.name for file in made]


class Worker:
    """A process that does one task after the other, started when it is first needed and again when it has died."""

    def __init__(self, threads: int) -> None:
        self.threads, self._is_closed = threads, False
        self._process: subprocess.Popen[bytes] | None = None
        self._says: IO[bytes]

    def do(self, task: Task, time_limit: float | None) -> Done:
        """Do a task; what takes longer than `time_limit` seconds is stopped.

        Raises
        ------
        SignedHeatError
            If no process can be started, or the job cannot be sent to one.
        """
        try:
            message = pickle.dumps(task)
        except Exception as error:
            cause, remedy = f"the job cannot be sent to a worker ({error})", "define it at the top of a module"
            raise SignedHeatError(cause, remedy=remedy) from error
        process = self._running()
        watchdog = threading.Timer(threading.TIMEOUT_MAX if time_limit is None else time_limit, process.kill)
        watchdog.daemon = True
        begin = time.perf_counter()
        watchdog.start()
        try:
            process.stdin.write(message)  # type: ignore[union-attr]
            process.stdin.flush()  # type: ignore[union-attr]
            done: Done | str = pickle.load(process.stdout)  # type: ignore[arg-type]
            if isinstance(done, str):
                return task.outcome("failed", time.perf_counter() - begin, done), False
            return done
        except (EOFError, OSError, pickle.UnpicklingError):
            seconds, last = time.perf_counter() - begin, self.close()
            shutil.rmtree(task.scratch, ignore_errors=True)
            if time_limit is not None and seconds >= time_limit:
                return task.outcome("timed out", seconds, f"it took longer than {time_limit:g} s"), False
            return task.outcome("died", seconds, last), True
        finally:
            watchdog.cancel()

    def stop(self) -> None:
        """Kill the process, whatever it is doing; its task then ends as one that died."""
        self._is_closed = True
        if self._process is not None:
            self._process.kill()

    def close(self) -> str:
        """Give back what the process has taken, and tell how it ended."""
        process, self._process = self._process, None
        if process is None:
            return "it was stopped"
        with suppress(subprocess.TimeoutExpired):
            process.wait(0.0 if self._is_closed else ENDING)
        process.kill()
        process.communicate()
        self._says.seek(0)
        lines = self._says.read().decode("utf-8", errors="replace").strip().splitlines()
        self._says.close()
        code = process.returncode
        if code < 0 and Signals(-code).name == "SIGKILL":
            return "its process was killed, as it is where memory ends"
        said = [line for line in lines if "error" in line.lower()][-1:] or lines[-1:]
        how = f"signal {-code}" if code < 0 else f"status {code}"
        return f"its process died ({': '.join([how, *said]):.200})"

    def _running(self) -> subprocess.Popen[bytes]:
        """The process, ready for a task."""
        for _ in range(STARTS):
            if self._process is not None and self._process.poll() is None:
                return self._process
            if self._is_closed:
                raise SignedHeatError("the batch has ended", remedy="start it again")
            process = self._process = self._spawn()
            with suppress(EOFError, pickle.UnpicklingError):
                pickle.load(process.stdout)  # type: ignore[arg-type]
                if not self._is_closed:  # meanwhile
                    return process
            how = self.close()
            if process.returncode >= 0:  # it ended by itself, and will do so again
                break
        raise SignedHeatError(f"no worker can be started ({how})", remedy="try the job on one shape, without workers")

    def _spawn(self) -> subprocess.Popen[bytes]:
        self._says = tempfile.TemporaryFile()
        return subprocess.Popen(
            [sys.executable, "-c", f"from {__name__} import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._says,
            env={
                **os.environ,
                **dict.fromkeys(THREADS, str(self.threads)),
                "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
            },
        )


_mine = threading.local()
"""The worker of each thread of a Dask worker."""


def apart(task: Task, threads: int, time_limit: float | None) -> Done:
    """Do a task in a process beside this one, which stays for the next: Dask cannot stop what takes too long."""
    if getattr(_mine, "worker", None) is None or _mine.worker.threads != threads:
        _mine.worker = Worker(threads)
    done: Done = _mine.worker.do(task, time_limit)
    return done


def main() -> None:
    """In a worker's process: answer the tasks on standard input, until it ends."""
    signal(SIGINT, SIG_IGN)  # for the process that started this one
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anybody prints must not come between the answers
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")  # where memory ends, let it be this process that dies
    tasks: queue.Queue[Task | str] = queue.Queue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    import_module(f"{__name__.partition('.')[0]}.public")  # all of it, so that no shape's time is spent on that
    answer: Done | str = "ready"
    while True:
        try:
            pickle.dump(answer, answers)
            answers.flush()
        except BrokenPipeError:
            os._exit(0)
        task = tasks.get()
        answer = task if isinstance(task, str) else task.attempt()


def _receive(tasks: queue.Queue[Task | str]) -> None:
    """Hand on tasks; at their end, or that of the process they come from, end at once."""
    while True:
        try:
            tasks.put(pickle.load(sys.stdin.buffer))
        except EOFError:
            os._exit(0)
        except Exception as error:  # its module, most likely, cannot be imported here
            tasks.put(f"the job cannot be received by a worker ({type(error).__name__}: {error})")
