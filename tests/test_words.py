"""Numbers in sentences."""

from __future__ import annotations

import re

import numpy as np
import pytest

from signedheat import diagnostics
from signedheat.errors import Sentence, counted, percent


@pytest.mark.parametrize("share", [0.0, 1e-12, 1e-5, 0.004999, 0.12345, 0.9994, 0.99951, 0.999999, 1.0, 1.5, 123.0])
@pytest.mark.parametrize("digits", [1, 2, 3])
def test_shares_are_near_and_well_formed(share, digits):
    text = percent(share, digits)
    assert re.fullmatch(r"[0-9]+(\.[0-9]+)? %|[0-9.]+e-[0-9]+ %", text) and "e+" not in text
    assert float(text.removesuffix(" %")) == pytest.approx(100 * share, rel=0.5 * 10.0 ** (1 - digits) + 1e-12)


def test_counts():
    assert [counted(n, "face") for n in (0, 1, np.int64(1), 2)] == ["0 faces", "1 face", "1 face", "2 faces"]
    assert [counted(2, noun) for noun in ("vertex", "body", "box", "mesh")] == [
        "2 vertices", "2 bodies", "2 boxes", "2 meshes",
    ]  # fmt: skip
    assert Sentence().format("{0:face}, {1:%} and {2:.3g}", 1, 0.5, 2.0) == "1 face, 50 % and 2"


def test_notes_have_no_exponents_in_percent_and_no_wrong_plurals():
    notes = [
        diagnostics.LeftOut(1, 0.9999999, 1),
        diagnostics.FacesRestored(1, 0.9999999),
        diagnostics.BoundsNothing(1.0),
        diagnostics.OrientedPoints(1, 1),
        diagnostics.CompletedArea(1.0, 0.99999999, []),
        diagnostics.ShapeOriented(1, 0.9999999, 1, 1, 0, 0.0, 0, 0),
    ]
    for note in notes:
        assert not re.search(r"e\+|[0-9]%|\b1 [a-z]+s\b", str(note)), str(note)
