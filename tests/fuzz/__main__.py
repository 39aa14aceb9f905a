"""``python -m fuzz``, in the folder tests: run families of cases, or replay one case."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from contextlib import suppress

from fuzz.frame import LIMIT, Outcome, Tally, families, run, run_case


def main() -> int:
    """Run, tell failures as they come, and count; 1 if there were any."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("families", nargs="*", help="all by default; `files` means all whose name begins with files")
    parser.add_argument("--cases", type=int, default=10_000, help="of each family (10,000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--limit", type=float, default=LIMIT, help="processor seconds for a case (30)")
    parser.add_argument("--replay", metavar="SEED:NUMBER", help="run one case here, and show what it does")
    parser.add_argument("--list", action="store_true", help="name the families")
    arguments = parser.parse_args()
    known = families()
    wanted = tuple(arguments.families) or tuple(name for name in known if not name.startswith("frame "))
    names = [name for name in known if name.startswith(wanted)]
    if arguments.list or not names:
        print("\n".join(known))
        return 0 if names else 2
    if arguments.replay:
        seed, _, number = arguments.replay.partition(":")
        outcomes = [run_case(known[name], int(seed), int(number)) for name in names]
        print(*outcomes, sep="\n")
        return int(any(outcome.failed for outcome in outcomes))
    begin, tally = time.monotonic(), Tally()

    def tell(outcome: Outcome) -> None:
        tally.add(outcome)
        if outcome.failed:
            print(outcome, flush=True)

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if hasattr(signal, "SIGUSR1"):
        signal.signal(signal.SIGUSR1, lambda *_: print(tally, flush=True))
    with suppress(KeyboardInterrupt):
        run(names, arguments.cases, arguments.seed, arguments.workers, arguments.limit, tell)
    print(tally)
    print(f"{time.monotonic() - begin:.0f} s")
    return int(bool(tally.failures))


if __name__ == "__main__":
    sys.exit(main())
