"""Short texts of values and of frozen dataclasses, for people who look at them: few digits, no whole arrays."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np

MOST = 6
"""Arrays and sequences of up to this many numbers are written out."""


class ShortRepr:
    """A dataclass, made with ``repr=False``, whose representation is short."""

    def __repr__(self) -> str:
        assert is_dataclass(self)
        parts = (f"{entry.name}={short(getattr(self, entry.name))}" for entry in fields(self) if entry.repr)
        return f"{type(self).__name__}({', '.join(parts)})"


def short(value: object) -> str:
    """Write a value as a short text: four digits of numbers, the size of arrays."""
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= MOST and value.dtype.kind in "biuf":
            return f"[{', '.join(short(entry) for entry in value.tolist())}]"
        what = {"b": "booleans", "f": "numbers", "i": "numbers", "u": "numbers"}.get(value.dtype.kind, "entries")
        return f"{' × '.join(map(str, value.shape))} {what}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name}: {short(entry)}' for name, entry in value.items())}}}"
    if type(value) in (tuple, list) and isinstance(value, tuple | list):
        if len(value) > MOST:
            return f"{len(value)} entries"
        inner = ", ".join(short(entry) for entry in value)
        return f"({inner})" if isinstance(value, tuple) else f"[{inner}]"
    return repr(value)
