"""Loose pieces: parts that bound nothing by themselves, and may be fragments of a body, its noisy copies, or sheets."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.components import connected_components
from ..geometry.face_tree import FaceTree
from ..geometry.meshes import face_areas
from ..geometry.part_levels import level, own_levels
from ..geometry.welding import same_positions
from ..geometry.winding_tree import WindingTree
from .heat import FRAGMENTS

COPY = 0.5
"""Distance from a body, over the size of a piece, up to which the piece is a copy of what is there."""
REACH = 1.5
"""Sum of the radii of two pieces, times this, within which they may belong together."""
CHANCE = 0.35
"""Joint level, times √n, up to which n pieces bound nothing: two parallel sheets, each a side of them apart, have .22,
three sides of a box .22, and six .5."""
CLOSING = 0.4
"""Rise of the level of a part by pieces, over that if all were faces of one body, from which on they are: what is left
at random of balls, boxes and parts has .43 to .95, sheets in an open box .37, litter in and around it .16."""
ISLANDS = 0.003
"""Area of pieces over that of a part up to which they may be its copies, or are islands in its holes: ten triangles
between sixty holes of a ball have .0008, what half of a box's triangles, gone at random, leave .006. Halved or
doubled it changes five shapes of which half is gone by .5 % at most."""
MATCH = (1e-6, 0.75)
"""Distance of corners over the size of pieces between which they were one corner, before noise moved them."""


def are_copies(
    triangles: NDArray[np.float64], labels: NDArray[np.int64], bodies: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(m,) triangles of pieces that are copies of a part of bodies: small, and nearer to them than they are large.

    To leave them out moves the surface by less than a thirtieth of the size of the bodies.
    """
    if not len(bodies):
        return np.zeros(len(triangles), dtype=bool)
    tree = FaceTree.of_triangles(bodies)
    n = int(labels.max()) + 1
    areas, farthest = np.bincount(labels, face_areas(triangles), n), np.zeros(n)
    np.maximum.at(farthest, labels, tree.distances(triangles.reshape(-1, 3)).reshape(-1, 3).max(axis=1))
    copies = (farthest < COPY * np.sqrt(areas)) & (areas < ISLANDS * face_areas(bodies).sum())
    return np.asarray(copies[labels])


