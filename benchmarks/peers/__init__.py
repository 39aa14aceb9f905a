"""Tasks that `benchmarks/features.py` gives to this library and to others."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # where shapes are
