"""The frame of the fuzzer: families of cases, workers with a watchdog, failures that come again by their seed.

A *family* is a name, a function that builds a subject from random numbers, and a function that checks it. Families live
in modules `fuzz/cases_*.py`, which are found by their name::

    from fuzz.frame import Wrong, family

    def build(random: np.random.Generator, folder: Path) -> Subject:
        '''Anything that the check takes; files go into the folder, which is empty and is removed afterwards.'''

    def check(subject: Subject) -> str:
        '''Use the subject. What is returned names the kind of right answer, which is counted: "read", "distance".'''

    family("spheres", build, check)

What becomes of a case:

* the check returns: right;
* it raises a `SignedHeatError`: refused, which is right too (counted by type), provided that its cause is one line;
* it raises `Wrong("changed input", "...")`, or any other exception, or a warning that is no `UserWarning` (NumPy's are
  not): a failure;
* it takes longer than the limit (30 s of a processor), ends its process, or takes more memory than the family's limit:
  a failure.

In workers, parsers of other packages are forked, which is faster. Everything that is random comes from the generator
that `build` is given, which is made of the family's name, a seed and the number of the case: a failure is told with the
command that runs it again, in the foreground::

    cd tests
    python -m fuzz                                  # 10,000 cases of every family (make fuzz)
    python -m fuzz spheres boxes --cases 500 --seed 7 --workers 2
    python -m fuzz spheres --replay 7:123           # one case, with its traceback
    python -m fuzz --list

What a run has counted is told when it ends, is stopped (Ctrl-C, SIGTERM), and where there is one at SIGUSR1.
"""

from __future__ import annotations

import importlib
import math
import multiprocessing
import os
import pkgutil
import resource
import signal
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from fuzz.forked import forked
from signedheat.errors import SignedHeatError

LIMIT = 30.0
"""Seconds that a case may take, of a processor; beside other work it may take longer."""
PATIENCE = 20
"""Times the limit that a case may take on the clock: a case that waits for ever uses no processor."""
MEMORY = 1 << 30
"""Bytes by which a case may let its worker grow, unless the family says otherwise."""
Job: TypeAlias = tuple[str, int, int]
"""The name of a family, a seed, the number of a case."""
SPAWN = multiprocessing.get_context("spawn")


class Wrong(Exception):
    """What a check raises about a wrong answer: the kind of failure, which is counted, and what is wrong."""

    def __init__(self, kind: str, about: str = "") -> None:
        super().__init__(kind, about)
        self.kind, self.about = kind, about


@dataclass(frozen=True)
class Family:
    """Cases of one kind: see the module."""

    name: str
    build: Callable[[np.random.Generator, Path], Any]
    check: Callable[[Any], str]
    memory: int = MEMORY

    @property
    def module(self) -> str:
        """The module that registers the family, which a worker imports; a check may be a `partial`."""
        return str(getattr(self.check, "func", self.check).__module__)


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    family: str
    seed: int
    number: int
    kind: str
    failed: bool = False
    about: str = ""
    seconds: float = 0.0

    def __str__(self) -> str:
        again = f"python -m fuzz {self.family} --replay {self.seed}:{self.number}"
        return f"{self.kind} ({self.seconds:.1f} s): {again}\n    {self.about.strip()}"


@dataclass
class Tally:
    """The outcomes of a run, counted by family and kind."""

    counts: dict[str, Counter[str]] = field(default_factory=dict)
    failures: list[Outcome] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self.counts.setdefault(outcome.family, Counter())[outcome.kind] += 1
        if outcome.failed:
            self.failures.append(outcome)

    def __str__(self) -> str:
        rows = [
            f"{name:<24}{sum(kinds.values()):>7}  " + ", ".join(f"{kind} {n}" for kind, n in kinds.most_common())
            for name, kinds in sorted(self.counts.items())
        ]
        return "\n".join([*rows, f"{len(self.failures)} failures"])


FAMILIES: dict[str, Family] = {}


def family(
    name: str,
    build: Callable[[np.random.Generator, Path], Any],
    check: Callable[[Any], str],
    memory: int = MEMORY,
) -> None:
    """Register a family; `memory` is by how many bytes a case may let its worker grow."""
    FAMILIES[name] = Family(name, build, check, memory)


def families(modules: Sequence[str] = ()) -> dict[str, Family]:
    """Families by name, after importing these modules, or all modules `cases_*` beside this one."""
    if modules:
        for name in modules:
            importlib.import_module(name)
        return FAMILIES
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if module.name.startswith("cases_"):
            importlib.import_module(f"fuzz.{module.name}")
    return FAMILIES


