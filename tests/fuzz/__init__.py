"""A fuzzer: cases by seed, each in a worker with a watchdog. `fuzz.frame` tells how families of cases are written."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2]))  # where `shapes` is
