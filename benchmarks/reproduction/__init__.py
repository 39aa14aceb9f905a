"""The figures of the paper (Feng & Crane 2024), one function each, and the methods that it compares with."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # where shapes are
