"""Run one job on many shapes."""

from __future__ import annotations

import errno
import os
import queue
import shutil
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, is_dataclass
from importlib import import_module
from pathlib import Path

from ..compiled import MOST_THREADS
from ..errors import FileFormatError, SignedHeatError
from ..packages import require
from ..parallel import connected, n_threads
from ..progress import Progress, logger
from ..validation import positive_number, whole_number
from .inputs import expand, named_path
from .job import Job
from .manifest import Manifest, Outcome
from .worker import Done, Function, Task, Worker, do_apart

try:
    import fcntl
except ImportError:  # on Windows, two batches in one folder are not detected
    fcntl = None  # type: ignore[assignment]


@dataclass(frozen=True)
class Batch:
    """Outcomes of a batch.

    Attributes
    ----------
    outcomes : tuple of Outcome
        One for each shape, in the order of the inputs.
    manifest : Path
        The file that holds them, a line of JSON each.
    skipped : int
        Number of shapes that an earlier run had done.

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
        """Outcomes of the shapes that are not done."""
        return [outcome for outcome in self.outcomes if not outcome.is_done]

    def __repr__(self) -> str:
        done = len(self.outcomes) - len(self.failures)
        return f"Batch({done} of {len(self.outcomes)} shapes done, {self.skipped} of them before)"


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
    tried once more, alone, after the others. A batch can be started again after it was stopped or with more inputs: it
    skips each shape whose file has not changed, if the same version has done the same job and the results still exist.
    Results do not depend on the number of workers.

    Parameters
    ----------
    inputs : path, or sequence of paths
        Files, folders (searched recursively), and patterns such as ``"parts/**/*.stl"``.
    folder : path
        Folder for the results, which are named after the inputs, and for ``manifest.jsonl``, which has a line of JSON
        for each shape with its state, seconds, message and figures of quality.
    job : Job, Watertight, or callable
        Called for each shape as ``job(path, stem)``: writes files whose names begin with `stem`, and returns a
        dictionary of figures. The workers must be able to import it.
    workers : int, optional
        Number of processes. By default, one for each processor.
    threads : int
        Threads of each process.
    scheduler : str, optional
        Address of a running Dask cluster, ``tcp://host:port``. Its workers must see the same files at the same paths.
    time_limit : float, optional
        Seconds after which a shape is abandoned.
    progress : callable, optional
        Called as ``progress(fraction, text)``. An exception that it raises stops the batch.
    report : callable, optional
        Called with the `Outcome` of each shape as soon as it ends.

    Returns
    -------
    Batch
        The outcomes, and the path of the manifest.

    Raises
    ------
    FileFormatError
        If there is no input, the folder cannot be made, or results of two shapes would have the same name.
    SignedHeatError
        If the job cannot be sent to workers, no worker can be started, a number is out of range, or another batch is
        writing into the folder.
    MissingPackageError
        If a scheduler is given and Dask is not installed.

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
    if scheduler is not None:
        require("distributed", "clusters")
    _refuse_odd(workers, threads, time_limit)
    target = named_path(folder)
    if os.path.lexists(target) and not target.is_dir():
        raise FileFormatError("this is not a folder", remedy="choose another one", path=target)
    shapes = expand([inputs] if isinstance(inputs, str | os.PathLike) else inputs, target)
    if isinstance(job, Job):
        job.refuse_shared_names(shapes)
    described = _described(job)
    with ExitStack() as stack:
        scratch = stack.enter_context(_locked(target))
        manifest = Manifest(target)
        earlier = {shape.name: manifest.still_holds(shape.name, shape.path, described) for shape in shapes}
        done = {name: outcome for name, outcome in earlier.items() if outcome is not None}
        skipped = len(done)
        manifest.write(done.values())
        todo = [shape for shape in shapes if shape.name not in done]
        tasks = [Task(job, described, shape, target.absolute(), scratch / str(k)) for k, shape in enumerate(todo)]
        if scheduler is not None:
            outcomes = _on_cluster(tasks, scheduler, threads, time_limit)
        else:
            outcomes = _in_processes(tasks, workers or n_threads(), threads, time_limit)
        stack.enter_context(closing(outcomes))
        begin, failed = time.perf_counter(), 0
        if progress is not None:
            progress(skipped / len(shapes), f"{skipped} of {len(shapes)} shapes")
        for n_ended, outcome in enumerate(outcomes, 1):
            done[outcome.name] = outcome
            manifest.add(outcome)
            logger.info("%s: %s (%.1f s) %s", outcome.name, outcome.state, outcome.seconds, outcome.message)
            if report is not None:
                report(outcome)
            failed += not outcome.is_done
            if progress is not None:
                text = f"{len(done)} of {len(shapes)} shapes"
                if failed:
                    text += f", {failed} not done"
                n_left = len(todo) - n_ended
                if n_left:
                    text += f", about {duration((time.perf_counter() - begin) / n_ended * n_left)} left"
                progress(len(done) / len(shapes), text)
        outcomes_in_order = tuple(done[shape.name] for shape in shapes)
        manifest.write(outcomes_in_order)
    return Batch(outcomes_in_order, manifest.path, skipped)


def _described(job: Function) -> str:
    """Describe a job and the version of the package; shapes with another description are done again."""
    text = repr(job) if is_dataclass(job) else f"{getattr(job, '__module__', '')}.{getattr(job, '__qualname__', job)}"
    package = __name__.partition(".")[0]
    return f"{text} by {package} {import_module(package).__version__}"


def _refuse_odd(workers: object, threads: object, time_limit: object) -> None:
    """Refuse numbers of processes, threads and seconds that are out of range."""
    for name, number in (("workers", 1 if workers is None else workers), ("threads", threads)):
        if whole_number(number, name, 1, SignedHeatError) > MOST_THREADS:
            raise SignedHeatError(f"{name} must be at most {MOST_THREADS}, not {number}", element=name)
    if time_limit is not None and positive_number(time_limit, "time limit") > threading.TIMEOUT_MAX:
        cause = f"the time limit is {time_limit:g} s, which is too long to wait"
        raise SignedHeatError(cause, remedy="leave it out", element="time limit")


@contextmanager
def _locked(folder: Path) -> Iterator[Path]:
    """Make a folder, lock it against other batches, and yield an empty scratch folder in it."""
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
    """Yield outcomes as tasks end; shapes that ran out of memory are tried once more at the end, alone."""
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
    """Yield outcomes as tasks end on a Dask cluster, each in a separate process of a Dask worker."""
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
    """Seconds in words."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
