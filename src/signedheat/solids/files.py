"""Writing of solids, provided by `signedheat.io`."""

from __future__ import annotations

from os import PathLike

from ..slots import Slot

save_solid: Slot[[object, str | PathLike[str]], None] = Slot("save_solid")
"""Write a solid."""
