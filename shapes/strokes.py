"""Curves on surfaces as hands, scans and files give them: whole ones, damaged in seeded ways, and what is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

import signedheat as sh
from shapes.surfaces import disk
from signedheat.samples import sphere, torus

Random = np.random.Generator


@dataclass(frozen=True)
class Drawing:
    """Curves as they are given, and what they were before.

    Attributes
    ----------
    mesh : TriangleMesh
        The surface.
    given : list of Curve
        The strokes.
    whole : list of Curve
        What they stand for.
    sides : (n,) float
        1 or −1, the right sign at every vertex; 0 where either is right.
    """

    mesh: sh.TriangleMesh
    given: list[sh.Curve]
    whole: list[sh.Curve]
    sides: np.ndarray


@dataclass(frozen=True)
class Whole:
    """Closed curves, the zero set of a function."""

    mesh: sh.TriangleMesh
    heights: np.ndarray
    curves: list[sh.Curve]


def surface(random: Random, fine: int = 3) -> sh.TriangleMesh:
    """A ball with bumps, an egg, a torus, hills in a disk, or a tin, at a random place, size and turn."""
    kind = random.integers(5)
    if kind < 2:
        ball = sphere(fine)
        x = ball.vertices
        bumps = sum(random.normal() * np.sin(3 * x @ random.normal(size=3) + random.uniform(0, 6)) for _ in range(3))
        x = x * (1 + 0.12 * random.random() * bumps)[:, None] * random.uniform(0.6, 1.4, 3)
        faces = ball.faces
    elif kind == 2:
        ring = torus(1.0, random.uniform(0.3, 0.6), 16 * fine, 8 * fine)
        x, faces = ring.vertices, ring.faces
    elif kind == 3:
        flat = disk(6 * fine, seed=int(random.integers(99)))
        x, faces = flat.vertices.copy(), flat.faces
        x[:, 2] = 0.2 * random.random() * np.sin(4 * x[:, 0] + random.uniform(0, 6)) * np.cos(3 * x[:, 1])
    else:
        ball = sphere(fine)
        x = ball.vertices * [1, 1, random.uniform(1, 2)]
        x = x / np.maximum(np.maximum(np.hypot(x[:, 0], x[:, 1]), np.abs(x[:, 2])), 1e-9)[:, None]  # corners
        x, faces = x * [1, 1, random.uniform(0.7, 2.0)], ball.faces
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    x = (x @ turn.T) * 10 ** random.uniform(-2, 2)
    return sh.TriangleMesh(x + random.normal(size=3) * np.ptp(x), faces)


def wrong_share(drawing: Drawing, values: np.ndarray) -> float:
    """Share of the area on the wrong side, two edges or more from the curves: they are drawn by hand."""
    mesh = drawing.mesh
    exact = np.abs(sh.signed_distance(drawing.whole, mesh, as_oriented=True).values)
    areas = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), mesh.n_vertices)
    wrong = (np.sign(values) != drawing.sides) & (exact > 2 * edge_length(mesh))
    return float(areas[wrong].sum() / areas.sum())


def edge_length(mesh: sh.TriangleMesh) -> float:
    """Mean length of an edge."""
    return float(mesh.edge_lengths.mean())


def smooth(mesh: sh.TriangleMesh, random: Random, waves: float = 1.0) -> np.ndarray:
    """A random smooth function of about that many waves across the mesh."""
    x = (mesh.vertices - mesh.vertices.mean(axis=0)) / np.ptp(mesh.vertices)
    k = 2 * np.pi * waves * random.normal(size=(4, 3))
    values = np.sin(x @ k.T + random.uniform(0, 6, 4)) @ random.normal(size=4)
    return values + 1e-9 * random.normal(size=len(x))


def whole(mesh: sh.TriangleMesh, random: Random, least: float = 20.0, most: int = 3) -> Whole:
    """Closed curves of at least some edges each, whose regions have at least a twentieth of the vertices."""
    rim = mesh.edges.vertices[mesh.edges.face_counts == 1]
    while True:
        values = smooth(mesh, random, random.choice([0.3, 0.5, 0.8]))
        values = values - np.quantile(values, random.uniform(0.2, 0.8))
        if np.diff(values[rim] >= 0, axis=1).any():
            continue  # a curve is open
        curves = mesh.level_set(values)
        if 1 <= len(curves) <= most and all(c.closed and length(mesh, c) > least * edge_length(mesh) for c in curves):
            return Whole(mesh, values, curves)


def positions(mesh: sh.TriangleMesh, curve: sh.Curve) -> np.ndarray:
    """The points of a curve in space; of a closed one the first again at the end."""
    at = np.einsum("nk,nkd->nd", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
    return np.concatenate([at, at[:1]]) if curve.closed else at


def length(mesh: sh.TriangleMesh, curve: sh.Curve) -> float:
    """Length of a curve."""
    return float(np.linalg.norm(np.diff(positions(mesh, curve), axis=0), axis=1).sum())


def arc(mesh: sh.TriangleMesh, curve: sh.Curve, begin: float, end: float) -> sh.Curve | None:
    """What a closed curve has from one share of its length to another."""
    at = positions(mesh, curve)
    share = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    share /= share[-1]
    n = curve.n_points
    first, last = (np.searchsorted(share[:-1], s % 1.0, side="right") - 1 + n * int(np.floor(s)) for s in (begin, end))
    index = np.arange(first, last + 1) % n
    return sh.Curve(curve.faces[index], curve.barycentric[index]) if len(index) > 1 else None


def spans(random: Random, n: int, lost: float) -> list[tuple[float, float]]:
    """n stretches of [0, 1), round and round, with gaps of that share in all."""
    gaps, kept = random.dirichlet(2 * np.ones(n)) * lost, random.dirichlet(4 * np.ones(n)) * (1 - lost)
    ends = np.cumsum(np.stack([kept, gaps], axis=1).ravel()) + random.random()
    begins = np.concatenate([[ends[0] - kept[0]], ends[1:-1:2]])
    return list(zip(begins.tolist(), ends[::2].tolist(), strict=True))


def broken(drawn: Whole, random: Random, lost: float, pieces: int = 8) -> list[sh.Curve]:
    """Pieces of all curves, about so many of each."""
    found = []
    for curve in drawn.curves:
        for begin, end in spans(random, pieces, lost):
            found.append(arc(drawn.mesh, curve, begin, end))
    return [piece for piece in found if piece is not None]


def beside(drawn: Whole, random: Random, begin: float, end: float, curve: sh.Curve, apart: float) -> sh.Curve | None:
    """A stretch of a curve drawn again by hand, about so many edges away."""
    mesh = drawn.mesh
    slope = np.abs(np.diff(drawn.heights[mesh.edges.vertices], axis=1)).mean()
    wobble = smooth(mesh, random, 2.0)
    values = drawn.heights + apart * slope * wobble / np.abs(wobble).std()
    again = [c for c in mesh.level_set(values) if c.closed]
    model = arc(mesh, curve, begin, end)
    if not again or model is None:
        return None
    ends = positions(mesh, model)[[0, -1]]
    best = min(again, key=lambda c: np.linalg.norm(positions(mesh, c) - ends[0], axis=1).min())
    at = positions(mesh, best)[:-1]
    first, last = (int(np.linalg.norm(at - p, axis=1).argmin()) for p in ends)
    n = best.n_points
    steps = (last - first) % n + (n if end - begin > 0.9 and (last - first) % n < n // 2 else 0)
    index = (first + np.arange(steps + 1)) % n
    return sh.Curve(best.faces[index], best.barycentric[index]) if len(index) > 1 else None


def turned(pieces: list[sh.Curve], random: Random, share: float) -> list[sh.Curve]:
    """Some of the pieces the other way."""
    wrong = random.permutation(len(pieces))[: round(share * len(pieces))]
    return [piece.reversed() if k in wrong else piece for k, piece in enumerate(pieces)]


def stray(mesh: sh.TriangleMesh, random: Random, share: float, n: int) -> list[sh.Curve]:
    """Stretches, each that share of the size of the mesh long, that belong to no curve."""
    found = []
    while len(found) < n:
        values = smooth(mesh, random, 0.8)
        values = values - random.choice(values)
        for curve in mesh.level_set(values):
            total = length(mesh, curve)
            part = share * np.ptp(mesh.vertices) / total
            if curve.closed and part < 0.6 and (piece := arc(mesh, curve, s := random.random(), s + part)) is not None:
                found.append(piece)
                break
    return found


def gap(random: Random, drawn: Whole) -> list[sh.Curve]:
    """One gap in each curve."""
    return broken(drawn, random, random.choice([0.005, 0.02, 0.05, 0.1, 0.2, 0.3]), 1)


def pieces(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Several pieces, up to a third gone."""
    return broken(drawn, random, random.uniform(0, 0.33), int(random.integers(2, 13)))


