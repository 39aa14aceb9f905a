"""A server's loop: ``python -m fuzz.server SECONDS [SEED]``, in the folder tests, reads mixed uploads for so long.

Seconds are those of a processor. Each upload is a right file, one that is damaged, or one that expands. It is read
within a budget and, where it is small, completed and asked for distances. Told are the outcomes, the longest time of an
upload, and by how much memory grew after the first tenth. The status is 1 if anything but an answer or a refusal came
out.
"""

from __future__ import annotations

import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

import signedheat as sh
from expanding_files import EXPANSIONS
from fuzz.cases_files import KINDS
from fuzz.forked import forked
from fuzz.mutations import damaged

BUDGET = sh.io.Budget(bytes=5e8, seconds=5.0)
MOST_FACES = 2000
"""Faces of an upload that is completed."""


def resident() -> int:
    """Bytes of memory that this process holds."""
    return 1024 * int(Path("/proc/self/status").read_text().partition("VmRSS:")[2].split()[0])


def upload(random: np.random.Generator, folder: Path) -> str:
    """Take one upload; returns what became of it."""
    if random.random() < 0.2:
        kind = str(random.choice(list(EXPANSIONS)))
        name, write, read, levels = EXPANSIONS[kind]
        write(folder / name, int(random.integers(0, levels + 1)))
    else:
        read, variants = KINDS[str(random.choice(list(KINDS)))]
        files = variants()[int(random.integers(len(variants())))]
        name = next(iter(files))
        for own, data in files.items():
            changed = own == name and random.random() < 0.5
            (folder / own).write_bytes(damaged(random, data) if changed else data)
    try:
        with BUDGET:
            shape = read(folder / name)
        if isinstance(shape, sh.TriangleMesh | sh.PolygonMesh) and len(shape.triangulation.faces) <= MOST_FACES:
            if not np.isfinite(sh.complete(shape).distance(shape.bounds)).all():
                return "NaN"
            return "answered"
        return "read"
    except sh.SignedHeatError as error:
        return f"refused ({type(error).__name__})"


def main(seconds: float, seed: int = 0) -> int:
    """Run the loop, and tell what came out."""
    outcomes: Counter[str] = Counter()
    random, longest, held = np.random.default_rng(seed), 0.0, 0
    wrong: list[str] = []
    while time.process_time() < seconds:
        begin = time.process_time()
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                kind = upload(random, Path(folder))
            except BaseException as error:
                kind = type(error).__name__
                wrong.append(traceback.format_exc())
        outcomes[kind] += 1
        if time.process_time() > 0.1 * seconds:
            held = held or resident()
            longest = max(longest, time.process_time() - begin)
    print(*wrong, sep="\n")
    print(f"{sum(outcomes.values())} uploads: {', '.join(f'{kind} {n}' for kind, n in outcomes.most_common())}")
    print(f"longest {longest:.1f} s; memory {held / 1e6:.0f} MB after a tenth, {resident() / 1e6:.0f} MB at the end")
    return int(bool(wrong) or outcomes["NaN"] > 0)


if __name__ == "__main__":
    with forked():
        status = main(float(sys.argv[1]), *map(int, sys.argv[2:3]))
    sys.exit(status)
