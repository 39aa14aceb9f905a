"""Processes that do tasks, under a time limit, whose death is survived."""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import IO, cast

from ..errors import SignedHeatError
from .manifest import State
from .task import Answer, Task

THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables that say how many threads a process takes."""
STARTS = 3
"""How often a process is started that is killed before it is ready."""


class Worker:
    """A process that does one task after the other, started when it is first needed and again when it has died.

    Processes are started anew, not forked, so it does not matter what the one that starts them is doing.
    """

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads
        self._process: subprocess.Popen[bytes] | None = None
        self._says: IO[bytes] | None = None
        self._closed = False

    def do(self, task: Task, time_limit: float | None = None) -> tuple[State, Answer]:
        """Do a task; what takes longer than `time_limit` seconds is stopped.

        Raises
        ------
        SignedHeatError
            If no process can be started, or the job cannot be sent to one.
        """
        try:
            message = pickle.dumps(task)
        except Exception as error:
            raise SignedHeatError(
                f"the job cannot be sent to a worker ({error})", remedy="define it at the top of a module"
            ) from error
        process = self._running()
        expired = threading.Event()

        def expire() -> None:
            expired.set()
            process.kill()

        watchdog = None if time_limit is None else threading.Timer(time_limit, expire)
        begin = time.perf_counter()
        try:
            if watchdog is not None:
                watchdog.daemon = True
                watchdog.start()
            _pipe(process.stdin).write(message)
            _pipe(process.stdin).flush()
            answer: Answer = pickle.load(_pipe(process.stdout))
            return ("done" if answer.error is None else "failed"), answer
        except (EOFError, OSError, pickle.UnpicklingError):
            seconds = time.perf_counter() - begin
            last = self._end()
            shutil.rmtree(task.scratch, ignore_errors=True)
            if expired.is_set():
                return "timed out", Answer(f"it took longer than {time_limit:g} s", seconds=seconds)
            return "died", Answer(last, starved=True, seconds=seconds)
        finally:
            if watchdog is not None:
                watchdog.cancel()

    def stop(self) -> None:
        """Kill the process, whatever it is doing; its task then ends as one that died."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()

    def close(self) -> None:
        """Stop, and give back what the process has taken; no task may be under way any more."""
        self.stop()
        self._end()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            self._start()
        assert self._process is not None
        return self._process

    def _start(self) -> None:
        """Start a process, and wait until it is ready; again where one is killed meanwhile, as memory may end then."""
        for _ in range(STARTS):
            if self._closed:
                raise SignedHeatError("the batch has ended", remedy="start it again")
            process = self._spawn()
            try:
                pickle.load(_pipe(process.stdout))
                return
            except (EOFError, pickle.UnpicklingError):
                how = self._end()
            if process.returncode >= 0:  # it ended by itself, and will do so again
                break
        raise SignedHeatError(f"no worker can be started ({how})", remedy="try the job on one shape, without workers")

    def _spawn(self) -> subprocess.Popen[bytes]:
        environment = {**os.environ, **dict.fromkeys(THREADS, str(self.threads))}
        environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
        self._says = tempfile.TemporaryFile()
        name = f"{__name__.rpartition('.')[0]}.worker"
        self._process = subprocess.Popen(
            [sys.executable, "-m", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._says,
            env=environment,
        )
        return self._process

    def _end(self) -> str:
        """Clear up after a process, and tell how it ended."""
        process, says = self._process, self._says
        self._process = self._says = None
        if process is None or says is None:
            return "its process is gone"
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with _unbroken():
                    pipe.close()
        code = process.wait()
        says.seek(0)
        lines = says.read().decode("utf-8", errors="replace").strip().splitlines()
        says.close()
        if code == -getattr(signal, "SIGKILL", 9):
            return "its process was killed, as it is where memory ends"
        how = f"signal {-code}" if code < 0 else f"status {code}"
        said = [line for line in lines if "Error" in line or "error" in line][-1:] or lines[-1:]
        return f"its process died ({': '.join([how, *said]):.200})"


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    return cast("IO[bytes]", pipe)


class _unbroken:
    """Closing a pipe whose other end has died writes what is left in it, and fails."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        return kind is not None and issubclass(kind, OSError)
