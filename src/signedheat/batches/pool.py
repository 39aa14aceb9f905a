"""Run one job on many shapes, in worker processes that have a time limit and are replaced when they die.

`concurrent.futures`, loky and Dask cannot stop a running task, and fail other tasks when a process dies. The workers
use `subprocess`, because `multiprocessing` would run the user's script in each process: Pebble, which has time limits,
fails on scripts without a main guard, loses what a process says as it dies, and lets a task run on when the batch is
killed. A process serves many tasks, because starting one takes two seconds.
"""

from __future__ import annotations

import errno
import json
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
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from signal import SIG_IGN, SIGINT, Signals, signal
from types import FunctionType
from typing import Any, cast

import numpy as np

from ..compiled import announce, remove_folders_of
from ..errors import FileFormatError, MemoryLimitError, SignedHeatError, counted, printable
from ..io.files import move_into_place, replaceable, writing
from ..io.shape_files import read, save
from ..jobs import MOST_THREADS, Announcement, Progress, command_for, logger
from ..packages import require
from ..parallel import connected, n_threads
from ..shapes.transforms import transform
from ..solids.solid import Solid
from ..validation import callback, positive_number, whole_number
from .inputs import UNSCALED, Input, expand, named_path
from .job import Job
from .manifest import Manifest, Outcome, State, source_of

