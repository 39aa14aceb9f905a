"""Levels and distances that are no numbers are refused by every field."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

BALL = samples.sphere(2)
FIELDS = {
    "grid": lambda: sh.SignedHeatSolver(sh.Grid.around(BALL, 12)).distance(BALL),
    "plane": lambda: sh.SignedHeatSolver(
        sh.Grid.around(sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True), 12)
    ).distance(sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True)),
    "tets": lambda: sh.SignedHeatSolver(sh.tetrahedralize(BALL, resolution=3)).distance(BALL),
    "band": lambda: sh.signed_distance(BALL, sh.Grid.around(BALL.bounds, 40), band=0.3),
    "surface": lambda: sh.SignedHeatSolver(BALL).distance(BALL.level_set(BALL.vertices[:, 2], 0.1)),
}
ODD = [np.nan, np.inf, np.array([0.1, 0.2]), "x", None, True, 1j, 10**400]


@pytest.mark.parametrize("name", FIELDS)
def test_odd_levels(tmp_path, name):
    field = FIELDS[name]()
    for odd in ODD:
        with refused(sh.errors.SignedHeatError, "level"):
            field.contour(odd)
        if name != "surface":
            with refused(sh.errors.SignedHeatError, "distance"):
                field.offset(odd)
        if name == "band":
            with refused(sh.errors.SignedHeatError, "level"):
                field.save_contour(tmp_path / "made.ply", odd)
    assert not list(tmp_path.iterdir())
