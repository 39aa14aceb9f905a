"""Random arrays and objects for the families of the API: ugly but valid shapes, extreme numbers, and plain nonsense."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import signedheat as sh
from shapes.bodies import box
from shapes.surface_cases import band, book, sphere, square
from shapes.tet_cases import boxes

Random = np.random.Generator
Arrays = tuple[np.ndarray, np.ndarray]
"""Vertices and faces, polygons or tets."""

SCALES = (1e3, 1e-3, 1e3, 1e-3, 1e12, 1e-12, 1e30, 1e-30, 1e150, 1e-150, 1e300, 1e-300)
SHIFTS = (1.0, 1e3, 1e6, 1e9, 1e12, 1e16)


def chance(random: Random, share: float) -> bool:
    return bool(random.random() < share)


def one_of(random: Random, options: Any) -> Any:
    options = list(options)
    return options[int(random.integers(len(options)))]


def _of(mesh: sh.TriangleMesh) -> Arrays:
    return mesh.vertices.copy(), mesh.faces.copy()


def _soup(random: Random) -> Arrays:
    n, m = int(random.integers(3, 14)), int(random.integers(1, 40))
    return random.normal(size=(n, 3)), random.integers(n, size=(m, 3))


def _fan(random: Random) -> Arrays:
    n = int(random.integers(3, 40))
    angle = np.sort(random.random(n)) * random.uniform(0.1, 2) * np.pi
    rim = np.stack([np.cos(angle), np.sin(angle), random.normal(size=n) * random.uniform(0, 1)], axis=1)
    ids = np.arange(1, n)
    return np.concatenate([[[0, 0, 0]], rim]), np.stack([0 * ids, ids, ids + 1], axis=1)


def _bow_tie(random: Random) -> Arrays:
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, random.normal()]]
    return np.array(vertices, dtype=float), np.array([[0, 1, 2], [0, 3, 4]])


def _needles(random: Random) -> Arrays:
    vertices, faces = _of(square(int(random.integers(3, 7)), jitter=0.3, seed=int(random.integers(99))))
    thin = 10.0 ** -random.integers(1, 17)
    corner = vertices[faces]
    a, b, c = faces.T
    new = len(vertices) + np.arange(len(faces))
    weights = one_of(random, ([1 - 2 * thin, thin, thin], [0.5 - thin / 2, 0.5 - thin / 2, thin], [0.5, 0.5, 0.0]))
    added = np.einsum("k,mkd->md", weights, corner)
    faces = np.concatenate([np.stack(corners, axis=1) for corners in ((a, b, new), (b, c, new), (c, a, new))])
    return np.concatenate([vertices, added]), faces


def _squashed(random: Random) -> Arrays:
    """Flat in one direction or two: little area, or none."""
    vertices, faces = ordinary(random)
    factors = 10.0 ** -random.integers(0, 20, 3)
    factors[random.random(3) < 0.3] = 0.0
    return vertices * factors, faces


def _point(random: Random) -> Arrays:
    vertices, faces = ordinary(random)
    return 0 * vertices + random.normal(size=3), faces


def _partly_degenerate(random: Random) -> Arrays:
    """Some vertices fall together, some faces name a vertex twice."""
    vertices, faces = ordinary(random)
    some = random.random(len(vertices)) < random.choice([0.1, 0.5])
    vertices[some] = vertices[random.integers(len(vertices))]
    repeat = random.random(len(faces)) < random.choice([0, 0.2])
    faces[repeat, 1] = faces[repeat, 0]
    return vertices, faces


def ordinary(random: Random) -> Arrays:
    """Manifold or not, orientable or not, open or closed."""
    seed = int(random.integers(99))
    makers: list[Callable[[], Arrays]] = [
        lambda: _of(sphere(int(random.integers(0, 3)))),
        lambda: _of(square(int(random.integers(2, 8)), jitter=random.uniform(0, 0.45), seed=seed)),
        lambda: _of(band(int(random.integers(3, 12)), int(random.integers(1, 4)), chance(random, 0.5))),
        lambda: _of(book(int(random.integers(3, 6)), int(random.integers(1, 4)))),
        lambda: _of(box([0, 0, 0], random.uniform(0.01, 2, 3))),
        lambda: (random.normal(size=(3, 3)), np.array([[0, 1, 2]])),
        lambda: _fan(random),
        lambda: _bow_tie(random),
    ]
    return one_of(random, makers)()


def triangles(random: Random) -> Arrays:
    """Vertices and faces of every kind, at every size and place; most of them valid."""
    makers = [ordinary] * 6 + [_soup, _soup, _needles, _needles, _squashed, _point, _partly_degenerate, _several]
    vertices, faces = one_of(random, makers)(random)
    if chance(random, 0.2):
        keep = random.random(len(faces)) < random.uniform(0.3, 1)
        faces = faces[keep] if keep.any() else faces
    if chance(random, 0.15):
        faces = np.concatenate([faces, faces[random.random(len(faces)) < 0.3]])
    if chance(random, 0.15):
        over = random.random(len(faces)) < 0.4
        faces = np.where(over[:, None], faces[:, ::-1], faces)
    return placed(random, vertices), faces


def _several(random: Random) -> Arrays:
    vertices, faces = ordinary(random)
    more, others = ordinary(random)
    shift = random.normal(size=3) * random.choice([0, 1, 100])
    return np.concatenate([vertices, more + shift]), np.concatenate([faces, others + len(vertices)])


def placed(random: Random, vertices: np.ndarray) -> np.ndarray:
    """Scaled, stretched and moved, more often than not by nothing."""
    vertices = np.array(vertices, dtype=float)
    if chance(random, 0.1):
        vertices = vertices * 10.0 ** random.uniform(-6, 6, vertices.shape[1])
    if chance(random, 0.2):
        vertices = vertices + random.normal(size=vertices.shape[1]) * one_of(random, SHIFTS)
    if chance(random, 0.25):
        with np.errstate(over="ignore"):
            vertices = vertices * one_of(random, SCALES)
    return vertices


def spoiled(random: Random, numbers: np.ndarray, share: float = 0.03) -> np.ndarray:
    """Now and then a NaN, an infinity or a number that is far too large in it."""
    if not chance(random, share) or not numbers.size:
        return numbers
    bad = np.array(numbers, dtype=float)
    bad.flat[random.integers(bad.size)] = one_of(random, (np.nan, np.inf, -np.inf, 1e308, -1e300))
    return bad


def spoiled_ids(random: Random, ids: np.ndarray, share: float = 0.03) -> np.ndarray:
    """Now and then an id that does not exist."""
    if not chance(random, share) or not ids.size:
        return ids
    bad = np.array(ids)
    bad.flat[random.integers(bad.size)] = one_of(random, (-1, 10**6, 2**31, 2**62, -(2**63)))
    return bad


def polygons(random: Random) -> tuple[np.ndarray, list[list[int]]]:
    """Quads, triangles and polygons with more corners, some of them concave, twisted or degenerate."""
    if chance(random, 0.4):
        vertices, faces = triangles(random)
        return vertices, faces.tolist()
    n = int(random.integers(2, 6))
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    vertices += random.normal(size=vertices.shape) * random.choice([0, 0.1, 0.5])
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]], axis=-1).reshape(-1, 4).tolist()
    if chance(random, 0.3):
        quads.append(random.integers(len(vertices), size=int(random.integers(3, 9))).tolist())
    return placed(random, vertices), quads


def points(random: Random) -> tuple[np.ndarray, np.ndarray | None]:
    """Points on a shape, in a line, in one place, or anywhere; with normals, or without."""
    n = int(random.integers(1, 120))
    made = random.normal(size=(n, 3))
    kind = random.integers(6)
    if kind < 3:
        made /= np.linalg.norm(made, axis=1, keepdims=True)
    elif kind == 3:
        made[:, 1:] = 0
    elif kind == 4:
        made = np.repeat(made[:1], n, axis=0)
    if chance(random, 0.2):
        made = np.concatenate([made, made[: n // 2]])
    normals = made + 0 if chance(random, 0.6) else None
    if normals is not None and chance(random, 0.2):
        normals = normals * one_of(random, SCALES)
    return placed(random, made), normals


def volume(random: Random) -> np.ndarray:
    """Voxels: a ball, a few, one, or a sponge."""
    n = random.integers(1, 9, 3)
    kind = random.integers(4)
    if kind == 0:
        index = np.stack(np.indices(tuple(n)), axis=-1)
        return np.linalg.norm(index - (n - 1) / 2, axis=-1) <= n.min() / 2
    if kind == 1:
        return np.ones(tuple(n), dtype=bool)
    return random.random(tuple(n)) < random.choice([0.1, 0.5, 0.9])


def tets(random: Random) -> Arrays:
    """Boxes of tets, jittered, flat in part, turned over in part, or one alone."""
    kind = random.integers(5)
    if kind == 0:
        vertices, cells = random.normal(size=(4, 3)), np.array([[0, 1, 2, 3]])
    elif kind == 1:
        vertices = random.normal(size=(int(random.integers(4, 12)), 3))
        cells = random.integers(len(vertices), size=(int(random.integers(1, 20)), 4))
    else:
        mesh = boxes(tuple(int(k) for k in random.integers(1, 4, 3)), 1.0)
        vertices, cells = mesh.vertices.copy(), mesh.tets.copy()
        vertices += random.normal(size=vertices.shape) * random.choice([0, 0.1, 0.6])
    if chance(random, 0.2):
        some = random.random(len(vertices)) < 0.3
        vertices[some, 2] = 0
    if chance(random, 0.2):
        cells = cells[random.random(len(cells)) < 0.7] if len(cells) > 3 else cells
    return placed(random, vertices), cells


NONSENSE: tuple[Any, ...] = (
    None,
    True,
    0,
    -1,
    2**70,
    1.5,
    float("nan"),
    float("inf"),
    1e308,
    1 + 2j,
    "three",
    "1",
    b"abc",
    [],
    [[]],
    {},
    {"a": 1},
    object(),
    [1, [2, 3]],
    [["a", "b", "c"]],
    [[1, 2, 3], [4, 5]],
    [None, None],
    np.empty((0, 3)),
    np.zeros((3, 0)),
    np.zeros((2, 2, 2)),
    np.zeros(3),
    np.float64(1.0),
    np.zeros((2, 3), dtype=complex),
    np.array([["x", "y", "z"]]),
    np.array([[1, 2, object()]], dtype=object),
    np.zeros((2, 3), dtype="datetime64[s]"),
    np.ma.masked_array(np.zeros((2, 3)), mask=True),
    np.zeros(3, dtype=[("a", float)]),
    sh.constraints.Free(),
    sh.constraints.Free,
    sh.Grid,
    range(3),
    lambda: 1,
    iter([1, 2]),
)
"""Arguments that hardly any function takes."""


def laid_out(random: Random, array: np.ndarray) -> Any:
    """The same numbers in another layout or type."""
    ways: list[Callable[[np.ndarray], Any]] = [
        lambda a: a,
        lambda a: a.tolist(),
        np.asfortranarray,
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a[::-1][::-1],
        lambda a: a.astype(a.dtype.newbyteorder()),
        lambda a: a.astype(object),
        lambda a: tuple(map(tuple, a)) if a.ndim == 2 else tuple(a),
        lambda a: np.lib.stride_tricks.as_strided(a.copy(), a.shape, a.strides, writeable=False),
    ]
    return one_of(random, ways)(array)