Function = Callable[[Path, Path], Mapping[str, object]]
"""Type of a job, which is called with a file and the common beginning of the names of results, and returns figures."""
Done = tuple[Outcome, bool]
"""The outcome of a task, and whether memory may have run out, so that it may succeed after other processes ended."""
PROCESS_DEATHS = (EOFError, OSError, pickle.UnpicklingError)
"""Exceptions that reading from or writing to a process raises if it has died."""
COMPILING = "compiling"
"""What a process answers, besides all else, when it begins to compile kernels."""
THREAD_VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that set the number of threads of a process."""


@dataclass(frozen=True)
class Task:
    """A job for one shape."""

    job: Function
    description: str  # of the job, for the manifest
    shape: Input
    folder: Path  # to which results are moved once they are complete
    scratch: Path  # folder in which they are written

    def attempt(self) -> Done:
        """Run the job in this process and return its outcome, also if it raises an error."""
        begin, target = time.perf_counter(), self.folder / self.shape.name
        state: State = "failed"
        figures: dict[str, Any] = {}
        outputs: list[str] = []
        is_starved = False
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            try:
                self.scratch.mkdir(parents=True)
                with self._scaled() as path:
                    figures = dict(self.job(path, self.scratch / target.name))
                json.dumps(figures)  # raises TypeError if the manifest could not hold them
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

    @contextmanager
    def _scaled(self) -> Iterator[Path]:
        """Yield the path of the shape, or if a robot scales it, of a scaled copy, which is deleted afterwards."""
        if self.shape.scale == UNSCALED:
            yield self.shape.path.absolute()
            return
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "scaled.npz" if isinstance(shape := read(self.shape.path), Solid) else "scaled.ply")
            save(cast("Any", transform(shape, np.diag([*self.shape.scale, 1.0]))), path)
            yield path

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
        """Check that each result can be moved to the folder, then move them all, and return their names."""
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
    """A process that runs one task after another. It is started at the first task, and again if it has died."""

    def __init__(self, threads: int) -> None:
        self.threads, self.is_closed = threads, False
        self._process: subprocess.Popen[bytes] | None = None

    def do(self, task: Task, time_limit: float | None) -> Done:
        """Run a task in the process and wait for its outcome; kill the process after `time_limit` seconds."""
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
            done: Done | str = _answer_of(process)
        except PROCESS_DEATHS:
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
        """Return the process once it has announced that it can run a task.

        If it dies before, another one is started, `tries` in all. It may die, for example, while the package is being
        updated, which is no fault of the shape.
        """
        process = self._process = self._process or self._started()
        try:
            if self.is_closed:
                raise EOFError
            _answer_of(process)
        except PROCESS_DEATHS:
            if self.is_closed or tries == 1:
                raise
            self.close()
            return self._ready(tries - 1)
        return process

    def stop(self) -> None:
        """Kill the process for good, from any thread. A task that it was running ends with the state "died"."""
        self.is_closed = True
        if self._process is not None:
            self._process.kill()

    def close(self) -> str:
        """Kill the process unless it exits within a second, and return words on how it ended."""
        process, self._process = self._process, None
        if process is None:
            return "it was stopped"
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)  # it may still be exiting
        process.kill()
        process.communicate()
        remove_folders_of(process.pid)
        with self._errors:
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", errors="replace").splitlines()
        code = process.returncode
        if code < 0 and Signals(-code).name == "SIGKILL":
            return "its process was killed, probably because memory ran out"
        last = next((line.strip() for line in reversed(lines) if line.strip()), "no error message")
        return printable(f"its process died (status {code}: {last:.200})")

    def _started(self) -> subprocess.Popen[bytes]:
        """Start the process, with standard error in a temporary file."""
        self._errors = tempfile.TemporaryFile()
        return subprocess.Popen(
            command_for(f"{__name__}:serve"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, **dict.fromkeys(THREAD_VARIABLES, str(self.threads))},
        )


def _answer_of(process: subprocess.Popen[bytes]) -> Any:
    """Wait for what a process of `serve` answers, and announce meanwhile that it compiles, if it says so."""
    while (answer := pickle.load(process.stdout)) == COMPILING:  # type: ignore[arg-type]
        announce()
    return answer


_here = threading.local()
"""Holds one `Worker` for each thread of a Dask worker."""


def do_apart(task: Task, threads: int, time_limit: float | None) -> Done:
    """Run a task in a separate process on the machine of a Dask worker, since Dask cannot stop a running task."""
    if getattr(_here, "worker", None) is None or _here.worker.threads != threads:
        _here.worker = Worker(threads)
    return _here.worker.do(task, time_limit)


def serve() -> None:
    """Run the tasks that arrive on standard input, as the main function of the process of a `Worker`.

    Before each task it writes ``"ready"`` to standard output, and after it what `Task.attempt` returns. When it begins
    to compile kernels, it writes `COMPILING`.
    """
    signal(SIGINT, SIG_IGN)  # the parent process handles it
    Announcement.are_wanted = False  # what is written to standard error explains failures
    answers, writing_answer = os.fdopen(os.dup(1), "wb"), threading.Lock()
    os.dup2(2, 1)  # printed text must not mix with the answers

    def answer(content: object) -> None:
        """Send content to the parent process, from any thread."""
        with writing_answer, suppress(BrokenPipeError):
            pickle.dump(content, answers)
            answers.flush()

    announce.pass_on = partial(answer, COMPILING)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")  # when memory runs out, the system should kill this process
    tasks: queue.Queue[Task | str] = queue.Queue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    import_module(f"{__name__.partition('.')[0]}.public")  # so that imports do not count towards the time of a shape
    while True:  # until the parent closes the pipe, which `_receive` notices
        answer("ready")
        task = tasks.get()
        answer(task if isinstance(task, str) else task.attempt())


def _receive(tasks: queue.Queue[Task | str]) -> None:
    """Put tasks that arrive into a queue, and end the process when the parent closes the pipe or ends.

    A task that cannot be read becomes a message in the queue.
    """
    while True:
        try:
            tasks.put(pickle.load(sys.stdin.buffer))
        except EOFError:
            os._exit(0)
        except Exception as error:  # most likely, its module cannot be imported here
            tasks.put(f"the job cannot be received by a worker ({type(error).__name__}: {error})")


try:
    import fcntl
except ImportError:  # on Windows, two batches in one folder are not detected
    fcntl = None  # type: ignore[assignment]


@dataclass(frozen=True)
class Batch:
    """The outcomes of a batch.

    Attributes
    ----------
    outcomes : tuple of Outcome
        The outcome for each shape, in the order of the inputs.
    manifest : Path
        The file with the outcomes, each on a line of JSON.
    skipped : int
        Number of shapes that were skipped, since an earlier run had done them.

    See Also
    --------
    batches.run : Run a job on many shapes.
    batches.Outcome : What became of one shape.

    Examples
    --------
    >>> from signedheat.batches import Outcome
    >>> Batch((Outcome("a", "a.stl", "done", 1.0), Outcome("b", "b.stl", "timed out", 60.0)), Path("manifest.jsonl"))
    Batch(1 of 2 shapes done, 0 of them before)
    """

    outcomes: tuple[Outcome, ...]
    manifest: Path
    skipped: int = 0

    @property
    def failures(self) -> list[Outcome]:
        """The outcomes of shapes for which not all results were written."""
        return [outcome for outcome in self.outcomes if not outcome.is_done]

    def __repr__(self) -> str:
        done = len(self.outcomes) - len(self.failures)
        return f"Batch({done} of {counted(len(self.outcomes), 'shape')} done, {self.skipped} of them before)"


def run(
    inputs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    job: Function,
    *,
    workers: int | None = None,
    threads: int = 1,
    scheduler: str | None = None,
    time_limit: float | None = None,
    progress: Progress | None = None,
    report: Callable[[Outcome], None] | None = None,
) -> Batch:
    """Run one job on many shapes in worker processes, and record the outcomes in a manifest.

    A shape that fails, takes too long or kills its process does not stop the others. If memory ran out, the shape is
    tried once more, alone, after the others. A batch can be started again after it was stopped, or with more inputs.
    It then skips each shape whose file has not changed, if the same version of this package has done the same job and
    the results still exist. Results do not depend on the number of workers.

    Parameters
    ----------
    inputs : path, or sequence of paths
        Files, folders (searched recursively), and patterns such as ``"parts/**/*.stl"``.
    folder : path
        Folder for the results, which are named after the inputs, and for ``manifest.jsonl``, which has a line of JSON
        for each shape with its state, seconds, message and figures of quality.
    job : Job, Watertight, or callable
        The job, called for each shape as ``job(path, stem)``. It writes files whose names begin with `stem`, and
        returns a dictionary of figures for the manifest. The workers must be able to import it.
    workers : int, optional
        Number of processes. By default, one for each processor.
    threads : int
        Number of threads of each process, 1 by default.
    scheduler : str, optional
        Address of a running Dask cluster, such as ``tcp://host:port``, which runs the job instead of this machine. Its
        workers must see the same files at the same paths. By default the job runs in processes of this machine.
    time_limit : float, optional
        Seconds after which a shape is abandoned. By default there is no limit.
    progress : callable, optional
        Called as ``progress(fraction, text)`` with the fraction of shapes done, from 0 to 1, and a line that says how
        many. An exception that it raises stops the batch.
    report : callable, optional
        Called as ``report(outcome)`` with the `Outcome` of each shape as soon as it ends.

    Returns
    -------
    Batch
        The outcomes, and the path of the manifest.

    Raises
    ------
    FileFormatError
        If there is no input, the folder cannot be made, or results of two shapes would have the same name.
    SignedHeatError
        If the job cannot be sent to workers, a number is out of range, or another batch is writing into the folder.
    MissingPackageError
        If a scheduler is given and Dask is not installed.

    See Also
    --------
    batches.Job : What is computed for each shape.
    batches.Batch : What became of all shapes.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import batches, samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for k in range(3):
    ...         samples.sphere(2, radius=k + 1).save(f"{folder}/ball{k}.ply")
    ...     batches.run(folder, f"{folder}/out", batches.Job(volume=".npz", resolution=16), workers=1)
    Batch(3 of 3 shapes done, 0 of them before)
    """
    callback(progress, "progress(fraction, text)")
    if job is None:
        raise SignedHeatError("there is no job", remedy="pass a Job", element="job")
    callback(job, "job(path, stem)")
    if scheduler is not None:
        require("distributed", "clusters")
    workers, threads, time_limit = _checked_limits(workers, threads, time_limit)
    target = named_path(folder)
    if os.path.lexists(target) and not target.is_dir():
        raise FileFormatError("this is not a folder", remedy="choose another one", path=target)
    shapes = expand(inputs if isinstance(inputs, Iterable) and not isinstance(inputs, str) else [inputs], target)
    if isinstance(job, Job):
        job.refuse_shared_names(shapes)
    description = _description_of(job)

    def described(shape: Input) -> str:
        return description if shape.scale == UNSCALED else f"{description} of {shape.scale} times the shape"

    with ExitStack() as stack:
        scratch = stack.enter_context(_locked(target))
        manifest = Manifest(target)
        earlier = {shape.name: manifest.earlier_outcome(shape.name, shape.path, described(shape)) for shape in shapes}
        done = {name: outcome for name, outcome in earlier.items() if outcome is not None}
        skipped = len(done)
        manifest.write(done.values())
        todo = [shape for shape in shapes if shape.name not in done]
        tasks = [
            Task(job, described(shape), shape, target.absolute(), scratch / str(k)) for k, shape in enumerate(todo)
        ]
        if scheduler is not None:
            outcomes = _on_cluster(tasks, scheduler, threads, time_limit)
        else:
            outcomes = _in_processes(tasks, workers or n_threads(), threads, time_limit)
        stack.enter_context(closing(outcomes))
        begin, failed = time.perf_counter(), 0
        if progress is not None:
            progress(skipped / len(shapes), f"{skipped} of {counted(len(shapes), 'shape')}")
        for n_ended, outcome in enumerate(outcomes, 1):
            done[outcome.name] = outcome
            manifest.add(outcome)
            logger.info("%s: %s (%.1f s) %s", outcome.name, outcome.state, outcome.seconds, outcome.message)
            if report is not None:
                report(outcome)
            failed += not outcome.is_done
            if progress is not None:
                text = f"{len(done)} of {counted(len(shapes), 'shape')}"
                if failed:
                    text += f", {failed} not done"
                n_left = len(todo) - n_ended
                if n_left:
                    text += f", about {duration((time.perf_counter() - begin) / n_ended * n_left)} left"
                progress(len(done) / len(shapes), text)
        outcomes_in_order = tuple(done[shape.name] for shape in shapes)
        manifest.write(outcomes_in_order)
    return Batch(outcomes_in_order, manifest.path, skipped)


def _description_of(job: Function) -> str:
    """Return words for a job and the version of the package. Shapes done under other words are done again."""
    text = f"{job.__module__}.{job.__qualname__}" if isinstance(job, FunctionType) else repr(job)
    package = __name__.partition(".")[0]
    return f"{text} by {package} {import_module(package).__version__}"


def _checked_limits(workers: object, threads: object, time_limit: object) -> tuple[int | None, int, float | None]:
    """Return numbers of processes, threads and seconds, None where none is given; raise an error if out of range."""
    numbers = {"threads": threads} | ({} if workers is None else {"workers": workers})
    counts = {name: whole_number(n, name, 1, SignedHeatError) for name, n in numbers.items()}
    for name, number in counts.items():
        if number > MOST_THREADS:
            raise SignedHeatError(f"{name} must be at most {MOST_THREADS}, not {number}", element=name)
    seconds = None if time_limit is None else positive_number(time_limit, "time_limit")
    if seconds is not None and seconds > threading.TIMEOUT_MAX:
        cause = f"the time limit is {seconds:g} s, which is too long to wait"
        raise SignedHeatError(cause, remedy="leave it out", element="time_limit")
    return counts.get("workers"), counts["threads"], seconds


@contextmanager
def _locked(folder: Path) -> Iterator[Path]:
    """Make a folder, lock it against other batches, and yield the path of a scratch folder in it.

    The scratch folder does not exist at the beginning, and is deleted at the end.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cause = f"the folder cannot be made ({error.strerror})"
        raise FileFormatError(cause, remedy="choose another one", path=folder) from error
    scratch = folder.absolute() / ".unfinished"
    with ExitStack() as stack:
        if fcntl is not None:
            number = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, number)
            try:
                fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno in (errno.EWOULDBLOCK, errno.EACCES):  # other errors: a file system without locks
                    cause, remedy = "another batch is writing into this folder", "wait for it, or choose another folder"
                    raise SignedHeatError(cause, remedy=remedy, path=folder) from error
        shutil.rmtree(scratch, ignore_errors=True)
        stack.callback(shutil.rmtree, scratch, ignore_errors=True)
        yield scratch


