"""Drawings of closed outlines: distance to what they fill, against shapely.

Glyphs of Matplotlib's fonts, in words whose letters overlap; icons (gears, stars and rings); printers' beds with holes;
outlines nested in each other; and such as cross themselves and each other. They run either way at random: letters
together, outlines within others each for itself, where it decides what is a hole, and those that cross, where it should
not matter. Shapely cuts the plane along all outlines, and the rule nonzero or evenodd fills the pieces, by how often
the outlines run around a point in them. A drawing is wrong if at any of 2,000 points, or at a node of the field, the
sign differs, or the distance by more than a millionth of the size; points nearer to the outline do not count.

    python benchmarks/outlines.py [--seeds 0 500] [--picture outlines.png]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray

import signedheat as sh

Outlines = list[NDArray[np.float64]]
Random = np.random.Generator
EXACT = 1e-6
POINTS = 2000
FONTS = ("DejaVu Sans", "DejaVu Serif", "STIXGeneral", "DejaVu Sans Mono", "cmr10")


def main() -> None:
    """Print how many of each kind are wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 500))
    parser.add_argument("--picture", help="where to draw the first ten")
    arguments = parser.parse_args()
    kinds = list(KINDS)
    wrong: dict[str, list[int]] = {kind: [] for kind in kinds}
    counts = dict.fromkeys(kinds, 0)
    refused, worst, shown = [], 0.0, []
    for seed in range(*arguments.seeds):
        kind, fill, groups = drawing(seed)
        counts[kind] += 1
        outlines = [points for group in groups for points in group]
        try:
            field = sh.signed_distance([sh.Polyline(p, closed=True) for p in outlines], resolution=48, fill=fill)
        except sh.SignedHeatError as error:
            refused.append(f"{kind} {seed}: {error}")
            continue
        off = error_of(field, groups, fill, np.random.default_rng(seed))
        worst = max(worst, off)
        if off > EXACT:
            wrong[kind].append(seed)
        if len(shown) < 10:
            shown.append((f"{kind}, {fill}", field, outlines))
    for kind, seeds in wrong.items():
        print(f"{kind:>8}: {len(seeds)} of {counts[kind]} {seeds[:9]}")
    print(f"largest error {worst:.1e} of the size; refused {len(refused)}", *refused[:5], sep="\n")
    if arguments.picture:
        draw(shown, arguments.picture)


def drawing(seed: int) -> tuple[str, Literal["nonzero", "evenodd"], list[Outlines]]:
    """The drawing of a seed: its kind, the rule, and outlines that cut holes in each other, in groups that do not."""
    random, kind = np.random.default_rng([seed, 7]), list(KINDS)[seed % len(KINDS)]
    angle, scale = random.uniform(0, 2 * np.pi), 10 ** random.uniform(-3, 3)
    turn = scale * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    shift = scale * random.uniform(-5, 5, 2)
    outlines = [p @ turn + shift for p in KINDS[kind](random)]
    fill: Literal["nonzero", "evenodd"] = "nonzero" if random.random() < 0.5 else "evenodd"
    back = random.random(1 if kind == "glyphs" else len(outlines)) < 0.5
    boxes = shapely.box(*np.array([[*p.min(axis=0), *p.max(axis=0)] for p in outlines]).T)
    if kind == "crossing":  # one within another would be a hole
        back &= shapely.contains(boxes[:, None], boxes).sum(axis=0) == 1
    given = [p[::-1] if turned else p for p, turned in zip(outlines, np.resize(back, len(outlines)), strict=True)]
    return kind, fill, [[p] for p in given] if kind == "crossing" else [given]


def circle(radius: float, n: int, x: float = 0.0, y: float = 0.0) -> NDArray[np.float64]:
    """A polygon round a place."""
    angles = 2 * np.pi * np.arange(n) / n
    return np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)


def glyphs(random: Random) -> Outlines:
    """A word, whose letters may overlap."""
    from matplotlib.textpath import TextPath

    found: Outlines = []
    for k in range(random.integers(1, 5)):
        letter = random.choice(list("ABDGOQRabdegkopqrs&%@68930ijt=:"))
        path = TextPath((0, 0), letter, size=1, prop={"family": [str(random.choice(FONTS))]})
        shift = [random.uniform(0.3, 0.8) * k, random.uniform(-0.1, 0.1)]  # off the line of others
        found += [np.add(p[:-1], shift) for p in path.to_polygons() if len(p) > 3]
    return found


def icons(random: Random) -> Outlines:
    """A gear, a star or a flower, with rings or stars in it."""
    teeth = int(random.integers(5, 24))
    radii = np.where(np.arange(4 * teeth) % 4 < 2, 1.0, random.uniform(0.6, 0.95))
    gear = circle(1.0, 4 * teeth) * radii[:, None]
    star = circle(1.0, 2 * teeth) * np.where(np.arange(2 * teeth) % 2, random.uniform(0.3, 0.8), 1.0)[:, None]
    rings = [circle(r, int(random.integers(3, 60))) for r in random.uniform(0.05, 0.25, random.integers(0, 4))]
    return [gear if random.random() < 0.5 else star, *rings]


