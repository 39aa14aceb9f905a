"""A worker process: does one task after the other, which it gets on standard input, and answers on standard output.

``python -m signedheat.batches.worker`` is started by `Worker`, and ends when its standard input does.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import sys
import threading
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO

from .task import Answer, Task, attempt


def main() -> None:
    """Answer tasks until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the process that started this one
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anybody prints must not come between the answers
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")  # where memory ends, let it be this process that dies
    tasks: queue.Queue[Task | Answer] = queue.Queue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, tasks), daemon=True).start()
    import_module(f"{Task.__module__.partition('.')[0]}.public")  # all of it, so that no shape's time is spent on that
    _send(answers, None)
    while True:
        task = tasks.get()
        _send(answers, attempt(task) if isinstance(task, Task) else task)


def _receive(source: IO[bytes], tasks: queue.Queue[Task | Answer]) -> None:
    """Hand on tasks; at their end, or that of the process they come from, end at once."""
    while True:
        try:
            tasks.put(pickle.load(source))
        except EOFError:
            os._exit(0)
        except Exception as error:  # its module, most likely, cannot be imported here
            tasks.put(Answer(f"the job cannot be received by a worker ({type(error).__name__}: {error})"))


def _send(target: IO[bytes], thing: object) -> None:
    try:
        pickle.dump(thing, target)
        target.flush()
    except BrokenPipeError:
        os._exit(0)


if __name__ == "__main__":
    main()