def _in_processes(
    tasks: list[Task], number: int, threads: int, time_limit: float | None
) -> Generator[Outcome, None, None]:
    """Run tasks in at most `number` processes, and yield outcomes as tasks end.

    Those that ran out of memory or died are tried once more at the end, one after another.
    """
    starved = []
    workers = [Worker(threads) for _ in range(max(1, min(number, len(tasks))))]
    idle: queue.SimpleQueue[Worker] = queue.SimpleQueue()
    for worker in workers:
        idle.put(worker)

    def do(task: Task) -> Done:
        worker = idle.get()
        try:
            return worker.do(task, time_limit)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(len(workers))
    try:
        futures = {pool.submit(do, task): task for task in tasks}
        for future in as_completed(futures):
            outcome, is_starved = future.result()
            if is_starved and len(workers) > 1:
                starved.append(futures[future])
            else:
                yield outcome
        for worker in workers[1:]:
            worker.stop()
        yield from (workers[0].do(task, time_limit)[0] for task in starved)
    finally:
        for worker in workers:
            worker.stop()
        pool.shutdown(cancel_futures=True)
        for worker in workers:
            worker.close()


def _on_cluster(
    tasks: list[Task], address: str, threads: int, time_limit: float | None
) -> Generator[Outcome, None, None]:
    """Run each task in a separate process of a Dask worker, and yield outcomes as tasks end."""
    with connected(address) as client:
        pool = client.get_executor(pure=False)
        futures = {pool.submit(do_apart, task, threads, time_limit): task for task in tasks}
        for future in as_completed(futures):
            try:
                yield future.result()[0]
            except SignedHeatError:
                raise
            except Exception as error:
                yield futures[future].outcome("died", 0.0, f"its Dask worker died ({error})")


def duration(seconds: float) -> str:
    """Return a time in words, such as ``"12 s"``, ``"5 min"`` or ``"2.0 h"``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