def beds(random: Random) -> Outlines:
    """A rectangle with round corners, and holes and slots in it."""
    w, h, r = random.uniform(1, 3), random.uniform(1, 2), random.uniform(0.05, 0.4)
    corner = circle(r, 32)
    middles = np.repeat([[w, h], [-w, h], [-w, -h], [w, -h]], 8, axis=0) * (1 - r / min(w, h))
    holes = [circle(random.uniform(0.02, 0.1), 24, *random.uniform(-0.8, 0.8, 2)) for _ in range(random.integers(1, 9))]
    slots = [shapely.box(*(at := random.uniform(-0.8, 0.5, 2)), *(at + random.uniform(0.05, 0.3, 2))) for _ in range(3)]
    return [middles + corner, *holes, *(np.array(slot.exterior.coords[:-1]) for slot in slots)]


def nested(random: Random) -> Outlines:
    """Polygons within each other, and beside each other."""
    n = int(random.integers(3, 12))
    middles = [(0.0, 0.0), (2.5, 0.3)][: random.integers(1, 3)]
    return [circle(r, n, x, y) for x, y in middles for r in np.linspace(1, 0.2, random.integers(2, 7))]


def crossing(random: Random) -> Outlines:
    """Polygons on random corners, and circles that overlap them."""
    polygons = [random.uniform(-1, 1, (random.integers(4, 16), 2)) for _ in range(random.integers(1, 3))]
    return [*polygons, *(circle(0.5, 40, *random.uniform(-1, 1, 2)) for _ in range(random.integers(0, 4)))]


KINDS: dict[str, Callable[[Random], Outlines]] = {
    made.__name__: made for made in (glyphs, icons, beds, nested, crossing)
}


def turns(outlines: Outlines, places: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) how often outlines run around places, counter-clockwise."""
    total = np.zeros(len(places), dtype=np.int64)
    x, y = places.T[:, :, None]
    for points in outlines:
        (ax, ay), (bx, by) = points.T, np.roll(points, -1, axis=0).T
        left = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        total += ((ay <= y) & (by > y) & (left > 0)).sum(axis=1) - ((ay > y) & (by <= y) & (left < 0)).sum(axis=1)
    return total


def error_of(field: sh.Field[sh.Grid], groups: list[Outlines], fill: str, random: Random) -> float:
    """Largest error of distance relative to the size: where the sign is wrong, twice the distance."""
    outlines = [points for group in groups for points in group]
    lines = shapely.unary_union([shapely.LinearRing(p) for p in outlines])
    pieces = np.array(list(shapely.polygonize(list(lines.geoms) if hasattr(lines, "geoms") else [lines]).geoms))
    around = np.array([turns(group, shapely.get_coordinates(shapely.point_on_surface(pieces))) for group in groups])
    filled = shapely.unary_union(
        pieces[(around != 0).any(axis=0) if fill == "nonzero" else around.sum(axis=0) % 2 == 1]
    )
    low, high = np.concatenate(outlines).min(axis=0), np.concatenate(outlines).max(axis=0)
    size = float((high - low).max())
    places = random.uniform(low - 0.2 * size, high + 0.2 * size, (POINTS, 2))
    places = np.concatenate([places, field.domain.points.reshape(-1, 2)])
    values = np.concatenate([field(places[:POINTS]), field.values.ravel()])
    inside = shapely.contains_xy(filled, *places.T)
    exact = shapely.distance(shapely.points(places), filled.boundary) * np.where(inside, -1, 1)
    near = (np.abs(exact) < EXACT * size) & (np.abs(values) < 2 * EXACT * size)
    known = ~np.isnan(values) & ~near
    return float(np.abs(values - exact)[known].max() / size)


def draw(shown: list[tuple[str, sh.Field[sh.Grid], Outlines]], file: str) -> None:
    """What is inside, and lines of equal distance."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(20, 8))
    for axes, (title, field, outlines) in zip(figure.subplots(2, 5).flat, shown, strict=False):
        x, y = field.domain.points.transpose(2, 0, 1)
        axes.contourf(x, y, field.values, levels=[-np.inf, 0, np.inf], colors=["#5a82dc", "#f0f0f0"])
        axes.contour(x, y, field.values, levels=12, colors="gray", linewidths=0.4)
        for points in outlines:
            axes.plot(*np.vstack([points, points[:1]]).T, "k", lw=0.8)
        axes.set(title=title, aspect="equal", xticks=[], yticks=[])
    figure.savefig(file)


if __name__ == "__main__":
    main()