def run_case(chosen: Family, seed: int, number: int) -> Outcome:
    """One case, in this process: its outcome, unless it hangs or crashes."""
    random = np.random.default_rng([seed, number, zlib.crc32(chosen.name.encode())])
    before, begin = _peak(), time.monotonic()

    def outcome(kind: str, failed: bool = False, about: str = "") -> Outcome:
        return Outcome(chosen.name, seed, number, kind, failed, about, time.monotonic() - begin)

    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, warnings.catch_warnings():
        fail_on_warnings("ignore")
        try:
            subject = chosen.build(random, Path(folder))
        except BaseException:
            return outcome("could not be built", True, traceback.format_exc())
        try:
            kind = chosen.check(subject)
        except SignedHeatError as error:
            if not error.cause.strip() or "\n" in str(error).strip():
                return outcome("refused without one clear line", True, repr(str(error)))
            return outcome(f"refused ({type(error).__name__})")
        except Wrong as wrong:
            return outcome(wrong.kind, True, f"{wrong.about}\n    {subject!r:.2000}")
        except BaseException as error:
            return outcome(type(error).__name__, True, f"{traceback.format_exc()}    {subject!r:.2000}")
    grown = _peak() - before
    if grown > chosen.memory:
        return outcome("memory", True, f"{grown / 1e6:.0f} MB more than before")
    return outcome(kind)


def fail_on_warnings(of_users: Literal["ignore", "always"]) -> None:
    """Make warnings errors, but for our own words to users, and for what other packages owe to newer ones."""
    warnings.simplefilter("error")
    warnings.simplefilter(of_users, UserWarning)
    warnings.filterwarnings("ignore", category=DeprecationWarning, module="(skimage|nrrd)")


def _peak() -> int:
    """The most memory that this process has held; what its parent held, which `getrusage` counts, is left out."""
    with suppress(OSError, ValueError, IndexError):
        text = Path("/proc/self/status").read_text()
        return 1024 * int(text.partition("VmHWM:")[2].split()[0])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _work(pipe: Connection, modules: Sequence[str]) -> None:
    """A worker: cases come and outcomes go through the pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    known = families(modules)
    pipe.send(None)
    with forked(), suppress(EOFError):
        while True:
            name, seed, number = pipe.recv()
            pipe.send(run_case(known[name], seed, number))


class Worker:
    """A process that runs cases one after another, and is replaced by another when it hangs or crashes."""

    def __init__(self, modules: Sequence[str]) -> None:
        self.modules = modules
        self.start()

    def start(self) -> None:
        """Begin a process, which tells when it is ready."""
        self.pipe, theirs = SPAWN.Pipe()
        self.process = SPAWN.Process(target=_work, args=(theirs, self.modules), daemon=True)
        self.process.start()
        theirs.close()
        self.job: Job | None = None
        self.begin, self.computed, self.is_ready = time.monotonic(), 0.0, False

    def give(self, job: Job) -> None:
        """Begin a case."""
        self.job, self.begin, self.computed = job, time.monotonic(), 0.0
        self.computed = self._computed()
        self.pipe.send(job)

    def hear(self, has_spoken: bool, limit: float) -> Outcome | None:
        """What became of the case, if anything did by now."""
        seconds = time.monotonic() - self.begin
        if has_spoken:
            try:
                outcome: Outcome | None = self.pipe.recv()
            except (EOFError, ConnectionError):
                return self._replaced("crash", seconds)
            self.is_ready, self.job = True, None
            return outcome
        if self.job is not None and seconds > limit and (seconds > PATIENCE * limit or self._computed() > limit):
            return self._replaced("hang", seconds)
        return None

    def _computed(self) -> float:
        """Seconds of a processor since the case began; infinite where the system does not tell."""
        try:
            words = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return math.inf
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK") - self.computed

    def _replaced(self, kind: str, seconds: float) -> Outcome:
        if self.job is None:
            raise RuntimeError("a worker ended before its first case")
        job, status = self.job, self.end()
        self.start()
        return Outcome(*job, kind, True, f"the process ended with status {status}", seconds)

    def end(self) -> int | None:
        """Kill the process, unless it has ended; returns its exit status."""
        self.process.join(0.2)
        self.process.kill()
        self.process.join()
        self.pipe.close()
        return self.process.exitcode


def run(
    names: Sequence[str],
    cases: int,
    seed: int = 0,
    workers: int = 1,
    limit: float = LIMIT,
    tell: Callable[[Outcome], None] = lambda outcome: None,
) -> Tally:
    """Run `cases` cases of each of some families, on `workers` processes; `tell` is called with every outcome."""
    jobs = ((name, seed, number) for number in range(cases) for name in names)
    tally, left = Tally(), cases * len(names)
    modules = sorted({families()[name].module for name in names})
    crew = [Worker(modules) for _ in range(workers)]
    try:
        while left:
            heard = wait([worker.pipe for worker in crew], timeout=0.5)
            for worker in crew:
                outcome = worker.hear(worker.pipe in heard, limit)
                if outcome is not None:
                    left -= 1
                    tally.add(outcome)
                    tell(outcome)
                if worker.is_ready and worker.job is None and (job := next(jobs, None)) is not None:
                    worker.give(job)
    finally:
        for worker in crew:
            worker.end()
    return tally
