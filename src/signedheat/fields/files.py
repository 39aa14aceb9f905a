"""Writing of fields, provided by `signedheat.io`."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from ..slots import Slot

save_field: Slot[[object, str | PathLike[str]], None] = Slot("save_field")
"""Write a field of any kind in the format given by the extension of the file."""

save_parts: Slot[[Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]], str | PathLike[str]], tuple[int, int]]
save_parts = Slot("save_parts")
"""Write triangles to a file as they come, and return how many vertices and faces there were."""
