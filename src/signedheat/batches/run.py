"""One job for many shapes."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any

from ..compiled import MOST_THREADS
from ..domains.validation import positive_number, whole_number
from ..errors import FileFormatError, SignedHeatError
from ..packages import lazy_module, require
from ..parallel import connected, n_threads
from ..progress import Progress, logger
from .folder import held, make, refuse_file, scratch
from .inputs import Input, expand, named_path
from .job import BatchJob
from .manifest import Manifest, Outcome, State, job_text, source_of
from .supervision import Worker
from .task import Answer, Job, Task

CLUSTER = ("distributed", "clusters")
distributed = lazy_module(*CLUSTER)


@dataclass(frozen=True)
class Batch:
    """What came of many shapes.

    Attributes
    ----------
    outcomes : tuple of Outcome
        One for each shape, in the order of the inputs.
    manifest : Path
        The file that holds them, a line of JSON each.
    skipped : int
        Number of shapes that were done before.
    """

    outcomes: tuple[Outcome, ...]
    manifest: Path
    skipped: int = 0

    @property
    def failures(self) -> list[Outcome]:
        """Those that are not done."""
        return [outcome for outcome in self.outcomes if not outcome.is_done]

    def __repr__(self) -> str:
        done = len(self.outcomes) - len(self.failures)
        return f"Batch({done} of {len(self.outcomes)} shapes done, {self.skipped} of them before)"


def batch(
    inputs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    job: Job,
    *,
    workers: int | None = None,
    threads: int = 1,
    scheduler: str | None = None,
    time_limit: float | None = None,
    progress: Progress | None = None,
    report: Callable[[Outcome], None] | None = None,
) -> Batch:
    """Do one job for many shapes, each in a worker process, and keep a manifest of what came of them.

    A shape that fails, takes too long or kills its process does not stop the others; where memory was short, it is
    tried once more when the others are done, alone. Whoever starts a batch again, after it was stopped or with more
    inputs, gets what is not there yet: shapes are skipped that are done, with the same job of the same version, from a
    file that has not changed, and whose results are still there. Results do not depend on the number of workers.

    Parameters
    ----------
    inputs : path, or sequence of paths
        Files, folders (with all in them), patterns such as ``"parts/**/*.stl"``.
    folder : path
        Where results go, under the names of the inputs; and ``manifest.jsonl``, a line of JSON for each shape: its
        state, seconds, message, and figures of quality.
    job : BatchJob, or callable
        What to make of each shape: ``job(path, stem)`` writes files whose names begin with `stem`, and returns a
        dictionary of figures. It must be importable by the workers.
    workers : int, optional
        Number of processes; by default one for each processor.
    threads : int
        Threads of each process.
    scheduler : str, optional
        Address of a running Dask cluster, ``tcp://host:port``, whose workers see the same files under the same names.
    time_limit : float, optional
        Seconds after which a shape is given up.
    progress : callable, optional
        Called as ``progress(fraction, text)``; what it raises stops the batch.
    report : callable, optional
        Called with the `Outcome` of each shape, as soon as it is known.

    Returns
    -------
    Batch
        The outcomes, and where the manifest is.

    Raises
    ------
    FileFormatError
        If there is no input, the folder cannot be made, or two shapes would have results of one name.
    SignedHeatError
        If the job cannot be sent to workers, or none can be started; if numbers make no sense, or another batch is
        writing into the folder.
    MissingPackageError
        If a scheduler is given and Dask is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import BatchJob, samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for k in range(3):
    ...         samples.sphere(2, radius=k + 1).save(f"{folder}/ball{k}.ply")
    ...     batch(folder, f"{folder}/out", BatchJob(volume=".npz", resolution=16), workers=1)
    Batch(3 of 3 shapes done, 0 of them before)
    """
    if scheduler is not None:
        require(*CLUSTER)
    _refuse_odd(workers, threads, time_limit)
    target = named_path(folder)
    refuse_file(target)
    every = expand([inputs] if isinstance(inputs, str | os.PathLike) else inputs, target)
    if isinstance(job, BatchJob):
        _refuse_shared(every, job)
    make(target)
    named = repr(job) if is_dataclass(job) else f"{getattr(job, '__module__', '')}.{getattr(job, '__qualname__', job)}"
    with held(target), scratch(target) as place:
        manifest = Manifest(target)
        found = {each.name: manifest.still_holds(each.name, each.path, named) for each in every}
        kept = {name: outcome for name, outcome in found.items() if outcome is not None}
        manifest.begin(kept.values())
        todo = [each for each in every if each.name not in kept]
        count = _Count(len(every), len(kept), progress)
        tasks = [
            Task(job, each.path.absolute(), target.absolute() / each.name, place / str(k))
            for k, each in enumerate(todo)
        ]
        if scheduler is not None:
            results = _on_cluster(scheduler, tasks, threads, time_limit)
        else:
            results = _in_processes(tasks, n_threads() if workers is None else workers, threads, time_limit)
        count.tell()
        for index, state, answer in results:
            outcome = _outcome(todo[index], state, answer, job_text(named))
            kept[outcome.name] = outcome
            manifest.add(outcome)
            logger.info("%s: %s (%.1f s) %s", outcome.name, state, outcome.seconds, outcome.message)
            if report is not None:
                report(outcome)
            count.add(outcome)
        outcomes = tuple(kept[each.name] for each in every)
        manifest.write(outcomes)
    return Batch(outcomes, manifest.path, len(every) - len(todo))


def _refuse_shared(every: Sequence[Input], job: BatchJob) -> None:
    """Refuse shapes of which one has a result by the name of one of another's: one would replace the other."""
    owners: dict[str, Input] = {}
    for each in every:
        for ending in job.endings:
            other = owners.setdefault(f"{each.name}{ending}".lower(), each)
            if other is not each:
                raise FileFormatError(
                    f"a result of {other.path.name} would have the name of one of this shape, {each.name}{ending}",
                    remedy="rename one of the two",
                    path=each.path,
                )


