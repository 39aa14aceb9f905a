"""Gaps of curves that nearly close, and those gaps at which the completion by heat bulges towards other curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.components import connected_components
from ..parallel import PointTree
from ..surfaces.source_segments import NEARLY_CLOSED

BULGE = 0.1
"""Distance of the zero set from the straight line across a gap, relative to the width of the gap, above which it counts
as a bulge, if another curve is nearer to that line than the width. Of nine bands on a sphere, each with a gap in its
boundary, 1 to 11 % of eight are wrong without straight lines, and at 0.25; none is at 0.1, nor at 0.05. Of 18 random
drawings none bulges at 0.05."""
POINTS_ACROSS = 16
"""Number of points on the straight line across a gap to which distances are measured."""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps between the k open strokes of curves that nearly close.

    A stroke is followed by the one that begins nearest to its end. Strokes that follow each other form one curve.
    """

    strokes: Ints  # (g, 2) index of the stroke that ends at each gap, and of the one that begins there
    lines: Floats  # (g, 2, d) ends of the straight line across each gap
    curve: Ints  # (k,) label of the curve that each stroke is part of

    @classmethod
    def of(cls, strokes: Sequence[Floats]) -> Gaps:
        """Find the gaps between open strokes, each given by (n, d) points; there is at least one stroke."""
        begins, ends = (np.array([points[k] for points in strokes]) for k in (0, -1))
        lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in strokes]
        gaps, following = PointTree(begins).query(ends)
        curve = connected_components(len(strokes), np.arange(len(strokes)), following)
        closes = np.bincount(curve, gaps) < NEARLY_CLOSED * np.bincount(curve, lengths)
        wide = np.flatnonzero(closes[curve] & (gaps > 0))
        pairs = np.stack([wide, following[wide]], axis=1)
        return cls(pairs, np.stack([ends[wide], begins[following[wide]]], axis=1), curve)

    def bulging(self, strokes: Sequence[Floats], closed: Sequence[Floats], line: Floats, least: float) -> Ints:
        """Return (b, 2) `strokes` of the gaps wider than `least` at which a completion of the curves bulges.

        `line` are (n, d) points of the completion. Each counts for the gap whose straight line is nearest to it, unless
        a stroke or a `closed` curve is nearer. `BULGE` says what a bulge is.
        """
        tails, heads = self.lines.transpose(1, 0, 2)
        widths = np.linalg.norm(heads - tails, axis=1)
        across = tails[:, None] + np.linspace(0, 1, POINTS_ACROSS)[:, None] * (heads - tails)[:, None]
        drawn = np.concatenate([*strokes, *closed])
        away, nearest = PointTree(across.reshape(-1, drawn.shape[1])).query(line)
        counts = away < PointTree(drawn).query(line)[0]
        height = np.zeros(len(widths))
        np.maximum.at(height, nearest[counts] // POINTS_ACROSS, away[counts])
        # every closed curve gets a label of its own
        labels = np.concatenate([self.curve, self.curve.max() + 1 + np.arange(len(closed))])
        label = np.repeat(labels, [len(points) for points in (*strokes, *closed)])
        own, chosen = self.curve[self.strokes[:, 0]], (widths > least) & (height > BULGE * widths)
        for gap in np.flatnonzero(chosen).tolist():
            others = drawn[label != own[gap]]
            chosen[gap] = len(others) and PointTree(others).query(across[gap])[0].min() < widths[gap]
        return self.strokes[chosen]