def clusters_of(triangles: NDArray[np.float64], labels: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Triangles of each cluster of pieces whose distance is comparable to their sizes."""
    if not len(labels):
        return []
    names, labels = np.unique(labels, return_inverse=True)
    n = len(names)
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, labels, triangles.min(axis=1))
    np.maximum.at(high, labels, triangles.max(axis=1))
    centres, radii = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    octaves = np.floor(np.log2(np.maximum(radii, 1e-300)))
    groups = [
        (octave, np.flatnonzero(octaves == octave), np.flatnonzero(octaves <= octave)) for octave in np.unique(octaves)
    ]
    one, other = [np.arange(n)], [np.arange(n)]

    def join(i: NDArray[np.int64], j: NDArray[np.int64], apart: NDArray[np.float64]) -> None:
        near = apart < REACH * (radii[i] + radii[j])
        one.append(i[near])
        other.append(j[near])

    for octave, here, _ in groups:  # those in one cube, in which all belong together: most, so that few pairs are left
        side = 2 * REACH * 2.0**octave / np.sqrt(3)
        for thirds in np.ndindex(3, 3, 3):
            with np.errstate(over="ignore"):
                cubes = np.floor(centres[here] / side + np.array(thirds) / 3)
            first = here[same_positions(cubes)]
            join(here, first, np.linalg.norm(centres[here] - centres[first], axis=1))
    clusters = connected_components(n, np.concatenate(one), np.concatenate(other))
    rest = clusters != np.bincount(clusters).argmax()
    for octave, here, below in groups:  # all pairs but those within the largest cluster
        for some, others in ((here[rest[here]], below), (here[~rest[here]], below[rest[below]])):
            if len(some) and len(others):
                pairs = scipy.spatial.cKDTree(centres[some]).sparse_distance_matrix(
                    scipy.spatial.cKDTree(centres[others]), 4 * REACH * 2.0**octave, output_type="coo_matrix"
                )
                join(some[pairs.row], others[pairs.col], pairs.data)
    clusters = connected_components(n, np.concatenate(one), np.concatenate(other))[labels]
    return np.split(np.argsort(clusters, kind="stable"), np.cumsum(np.bincount(clusters))[:-1])


def fragments(
    triangles: NDArray[np.float64], labels: NDArray[np.int64], loose: NDArray[np.bool_], opened: NDArray[np.bool_]
) -> list[NDArray[np.int64]]:
    """Triangles of each cluster of loose pieces, with the open parts that these were torn from.

    Loose parts bound nothing by themselves; opened ones do, and have rims.
    """
    pieces, some = loose.copy(), np.flatnonzero((loose | opened)[labels])
    for cluster in clusters_of(triangles[some], labels[some]) if opened.any() else []:
        here = some[cluster]
        torn, found = pieces[labels[here]], True
        while found and torn.any() and not torn.all():
            pieces[_closed_by(triangles[here[torn]], triangles[here[~torn]], labels[here[~torn]])] = True
            found = bool((pieces[labels[here]] & ~torn).any())
            torn = pieces[labels[here]]
    some = np.flatnonzero(pieces[labels])
    return [some[cluster] for cluster in clusters_of(triangles[some], labels[some])]


def _closed_by(
    pieces: NDArray[np.float64], triangles: NDArray[np.float64], labels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The parts among whose faces pieces lie, facing as they do.

    These raise the level of such a part by some `CLOSING` of what they would if all were faces of one body, taken at
    random; islands in its holes do not count.
    """
    names, owners = np.unique(labels, return_inverse=True)
    every = face_areas(triangles)
    areas = np.maximum(np.bincount(owners, every), np.finfo(float).tiny)
    raised = np.bincount(owners, every * WindingTree.of(pieces).numbers(triangles.mean(axis=1))) / areas
    own = own_levels(triangles, owners)
    shares = face_areas(pieces).sum() / areas
    closed = (raised * np.sign(own) > CLOSING * np.abs(own) * np.minimum(1.0, shares)) & (shares > ISLANDS)
    found: NDArray[np.int64] = names[closed]
    return found


def bound_together(triangles: NDArray[np.float64], labels: NDArray[np.int64], loose: NDArray[np.bool_]) -> bool:
    """Whether loose pieces are fragments of a body: the winding number of all at their faces is beyond chance.

    That of n pieces anywhere is random, and falls as 1 / √n; n counts pieces of equal area.
    """
    areas = face_areas(triangles[loose])
    if not areas.any():
        return False
    pieces = np.bincount(np.unique(labels[loose], return_inverse=True)[1], areas)
    n = pieces.sum() ** 2 / (pieces**2).sum()
    joint = level(triangles, np.flatnonzero(loose))
    return joint >= FRAGMENTS and joint * float(np.sqrt(n)) >= CHANCE


def scatter_of(triangles: NDArray[np.float64], labels: NDArray[np.int64]) -> float:
    """How far corners that were one have come apart, if pieces are noise around a surface; else 0.

    They are if most of their corners lie near corners of others, but not on them.
    """
    points = triangles.reshape(-1, 3)
    owners = np.repeat(labels, 3)
    near, which = scipy.spatial.cKDTree(points).query(points, min(8, len(points)), workers=-1)
    others = owners[which] != owners[:, None]
    nearest = np.where(others, near, np.inf).min(axis=1)
    sizes = np.repeat(np.sqrt(face_areas(triangles)), 3)
    moved = (nearest > MATCH[0] * sizes) & (nearest < MATCH[1] * sizes)
    return float(np.median(nearest[moved])) if moved.mean() > 0.5 else 0.0