def _refuse_odd(workers: object, threads: object, time_limit: object) -> None:
    """Refuse numbers of processes, threads and seconds that make no sense."""
    for name, number in (("workers", 1 if workers is None else workers), ("threads", threads)):
        if whole_number(number, name, 1, SignedHeatError) > MOST_THREADS:
            raise SignedHeatError(f"{name} must be at most {MOST_THREADS}, not {number}", element=name)
    if time_limit is not None and positive_number(time_limit, "time limit") > threading.TIMEOUT_MAX:
        cause = f"the time limit is {time_limit:g} s, longer than can be waited"
        raise SignedHeatError(cause, remedy="leave it out", element="time limit")


Result = tuple[int, State, Answer]
"""Which task, how it ended, and what came of it."""


def _in_processes(tasks: Sequence[Task], workers: int, threads: int, time_limit: float | None) -> Iterator[Result]:
    """Results as they come; those that were short of memory once more, alone, at the end."""
    if workers < 1:
        raise SignedHeatError(f"{workers} workers do nothing", remedy="take one or more")
    starved = []
    for index, state, answer in _in_parallel(range(len(tasks)), tasks, min(workers, len(tasks)), threads, time_limit):
        if answer.starved and workers > 1 and len(tasks) > 1:
            starved.append(index)
        else:
            yield index, state, answer
    yield from _in_parallel(starved, tasks, 1, threads, time_limit)


def _in_parallel(
    indices: Sequence[int], tasks: Sequence[Task], workers: int, threads: int, time_limit: float | None
) -> Iterator[Result]:
    """Results as they come, from as many processes, each with a thread that minds it."""
    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for index in indices:
        waiting.put(index)
    ready: queue.SimpleQueue[Result | BaseException] = queue.SimpleQueue()
    processes = [Worker(threads) for _ in range(workers)]

    def mind(worker: Worker) -> None:
        try:
            while True:
                index = waiting.get_nowait()
                ready.put((index, *worker.do(tasks[index], time_limit)))
        except queue.Empty:
            return
        except BaseException as error:
            ready.put(error)

    minders = [threading.Thread(target=mind, args=(worker,), daemon=True) for worker in processes]
    try:
        for minder in minders:
            minder.start()
        for _ in indices:
            result = _next(ready)
            if isinstance(result, BaseException):
                raise result
            yield result
    finally:
        for worker in processes:
            worker.stop()
        for worker, minder in zip(processes, minders, strict=True):
            minder.join()
            worker.close()


def _next(ready: queue.SimpleQueue[Any]) -> Any:
    """The next result; waits in steps, so that a signal is heard everywhere."""
    while True:
        with suppress(queue.Empty):
            return ready.get(timeout=0.5)


def _on_cluster(address: str, tasks: Sequence[Task], threads: int, time_limit: float | None) -> Iterator[Result]:
    """Results as they come from a Dask cluster, each task in a process beside the Dask worker that got it."""
    with connected(address) as client:
        futures = {
            client.submit(apart, task, threads, time_limit, pure=False, key=f"shape-{os.getpid()}-{k}"): k
            for k, task in enumerate(tasks)
        }
        for future in distributed.as_completed(futures):
            problem = future.exception()
            if problem is None:
                yield futures[future], *future.result()
            elif isinstance(problem, SignedHeatError):
                raise problem
            else:
                yield futures[future], "died", Answer(f"its Dask worker died ({problem})")


_mine = threading.local()
"""The process of each thread of a Dask worker."""


def apart(task: Task, threads: int, time_limit: float | None) -> tuple[State, Answer]:
    """Do a task in a process beside this one, which stays for the next: Dask cannot stop what takes too long."""
    if getattr(_mine, "worker", None) is None or _mine.worker.threads != threads:
        _mine.worker = Worker(threads)
    done: tuple[State, Answer] = _mine.worker.do(task, time_limit)
    return done


def _outcome(each: Input, state: State, answer: Answer, job: str) -> Outcome:
    figures = dict(answer.figures)
    told = figures.pop("told", [])
    said = [answer.error] if answer.error is not None else [*(told if isinstance(told, list) else []), *answer.warnings]
    folder = Path(each.name).parent
    return Outcome(
        each.name,
        str(each.path),
        state,
        round(answer.seconds, 3),
        "; ".join(map(str, said)),
        tuple((folder / output).as_posix() for output in answer.outputs),
        figures,
        job,
        source_of(each.path),
    )


class _Count:
    """Counts shapes, and estimates how long the others will take."""

    def __init__(self, total: int, done: int, progress: Progress | None) -> None:
        self._total, self._before, self._done, self._failed = total, done, done, 0
        self._progress, self._begin = progress, time.perf_counter()

    def add(self, outcome: Outcome) -> None:
        self._done += 1
        self._failed += not outcome.is_done
        self.tell()

    def tell(self) -> None:
        if self._progress is None:
            return
        text = f"{self._done} of {self._total} shapes"
        text += f", {self._failed} not done" if self._failed else ""
        now = self._done - self._before
        if now and self._done < self._total:
            left = (time.perf_counter() - self._begin) / now * (self._total - self._done)
            text += f", about {duration(left)} left"
        self._progress(self._done / max(self._total, 1), text)


def duration(seconds: float) -> str:
    """A time that is about to pass, in words.

    Examples
    --------
    >>> duration(42.3), duration(400), duration(8000)
    ('42 s', '7 min', '2.2 h')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
