"""Numbers in sentences: counts with their nouns, and shares in percent."""

from __future__ import annotations

from string import Formatter
from typing import Any

ENDINGS = {"ex": "ices", "y": "ies", "sh": "shes", "x": "xes"}
"""Plurals other than by s, by the endings of nouns."""


def counted(n: int, noun: str) -> str:
    """Write a count with its noun.

    Examples
    --------
    >>> counted(1, "line"), counted(0, "vertex"), counted(1024, "body")
    ('1 line', '0 vertices', '1024 bodies')
    """
    if n == 1:
        return f"1 {noun}"
    ending = next((ending for ending in ENDINGS if noun.endswith(ending)), "")
    return f"{n} {noun.removesuffix(ending)}{ENDINGS.get(ending, 's')}"


def percent(share: float, digits: int = 3) -> str:
    """Write a share in percent.

    Examples
    --------
    >>> percent(0.999999), percent(0.12345), percent(1e-5)
    ('100 %', '12.3 %', '0.001 %')
    """
    return f"{float(f'{100 * share:.{digits}g}'):.{max(digits, 15)}g} %"  # rounded, and without an exponent


class Sentence(Formatter):
    """Formats shares as ``{:%}``, and counts by their nouns, such as ``{:face}``."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Write a value as its place in the sentence asks for."""
        if format_spec == "%":
            return percent(value)
        return (
            counted(value, format_spec)
            if len(format_spec) > 1 and format_spec.isalpha()
            else format(value, format_spec)
        )
