"""Curves as people draw them: how often distance to them is wrong, and how often it is announced.

Closed curves on random surfaces are damaged in each of the ways of `shapes.strokes`, and `sh.signed_distance` of what
is left is compared with the sides that were meant. Of every seed and damage there is one case; it is wrong if more than
6 % of the area, farther than two edges from the curves, has the wrong sign. Seeds from 1000 on are not used to choose
numbers of the package. A warning about a right answer is due, which is counted by itself, where more than a quarter of
the length was left out, all of it in strokes that lead farther than an edge away from the curves, or where about half
of the length was turned, so that nothing in the drawing tells which half is right.

    python benchmarks/strokes.py [--seeds 1000 1025] [--fine 3] [--processes 2] [--worst 20 --picture worst.png]
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat.curves.curve_distance import MOST_LEFT_OUT, CurvesTaken
from signedheat.curves.stroke_directions import HALF

sys.path.insert(0, str(Path(__file__).parents[1]))
from shapes import strokes

MOST = 0.06
"""Share of the area that may be on the wrong side."""


@dataclass(frozen=True)
class Outcome:
    """What came of one case."""

    damage: str
    seed: int
    share: float
    warned: str
    due: bool
    seconds: float

    @property
    def wrong(self) -> bool:
        return self.share > MOST


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=(1000, 1025))
    parser.add_argument("--damages", nargs="+", default=list(strokes.DAMAGES))
    parser.add_argument("--fine", type=int, default=3, help="fineness of the surfaces")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--worst", type=int, default=20, help="how many of the worst are named")
    parser.add_argument("--picture", help="where to draw them")
    arguments = parser.parse_args()
    cases = [(d, s, arguments.fine) for s in range(*arguments.seeds) for d in arguments.damages]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(arguments.processes) as pool:
        for each in pool.map(outcome, *zip(*cases, strict=True)):
            outcomes.append(each)
            if len(outcomes) % 100 == 0:
                table(outcomes)
    table(outcomes)
    bad = [o for o in outcomes if o.wrong != (bool(o.warned) and not (o.due and not o.wrong))]
    bad.sort(key=lambda o: -o.share if o.wrong else 0.0)
    for o in bad[: arguments.worst]:
        print(f"{o.damage:>14} {o.seed:5d}: {o.share:6.1%} wrong, {o.warned[:100] or 'no warning'}")
    if arguments.picture:
        draw(bad[: arguments.worst], arguments.fine, arguments.picture)


def drawn(damage: str, seed: int, fine: int) -> strokes.Drawing:
    """The case of a seed and a damage."""
    return strokes.drawing(np.random.default_rng([seed, list(strokes.DAMAGES).index(damage)]), damage, fine)


def outcome(damage: str, seed: int, fine: int) -> Outcome:
    """Share of the area on the wrong side, and the warning."""
    drawing = drawn(damage, seed, fine)
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        field = sh.signed_distance(drawing.given, drawing.mesh)
    seconds = time.perf_counter() - begin
    share, told_of = strokes.wrong_share(drawing, field.values), "; ".join(str(w.message) for w in told)
    return Outcome(damage, seed, share, told_of, is_due(drawing, field), seconds)


def is_due(drawing: strokes.Drawing, field: sh.Field) -> bool:
    """Whether a warning is due although the answer is right: see the module."""
    note, mesh = field.diagnostics.note(CurvesTaken), drawing.mesh
    if note is None:
        return False
    lengths = np.array([strokes.length(mesh, curve) for curve in drawing.given])
    if lengths[note.turned].sum() > HALF * lengths.sum():
        return True
    exact = np.abs(sh.signed_distance(drawing.whole, mesh, as_oriented=True).values)
    away = [
        np.einsum("nk,nk->n", curve.barycentric, exact[mesh.faces[curve.faces]]).max()
        for curve in (drawing.given[k] for k in note.left_out)
    ]
    return note.share_left_out > MOST_LEFT_OUT and min(away) > strokes.edge_length(mesh)


def table(outcomes: list[Outcome]) -> None:
    """The confusion matrix, by damage and of all; printed after every hundred cases."""
    heads = ("right", "wrong, warned", "right, due", "right, warned", "wrong in silence")
    print(f"{'':>14} {'cases':>6} " + " ".join(f"{head:>17}" for head in heads) + "  s")
    for name in [*dict.fromkeys(o.damage for o in outcomes), "all"]:
        of = [o for o in outcomes if name in (o.damage, "all")]
        kinds = [(o.wrong, bool(o.warned), o.due and not o.wrong) for o in of]
        columns = [(False, False, False), (True, True, False), (False, True, True), (False, True, False)]
        shares = [f"{kinds.count(column) / len(of):17.1%}" for column in [*columns, (True, False, False)]]
        print(f"{name:>14} {len(of):6d} " + " ".join(shares) + f"  {np.median([o.seconds for o in of]):.2f}")


def draw(outcomes: list[Outcome], fine: int, file: str) -> None:
    """The signs of distance, what was given (black) and what was meant (yellow), from two sides."""
    import pyvista as pv

    rows = -(-len(outcomes) // 5)
    plotter = pv.Plotter(shape=(rows, 10), window_size=(2600, 300 * rows), off_screen=True)
    for k, o in enumerate(outcomes):
        drawing = drawn(o.damage, o.seed, fine)
        mesh = drawing.mesh
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            values = sh.signed_distance(drawing.given, mesh).values
        size = strokes.edge_length(mesh)
        for side in (1, -1):
            plotter.subplot(k // 5, 2 * (k % 5) + (side < 0))
            surface = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
            plotter.add_mesh(surface, scalars=np.sign(values), cmap="coolwarm", show_scalar_bar=False, clim=(-1.5, 1.5))
            for curves, color, radius in ((drawing.whole, "yellow", 0.06), (drawing.given, "black", 0.1)):
                for curve in curves:
                    line = pv.lines_from_points(strokes.positions(mesh, curve))
                    plotter.add_mesh(line.tube(radius=radius * size), color=color)
            plotter.add_text(f"{o.damage} {o.seed}: {o.share:.0%}{' w' * bool(o.warned)}", font_size=7)
            middle, reach = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max()
            plotter.camera_position = [middle + side * reach * np.array([1.2, -1.0, 1.0]), middle, (0, 0, 1)]
    plotter.screenshot(file)


if __name__ == "__main__":
    main()