def pieces_turned(random: Random, drawn: Whole) -> list[sh.Curve]:
    """The same, a tenth to a third of them the wrong way."""
    return turned(
        broken(drawn, random, random.uniform(0, 0.3), int(random.integers(4, 13))), random, random.uniform(0.1, 0.34)
    )


def twice(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Drawn two or three times, exactly or by hand."""
    times, apart = int(random.integers(1, 3)), random.choice([0.0, 0.1, 0.3, 0.5])
    lost, n = random.uniform(0, 0.25), int(random.integers(1, 9))
    found = []
    for curve in drawn.curves:
        stretches = spans(random, n, lost)
        found += [arc(drawn.mesh, curve, *each) for each in stretches]
        for _ in range(times):
            slip = random.choice([0.0, 0.01]) * random.normal(size=(n, 2))
            for (begin, end), (a, b) in zip(stretches, slip, strict=True):
                found.append(
                    beside(drawn, random, begin + a, end + b, curve, apart)
                    if apart
                    else arc(drawn.mesh, curve, begin, end)
                )
    found = [piece for piece in found if piece is not None]
    return [found[k] for k in random.permutation(len(found))]


def twice_turned(random: Random, drawn: Whole) -> list[sh.Curve]:
    """The same, some strokes backwards."""
    return turned(twice(random, drawn), random, random.uniform(0.05, 0.3))


def overlapping(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Bits that begin before the last one ends, by hand."""
    n, over, apart = int(random.integers(4, 20)), random.uniform(0.05, 0.5), random.choice([0.1, 0.3, 0.5])
    found = []
    for curve in drawn.curves:
        for begin, end in spans(random, n, 0.0):
            found.append(beside(drawn, random, begin - over / n, end + over / n, curve, apart))
    return [piece for piece in found if piece is not None]


def bits(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Segment by segment, some backwards."""
    found = [
        arc(drawn.mesh, curve, *each) for curve in drawn.curves for each in spans(random, 60, random.choice([0.0, 0.1]))
    ]
    return turned([piece for piece in found if piece is not None], random, random.choice([0.0, 0.05, 0.2]))


def long_strays(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Long pieces that belong to no curve."""
    kept = broken(drawn, random, random.uniform(0.0, 0.25), int(random.integers(4, 13)))
    return kept + stray(drawn.mesh, random, random.uniform(0.1, 0.3), int(random.integers(1, 4)))


def scribbles(random: Random, drawn: Whole) -> list[sh.Curve]:
    """Short ones."""
    kept = broken(drawn, random, random.uniform(0.0, 0.25), int(random.integers(4, 13)))
    return kept + stray(drawn.mesh, random, random.uniform(0.03, 0.08), int(random.integers(2, 10)))


def loop_turned(random: Random, drawn: Whole) -> list[sh.Curve]:
    """One curve of several, all of its pieces the wrong way."""
    lost, n = random.uniform(0.0, 0.3), int(random.integers(1, 8))
    which = int(random.integers(len(drawn.curves)))
    found = []
    for k, curve in enumerate(drawn.curves):
        each = [piece for piece in broken(Whole(drawn.mesh, drawn.heights, [curve]), random, lost, n)]
        found += [piece.reversed() for piece in each] if k == which and len(drawn.curves) > 1 else each
    return found


DAMAGES: dict[str, Callable[[Random, Whole], list[sh.Curve]]] = {
    made.__name__: made
    for made in (
        gap,
        pieces,
        pieces_turned,
        twice,
        twice_turned,
        overlapping,
        bits,
        long_strays,
        scribbles,
        loop_turned,
    )
}


def drawing(random: Random, damage: str, fine: int = 3) -> Drawing:
    """A random surface with curves damaged in one way."""
    drawn = whole(surface(random, fine), random)
    return Drawing(drawn.mesh, DAMAGES[damage](random, drawn), drawn.curves, np.sign(drawn.heights))


def drawing_in_plane(random: Random, damage: str, fine: int = 70) -> tuple[Drawing, list[sh.Polyline]]:
    """The same on a square, and the strokes as polylines: at any angle, and of any size."""
    side = np.linspace(-1, 1, fine)
    points = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = (np.abs(points) < 1).all(axis=1)
    points += inner[:, None] * random.uniform(-0.4, 0.4, points.shape) / fine
    faces = scipy.spatial.Delaunay(points).simplices
    (x, u), (y, v) = (points[faces[:, k]].T - points[faces[:, 0]].T for k in (1, 2))
    clockwise = x * v < u * y
    faces[clockwise] = faces[clockwise][:, ::-1]
    turn = random.uniform(0, 2 * np.pi)
    points = 10 ** random.uniform(-2, 2) * points @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    mesh = sh.TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces)
    drawn = whole(mesh, random)
    given = DAMAGES[damage](random, drawn)
    lines = [sh.Polyline(positions(mesh, curve)[:, :2], curve.closed) for curve in given]
    return Drawing(mesh, given, drawn.curves, np.sign(drawn.heights)), lines
