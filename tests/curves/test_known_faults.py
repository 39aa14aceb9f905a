"""What is known to come out wrong: a test that passes one day says that it is mended."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples


@pytest.mark.xfail(
    reason="a loop round a torus bounds no set, and what agrees along it is biased by diagonals", strict=True
)
def test_a_turned_quarter_of_a_loop_round_a_torus_is_found():
    mesh = samples.torus(n_around=48, n_across=24)
    pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    pieces[1] = pieces[1].reversed()
    turned = sh.orient(pieces, mesh)
    kept = [bool(piece.faces[0] == given.faces[0]) for piece, given in zip(turned, pieces, strict=True)]
    assert kept == [True, False, True, True]
