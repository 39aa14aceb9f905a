"""Writing of fields, provided by `signedheat.io`."""

from __future__ import annotations

from os import PathLike

from ..slots import Slot

save_field: Slot[[object, str | PathLike[str]], None] = Slot("save_field")
"""Write a field of any kind in the format given by the extension of the file."""
