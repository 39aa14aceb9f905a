"""Curves as people draw them, on surfaces and in the plane: distance is finite, and right or announced as a guess."""

from __future__ import annotations

import warnings
from collections.abc import Callable
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


def build_in_plane(random: np.random.Generator, folder: Path) -> tuple[str, tuple[strokes.Drawing, list[sh.Polyline]]]:
    """The same in the plane."""
    damage = str(random.choice(list(strokes.DAMAGES)))
    return damage, strokes.drawing_in_plane(random, damage)


def check(case: tuple[str, strokes.Drawing]) -> str:
    """How distance to what was drawn compares with what was meant, and whether it is announced as a guess."""
    damage, drawing = case
    return f"{damage}: {judged(drawing, lambda: sh.signed_distance(drawing.given, drawing.mesh).values)}"


def check_in_plane(case: tuple[str, tuple[strokes.Drawing, list[sh.Polyline]]]) -> str:
    """The same in the plane."""
    damage, (drawing, lines) = case
    places = drawing.mesh.vertices[:, :2]
    grid = sh.Grid.around([places.min(axis=0), places.max(axis=0)], padding=0.0)
    return f"{damage}: {judged(drawing, lambda: sh.signed_distance(lines, grid)(places))}"


def judged(drawing: strokes.Drawing, measure: Callable[[], np.ndarray]) -> str:
    """Whether distance at the vertices of a drawing has the right signs, and whether a guess is announced."""
    with warnings.catch_warnings(record=True) as announced:
        warnings.simplefilter("always")
        values = measure()
    if not np.isfinite(values).all():
        raise Wrong("not finite", str(np.flatnonzero(~np.isfinite(values))[:5]))
    share = strokes.wrong_share(drawing, values)
    found = "right" if share < MOST else f"{'much' if share > 3 * MOST else 'partly'} wrong"
    return f"{found} {'announced' if announced else 'in silence'}"


family("strokes", build, check)
family("drawings", build_in_plane, check_in_plane)
