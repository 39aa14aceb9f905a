"""Gaps of curves that nearly close, and where heat bulges there, drawn to other curves beside the gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.components import connected_components
from ..parallel import PointTree
from ..surfaces.source_segments import NEARLY_CLOSED

BULGE = 0.1
"""Heat bulges at a gap if its line is farther than this from the straight one, relative to the length of that, while
another curve is nearer than that length. Of nine bands on a sphere, with a gap in a rim each, 1 to 11 % of eight are
wrong without straight lines, and at 0.25; none is at 0.1, nor at 0.05. Of 18 random drawings none bulges at 0.05."""
POINTS_ACROSS = 16
"""Points on the straight line across a gap, to which distance is measured."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps of curves that nearly close.

    Strokes are one curve if they follow each other, each the nearest one to the end of the last.
    """

    strokes: Ints  # (g, 2) numbers of the stroke that ends at a gap, and of the next to begin
    lines: Floats  # (g, 2, d) straight lines from the one to the other
    curve: Ints  # (k,) the curve that each stroke is part of

    @classmethod
    def of(cls, strokes: Sequence[Floats]) -> Gaps:
        """Find the gaps of open strokes, (n, d) points each, at least one."""
        begins, ends = (np.array([points[k] for points in strokes]) for k in (0, -1))
        lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in strokes]
        gaps, following = PointTree(begins).query(ends)
        curve = connected_components(len(strokes), np.arange(len(strokes)), following)
        closes = np.bincount(curve, gaps) < NEARLY_CLOSED * np.bincount(curve, lengths)
        wide = np.flatnonzero(closes[curve] & (gaps > 0))
        pairs = np.stack([wide, following[wide]], axis=1)
        return cls(pairs, np.stack([ends[wide], begins[following[wide]]], axis=1), curve)

    def bulging(self, strokes: Sequence[Floats], closed: Sequence[Floats], line: Floats, least: float) -> Ints:
        """(b, 2) `strokes` of gaps longer than `least` at which the completion, points (n, d) of a line, bulges.

        Points count for the gap that they are nearest to, if no stroke or closed curve is nearer.
        """
        tails, heads = self.lines.transpose(1, 0, 2)
        widths = np.linalg.norm(heads - tails, axis=1)
        across = tails[:, None] + np.linspace(0, 1, POINTS_ACROSS)[:, None] * (heads - tails)[:, None]
        drawn = np.concatenate([*strokes, *closed])
        away, nearest = PointTree(across.reshape(-1, drawn.shape[1])).query(line)
        counts = away < PointTree(drawn).query(line)[0]
        height = np.zeros(len(widths))
        np.maximum.at(height, nearest[counts] // POINTS_ACROSS, away[counts])
        # every closed curve is one of its own
        names = np.concatenate([self.curve, self.curve.max() + 1 + np.arange(len(closed))])
        name = np.repeat(names, [len(points) for points in (*strokes, *closed)])
        own, chosen = self.curve[self.strokes[:, 0]], (widths > least) & (height > BULGE * widths)
        for gap in np.flatnonzero(chosen).tolist():
            others = drawn[name != own[gap]]
            chosen[gap] = len(others) and PointTree(others).query(across[gap])[0].min() < widths[gap]
        return self.strokes[chosen]
