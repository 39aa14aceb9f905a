"""What a note on a computation is."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..frozen import Frozen
from ..reprs import ShortRepr


@dataclass(frozen=True, eq=False, repr=False)
class Note(Frozen, ShortRepr):
    """A note on a computation; ``str(note)`` is its text."""

    @property
    def important(self) -> bool:
        """Whether it should be read before the result is trusted: commands print it."""
        return False

    def as_dict(self) -> dict[str, object]:
        """The values of the note by name, ready for JSON."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values.items()}
