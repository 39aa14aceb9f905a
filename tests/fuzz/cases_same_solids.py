"""Solids that must be the same: moved far away, beside something far away, renumbered, or of boxes that touch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, family
from fuzz.inputs import Arrays, Random, chance, one_of
from shapes.bodies import box
from signedheat import samples

SIDE = 4
"""Boxes have whole corners from 0 to this."""
GRAIN = 2.0**-20
"""Corners are multiples of this, and offsets below 2³² whole: moving them rounds nothing."""
NEAR = 1e-6
"""Points nearer to the surface than this share of the size may have either sign."""
BY_HEAT = 1e-3
"""How far distances to loose triangles, which heat closes, may be apart, relative to the size. Of 150 cases, two are
farther apart than 1e-6; of 2,200, one (50:1959) farther than 1e-3: two readings explain it equally well, up to the
errors of winding numbers, which hang on how a tree groups triangles."""
ITERATED = 1e-5
"""How far volumes may be apart, relative to the cube of the size: heat, which closes soups, is iterated to 1e-6."""


def broken(random: Random) -> Arrays:
    """A shape of one or two bodies with a defect, or none."""
    bodies = [samples.sphere(2), samples.torus(1.0, 0.4, 12, 8), box([0, 0, 0], random.uniform(0.3, 2, 3))]
    mesh = one_of(random, bodies)
    if chance(random, 0.3):
        more = one_of(random, bodies)
        mesh = samples.union(mesh, sh.TriangleMesh(more.vertices + random.normal(size=3), more.faces))
    seed, share = int(random.integers(99)), float(random.uniform(0.02, 0.3))
    defects = (samples.without_faces, samples.with_flipped_faces, samples.with_duplicate_faces, samples.with_noise)
    if chance(random, 0.7):
        mesh = one_of(random, defects)(mesh, share, seed)
    if chance(random, 0.2):
        mesh = samples.soup(mesh, one_of(random, (0.0, 1e-3)), seed)
    return np.round(mesh.vertices / GRAIN) * GRAIN, np.array(mesh.faces)


def numbered_otherwise(random: Random, vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    """The same shape with vertices, faces and the corners of faces in another order."""
    order = random.permutation(len(vertices))
    turns = (random.integers(0, 3, (len(faces), 1)) + np.arange(3)) % 3
    renumbered = np.argsort(order)[np.take_along_axis(faces, turns, axis=1)]
    return vertices[order], renumbered[random.permutation(len(faces))]


@dataclass(frozen=True)
class Twins:
    """Two shapes that are one, but for a move, and points in the place of the first."""

    first: Arrays
    second: Arrays
    move: np.ndarray
    points: np.ndarray


def twins(random: Random, moves: bool) -> Twins:
    """A shape twice, moved or numbered otherwise."""
    vertices, faces = broken(random)
    move = np.round(random.uniform(-1, 1, 3) * 10.0 ** random.integers(5, 8)) if moves else np.zeros(3)
    second = (vertices + move, faces) if moves else numbered_otherwise(random, vertices, faces)
    reach = np.ptp(vertices, axis=0).max()
    points = np.round((vertices.mean(axis=0) + 0.5 * reach * random.normal(size=(60, 3))) / GRAIN) * GRAIN
    return Twins((vertices, faces), second, move, points)


def check_twins(given: Twins) -> str:
    """Volume and signs are the same."""
    one, other = sh.complete(given.first), sh.complete(given.second)
    size = float(np.ptp(given.first[0], axis=0).max())
    here, there = one.distance(given.points), other.distance(given.points + given.move)
    away = np.minimum(np.abs(here), np.abs(there)) > NEAR * size
    differ = np.flatnonzero(away & (np.sign(here) != np.sign(there)))
    if len(differ):
        raise Wrong("other signs", f"at {given.points[differ].tolist()}: {here[differ]} and {there[differ]}")
    if abs(one.volume - other.volume) > ITERATED * size**3:
        raise Wrong("another volume", f"{one.volume:.17g} and {other.volume:.17g}")
    return "same"


@dataclass(frozen=True)
class Beside:
    """A shape, the same with something that does not touch it, and points near the first."""

    alone: Arrays
    beside: Arrays
    points: np.ndarray


def beside(random: Random, folder: Path) -> Beside:
    """A shape and a body, a triangle or a vertex of any size, three sizes of both to 10¹² times that away."""
    vertices, faces = broken(random)
    size = float(np.ptp(vertices, axis=0).max())
    other = one_of(random, (samples.sphere(1), box([0, 0, 0], [1, 2, 3]), sh.TriangleMesh(np.eye(3), [[0, 1, 2]])))
    scale = size * 10.0 ** random.uniform(-4, 4)
    way = random.normal(size=3)
    away = way / np.linalg.norm(way) * 3.0 * (size + 4.0 * scale) * 10.0 ** random.uniform(0, 12)
    more, ids = scale * other.vertices + vertices.mean(axis=0) + away, np.array(other.faces)
    if chance(random, 0.2):
        more, ids = more[:1], ids[:0]
    together = np.concatenate([vertices, more]), np.concatenate([faces, ids + len(vertices)])
    points = vertices.mean(axis=0) + 0.5 * size * random.normal(size=(60, 3)).clip(-2, 2)
    return Beside((vertices, faces), numbered_otherwise(random, *together), points)


def check_beside(given: Beside) -> str:
    """Distance at the points is the same."""
    one, other = sh.complete(given.alone), sh.complete(given.beside)
    size = float(np.ptp(given.alone[0], axis=0).max())
    here, there = one.distance(given.points), other.distance(given.points)
    loose = len(given.alone[0]) == 3 * len(given.alone[1])
    differ = np.flatnonzero(np.abs(here - there) > (BY_HEAT if loose else NEAR) * size)
    if len(differ):
        raise Wrong("other distances", f"at {given.points[differ].tolist()}: {here[differ]} and {there[differ]}")
    return "same"


@dataclass(frozen=True)
class Boxes:
    """A shape of boxes, centres of unit cells in its place, which of them are inside, and their volume."""

    shape: Arrays
    cells: np.ndarray
    inside: np.ndarray
    cell: float


def boxes(random: Random, folder: Path) -> Boxes:
    """Boxes on a lattice: some touch, some coincide, some overlap or are within others; turned, scaled, moved."""
    inside = np.zeros((SIDE,) * 3, dtype=bool)
    parts = []
    for _ in range(int(random.integers(2, 7))):
        lower = random.integers(0, SIDE, 3)
        upper = np.array([random.integers(low + 1, SIDE + 1) for low in lower])
        if parts and chance(random, 0.15):
            parts.append(one_of(random, parts))
            continue
        inside[tuple(slice(a, b) for a, b in zip(lower, upper, strict=True))] = True
        parts.append(box(lower, upper))
    mesh = samples.union(*parts)
    vertices, faces = mesh.vertices, np.array(mesh.faces)
    if chance(random, 0.5):
        vertices, ids = np.unique(vertices, axis=0, return_inverse=True)
        faces = ids.reshape(-1)[faces]
    cells = np.stack(np.nonzero(np.ones_like(inside)), axis=-1) + 0.5
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0] if chance(random, 0.5) else np.eye(3)
    turn *= np.linalg.det(turn)
    scale = 10.0 ** random.uniform(-3, 3) if chance(random, 0.5) else 1.0
    move = scale * random.normal(size=3) * one_of(random, (0.0, 1.0, 1e5))
    shape = numbered_otherwise(random, scale * vertices @ turn + move, faces)
    return Boxes(shape, scale * cells @ turn + move, inside.ravel(), scale**3)


def check_boxes(given: Boxes) -> str:
    """A cell is inside if it is in a box, and the volume is that of those cells."""
    solid = sh.complete(given.shape)
    differ = np.flatnonzero(solid.inside(given.cells) != given.inside)
    if len(differ):
        raise Wrong("other signs", f"in cells {differ.tolist()}, of which are inside: {given.inside[differ]}")
    if abs(solid.volume / given.cell - given.inside.sum()) > 1e-4:
        raise Wrong("another volume", f"{solid.volume / given.cell:.9g}, not {given.inside.sum()}")
    return "boxes"


family("same solid moved", lambda random, folder: twins(random, True), check_twins)
family("same solid renumbered", lambda random, folder: twins(random, False), check_twins)
family("far and near", beside, check_beside)
family("touching boxes", boxes, check_boxes)
