"""Limits on what reading one file may use: memory, elements and points that it repeats, and processor time.

A file of some kilobytes can stand for any number of points: parts that name other parts, arrays that are packed or used
again. Therefore each reader charges what it is about to make to the account of the file, which is refused before the
memory is allocated. `files.reading` opens the account.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import TracebackType

from ..errors import FileFormatError, MemoryLimitError, SignedHeatError
from ..memory import available_memory
from ..validation import positive_number, whole_number

LEAST_SECONDS, BYTES_PER_SECOND = 10.0, 20_000
"""Processor time for any file in seconds, and the bytes of a file that add another second."""
MOST_ELEMENTS, MOST_POINTS = 10**5, 2 * 10**7
"""Elements and points that a file may make by naming parts of itself again. Each of its bytes adds one to both."""
BYTES_PER_PLACED = 70
"""Memory for each point or face of a body that is transformed and joined to a mesh, as measured."""
BYTES_PER_WORD, BYTES_PER_LINE = 58, 120
"""Memory for a word of a text, and for the list of the words of a line."""
XML, JSON = "<=", "[{,:"
"""Characters that count the nodes of a tree: one for each tag and attribute, or for each list and item."""
BYTES_PER_NODE = 100
"""Memory for an element or an attribute of XML, and for a list or a dictionary of JSON."""


@dataclass(frozen=True)
class Budget:
    """Limit the memory and time that reading each file within a ``with`` block may use.

    A server that reads files of strangers sets what one of them may cost. Files that exceed it are refused by an error
    that names them, before the memory is allocated.

    Parameters
    ----------
    bytes : float, optional
        Largest memory in bytes while a file is read, by default the free memory.
    elements : int, optional
        Largest number of elements that a file can repeat by naming them again, such as components, instances and
        ``<use>`` in a drawing. The default is 100,000 and one for every byte of the file.
    points : int, optional
        Largest number of points and faces of these elements. The default is 20 million and one for every byte of the
        file.
    seconds : float, optional
        Largest processor time in seconds. The default is 10 and one more for every 20,000 bytes of the file.

    Raises
    ------
    SignedHeatError
        If a limit is not a positive number.

    See Also
    --------
    read : Read a shape.

    Examples
    --------
    >>> import tempfile, signedheat as sh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sh.samples.sphere(4).save(f"{folder}/ball.ply")
    ...     with sh.io.Budget(bytes=10_000):
    ...         sh.read(f"{folder}/ball.ply")
    Traceback (most recent call last):
    signedheat.errors.MemoryLimitError: ...ball.ply: reading it takes about ...
    """

    bytes: float | None = None
    elements: int | None = None
    points: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        for name in ("elements", "points"):
            if getattr(self, name) is not None:
                whole_number(getattr(self, name), name, 1, SignedHeatError)
        for name in ("bytes", "seconds"):
            if getattr(self, name) is not None:
                positive_number(getattr(self, name), name)

    def __enter__(self) -> Budget:
        _budgets.set((*_budgets.get(), self))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        _budgets.set(_budgets.get()[:-1])


_budgets: ContextVar[tuple[Budget, ...]] = ContextVar("budgets", default=())


@dataclass
class _Account:
    """What reading a file has used so far, and its limits."""

    path: str | os.PathLike[str]
    size: int  # bytes of the file and of those that it names
    budget: Budget
    free: float  # largest memory in bytes: what was free at the beginning, or what the budget allows if that is less
    files: set[str | os.PathLike[str]]  # files whose size is counted
    bytes: float = 0.0  # memory, elements and points that have been charged
    elements: int = 0
    points: int = 0
    begin: float = 0.0  # processor time of the thread at the beginning, in seconds

    def seconds(self, least: float) -> float:
        """Return the largest processor time in seconds; by default `least` and more for large files."""
        given = self.budget.seconds
        return least + self.size / BYTES_PER_SECOND if given is None else given


_open: ContextVar[_Account | None] = ContextVar("account", default=None)


@contextmanager
def account(path: str | os.PathLike[str]) -> Iterator[_Account]:
    """Open the account of a file, or within that of another file, which names this one, continue that account."""
    current = _open.get()
    try:
        size = os.stat(path).st_size
    except (OSError, ValueError, TypeError):  # refused when it is opened
        size = 0
    if current is not None:
        if path not in current.files:
            current.files.add(path)
            current.size += size
        yield current
        return
    budget = (*_budgets.get()[-1:], Budget())[0]
    free, given = available_memory(), budget.bytes
    limits = [bound for bound in (free, given) if bound is not None]
    opened = _Account(path, size, budget, min(limits, default=math.inf), {path}, begin=time.thread_time())
    token = _open.set(opened)
    try:
        yield opened
    finally:
        _open.reset(token)


def charge(bytes: float = 0, elements: int = 0, points: int = 0) -> None:
    """Add to what reading the current file has used; raise an error if that exceeds the budget of the file."""
    current = _open.get()
    if current is None:
        return
    current.bytes += bytes
    current.elements += elements
    current.points += points
    if current.bytes > current.free:
        raise MemoryLimitError(
            f"reading it takes about {current.bytes / 1e9:.3g} GB of memory, and {current.free / 1e9:.3g} GB are "
            f"{'free' if current.budget.bytes is None else 'allowed'}",
            remedy="check that it is not damaged, or free some memory",
            path=current.path,
        )
    for noun, made, given, usual, error in (
        ("elements", current.elements, current.budget.elements, MOST_ELEMENTS, FileFormatError),
        ("points", current.points, current.budget.points, MOST_POINTS, MemoryLimitError),
    ):
        most = usual + current.size if given is None else given
        if made > most:
            raise error(
                f"its parts are used again and again: that makes {made:.4g} {noun}, more than {most:.4g}",
                remedy=f"check that it is not damaged, or read it with sh.io.Budget({noun}={made})",
                path=current.path,
            )
    seconds = current.seconds(LEAST_SECONDS)
    if time.thread_time() - current.begin > seconds:
        raise FileFormatError(
            f"reading it takes more than {seconds:.3g} s of processor time",
            remedy="check that it is not damaged, or read it with sh.io.Budget(seconds=...)",
            path=current.path,
        )


def charge_words(content: str | bytes) -> None:
    """Charge the memory of the lists of words and lines into which a text is about to be split."""
    count = _counter(content)
    lines = 1 + count("\n")
    charge(bytes=BYTES_PER_WORD * (lines + sum(map(count, " ,\t"))) + BYTES_PER_LINE * lines)


def charge_tree(content: str | bytes, marks: str) -> None:
    """Charge the memory of the tree into which a text is about to be parsed; `marks` are `XML` or `JSON`."""
    charge(bytes=len(content) + BYTES_PER_NODE * sum(map(_counter(content), marks)))


def _counter(content: str | bytes) -> Callable[[str], int]:
    """Return a function that counts how often a character occurs in a text."""
    return content.count if isinstance(content, str) else lambda character: content.count(character.encode())


def left(path: str | os.PathLike[str], least_seconds: float) -> tuple[float, int]:
    """Return the memory in bytes that is left for a file, and the seconds that a parser of another package may take.

    `least_seconds` is the processor time for any file, to which some is added for large ones.
    """
    with account(path) as current:
        return current.free - current.bytes, max(int(current.seconds(least_seconds)), 1)
