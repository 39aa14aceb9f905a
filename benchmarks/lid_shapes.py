"""Damaged shapes that lids close, and the volumes of what they were cut from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from signedheat import samples
from signedheat.solids.closing import closed_by

Shape = tuple[NDArray[np.float64], NDArray[np.int64]]


def volume(shape: Shape) -> float:
    """The volume of what is closed."""
    vertices, added = closed_by(*shape)
    corners = vertices[np.concatenate([shape[1], added])]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6


def some(vertices: NDArray[np.float64], faces: NDArray[np.int64], kept: NDArray[np.bool_]) -> Shape:
    """Some faces, and their vertices."""
    used, numbers = np.unique(faces[kept], return_inverse=True)
    return vertices[used], numbers.reshape(-1, 3)


def box(size: NDArray[np.float64], cells: int) -> Shape:
    """A box of square cells."""
    steps = np.linspace(0, 1, cells + 1)
    places, corners = [], []
    for side in range(6):
        axis, end = divmod(side, 2)
        grid = np.empty((cells + 1, cells + 1, 3))
        grid[..., axis] = end
        grid[..., (axis + 1) % 3], grid[..., (axis + 2) % 3] = np.meshgrid(steps, steps, indexing="ij")
        i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
        a, b, c, d = (rows.ravel() for rows in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
        faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        corners.append(side * (cells + 1) ** 2 + (faces if end else faces[:, ::-1]))
        places.append(grid.reshape(-1, 3))
    names, numbers = np.unique(np.concatenate(places).round(12), axis=0, return_inverse=True)
    return names * size, numbers.reshape(-1)[np.concatenate(corners)]


def shapes() -> dict[str, tuple[Shape, float]]:
    """Damaged shapes, and the volumes of what they were cut from."""
    ball = samples.sphere(4)
    vertices, faces, rng = ball.vertices, ball.faces, np.random.default_rng(7)
    middles = vertices[faces].mean(axis=1)
    whole, made = 4 / 3 * np.pi, {}
    for z in (0.8, 0.4, 0.0):
        made[f"ball up to {z}"] = some(vertices, faces, middles[:, 2] < z), whole
    made["quarter of a ball"] = some(vertices, faces, (middles[:, :2] > 0).all(axis=1)), whole
    for k in (0.6, 0.75, 1.3, 2.5):
        made[f"half spheroid {k}"] = some(vertices * [1, 1, k], faces, middles[:, 2] < 0), k * whole
    holes = np.linalg.norm(middles[:, None] - vertices[rng.choice(len(vertices), 8, replace=False)], axis=2)
    made["ball, holes"] = some(vertices, faces, (holes > 0.3).all(axis=1)), whole
    made["ball, faces lost"] = some(vertices, faces, rng.random(len(faces)) > 0.2), whole
    size = np.array([1.0, 1.3, 0.8])
    points, sides = box(size, 10)
    centres = points[sides].mean(axis=1) / size
    for name, gone in {
        "box, a side": centres[:, 2] > 1 - 1e-9,
        "box, two sides": (centres[:, [0, 2]] > 1 - 1e-9).any(axis=1),
        "box, three sides": (centres > 1 - 1e-9).any(axis=1),
        "box, a corner": np.linalg.norm(centres - 1, axis=1) < 0.4,
        "box, an edge": np.linalg.norm(centres - [1, 1, 0.5], axis=1) < 0.3,
    }.items():
        made[name] = some(points, sides, ~gone), float(size.prod())
    for inner in (0.9, 0.8, 0.7):
        cups = [some(r * vertices, faces, r * middles[:, 2] < 0.1) for r in (1.0, inner)]
        chain = np.concatenate([cups[0][1], len(cups[0][0]) + cups[1][1][:, ::-1]])
        cup = np.pi * (2 / 3 + 0.1 - 0.1**3 / 3) - np.pi * (2 / 3 * inner**3 + 0.1 * inner**2 - 0.1**3 / 3)
        made[f"bowl, inside {inner}"] = (np.concatenate([cups[0][0], cups[1][0]]), chain), cup
    return made
