"""How fields reach files, without a word about formats here."""

from __future__ import annotations

from os import PathLike

from ..slots import Slot

save_field: Slot[[object, str | PathLike[str]], None] = Slot("save_field")
"""Write a field of any kind in the format that the file's name ends with."""
