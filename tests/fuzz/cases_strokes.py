"""Curves on surfaces as people draw them: distance is finite, and right or announced as a guess."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, family
from shapes import strokes

MOST = 0.06
"""Share of the area that may be on the wrong side without a warning."""


def build(random: np.random.Generator, folder: Path) -> tuple[str, strokes.Drawing]:
    """A way to damage curves, and a drawing on a random surface damaged so."""
    damage = str(random.choice(list(strokes.DAMAGES)))
    return damage, strokes.drawing(random, damage)


def check(case: tuple[str, strokes.Drawing]) -> str:
    """How distance to what was drawn compares with what was meant, and whether it is announced as a guess."""
    damage, drawing = case
    mesh = drawing.mesh
    with warnings.catch_warnings(record=True) as announced:
        warnings.simplefilter("always")
        values = sh.signed_distance(drawing.given, mesh).values
    if not np.isfinite(values).all():
        raise Wrong("not finite", str(np.flatnonzero(~np.isfinite(values))[:5]))
    exact = np.abs(sh.signed_distance(drawing.whole, mesh, as_oriented=True).values)
    wrong = (np.sign(values) != drawing.sides) & (exact > 2 * strokes.edge_length(mesh))
    areas = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), mesh.n_vertices)
    share = areas[wrong].sum() / areas.sum()
    found = "right" if share < MOST else f"{'much' if share > 3 * MOST else 'partly'} wrong"
    return f"{damage}: {found} {'announced' if announced else 'in silence'}"


family("strokes", build, check)
