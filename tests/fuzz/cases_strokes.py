"""Curves on surfaces as people draw them: distance is finite, and right or told to be in doubt."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, family
from shapes import strokes

MOST = 0.06
"""Share of the area that may be on the wrong side without a warning."""


def build(random: np.random.Generator, folder: Path) -> strokes.Drawing:
    """A damaged drawing on a random surface."""
    return strokes.drawing(random, random.choice(list(strokes.DAMAGES)))


def check(drawing: strokes.Drawing) -> str:
    """Distance to what was drawn, beside what was meant."""
    mesh = drawing.mesh
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        values = sh.signed_distance(drawing.given, mesh).values
    if not np.isfinite(values).all():
        raise Wrong("not finite", str(np.flatnonzero(~np.isfinite(values))[:5]))
    if told:
        return "told"
    exact = np.abs(sh.signed_distance(drawing.whole, mesh, as_oriented=True).values)
    wrong = (np.sign(values) != drawing.sides) & (exact > 2 * strokes.edge_length(mesh))
    areas = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), mesh.n_vertices)
    share = areas[wrong].sum() / areas.sum()
    return "right" if share < MOST else f"{'much' if share > 3 * MOST else 'partly'} wrong in silence"


family("strokes", build, check)
