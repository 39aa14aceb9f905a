"""Ends of walls: strips between rims near each other, such as those of a bowl's outside and inside without its lip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.directions import unit
from ..geometry.meshes import face_areas
from .lids import area_vector, cut_to_pieces
from .parts import parts_of
from .rims import loops, open_edges

NARROW = 0.3
"""Area of a strip at right angles to the surface at both rims, over that of flat lids on both, up to which it closes
them; where the surface goes straight on, the lesser area does. A bowl of half a ball whose wall is a quarter of its
radius has .28, a box without its lid, a tenth as thick as it is wide, .32, two square sheets a quarter of their width
apart .5."""
LARGE = 0.1
"""Area of those lids over that of their parts, from which on the wall ends there. Below, each side goes on over its own
opening: holes two fifths as wide as a hollow ball have .04, a cup .2, a bowl .5."""


def wall_ends(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k, 3) vertices of triangles between rims that run opposite ways, near each other all around.

    Examples
    --------
    >>> outside = np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]])
    >>> faces = np.array([[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]])  # two sides of a plate
    >>> len(wall_ends(np.concatenate([outside, outside - [0, 0, 1]]).astype(float), faces))
    8
    """
    labels = parts_of(faces)
    edges, owners = open_edges(faces, labels)
    several = np.bincount(labels)[owners] > 1  # what scatters as single faces has no walls
    edges, owners = edges[several], owners[several]
    if not len(edges):
        return edges.reshape(-1, 3)
    areas = np.bincount(labels, face_areas(vertices[faces])).astype(np.float64)
    keys = (faces * len(vertices) + np.roll(faces, -1, axis=1)).ravel()
    order = np.argsort(keys)
    rims = []
    for part in np.unique(owners):
        for loop in loops(edges[np.searchsorted(owners, part) : np.searchsorted(owners, part, side="right")]):
            behind = np.searchsorted(keys, np.roll(loop, -1) * len(vertices) + loop, sorter=order)
            face, side = np.divmod(order[np.minimum(behind, len(keys) - 1)], 3)
            rims.append(_Rim.of(loop, vertices, vertices[faces[face, (side + 2) % 3]], int(part)))
    strips = [strip(rims[i], rims[j]) for i, j in facing(rims, areas)]
    return np.concatenate([np.zeros((0, 3), dtype=np.int64), *strips])


@dataclass(frozen=True, eq=False)
class _Rim:
    """A closed loop where a part ends.

    Attributes
    ----------
    ids, corners : (n,) int, (n, 3) float
        Its vertices.
    onward : (n, 3) float
        Unit vectors at its edges, along the surface and away from it.
    part : int
        What ends there.
    centre, radius : (3,) float, float
        A ball around it.
    opening : (3,) float
        Area vector of a lid.
    """

    ids: NDArray[np.int64]
    corners: NDArray[np.float64]
    onward: NDArray[np.float64]
    part: int
    centre: NDArray[np.float64]
    radius: float
    opening: NDArray[np.float64]

    @classmethod
    def of(cls, ids: NDArray[np.int64], vertices: NDArray[np.float64], behind: NDArray[np.float64], part: int) -> _Rim:
        corners = vertices[ids]
        along = np.roll(corners, -1, axis=0) - corners
        away = corners - behind
        away -= ((away * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-300))[:, None] * along
        centre = corners.mean(axis=0)
        radius = float(np.linalg.norm(corners - centre, axis=1).max())
        return cls(ids, corners, unit(away), part, centre, radius, area_vector(corners))


def facing(rims: list[_Rim], areas: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Pairs of rims that run opposite ways, of parts with these areas: the strip between them is narrow enough."""
    centres, widths = np.array([rim.centre for rim in rims]), []
    for i, near in enumerate(scipy.spatial.cKDTree(centres).query_ball_point(centres, [rim.radius for rim in rims])):
        one = rims[i]
        for j in near:
            other = rims[j]
            if (other.radius, j) >= (one.radius, i) or one.opening @ other.opening >= 0:  # once, from the larger one
                continue
            lids = float(np.linalg.norm(one.opening) + np.linalg.norm(other.opening))
            if lids > LARGE * areas[np.unique([one.part, other.part])].sum():
                (area, onward), (again, back) = _way(one, other), _way(other, one)
                if area + again <= 2 * lids * (NARROW + (1 - NARROW) * (onward + back) / max(area + again, 1e-300)):
                    widths.append(((area + again) / lids, i, j))
    best: list[tuple[int, int]] = []
    taken: set[int] = set()
    for _, i, j in sorted(widths):
        if not {i, j} & taken:
            best.append((i, j))
            taken |= {i, j}
    return best


def _way(rim: _Rim, other: _Rim) -> tuple[float, float]:
    """Area between a rim and another; how much of it goes straight on."""
    along = np.roll(rim.corners, -1, axis=0) - rim.corners
    lengths = np.linalg.norm(along, axis=1)
    places = cut_to_pieces(other.corners)
    base = np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0)
    steps = np.linalg.norm(base, axis=1)
    base /= np.maximum(steps, 1e-300)[:, None]
    middles = rim.corners + 0.5 * along
    nearest = scipy.spatial.cKDTree(places).query(middles)[1]
    way = places[nearest] - middles
    way -= np.clip((way * base[nearest]).sum(axis=1), -steps[nearest], steps[nearest])[:, None] * base[nearest]
    return float(lengths @ np.linalg.norm(way, axis=1)), float(lengths @ (way * rim.onward).sum(axis=1))


def strip(one: _Rim, other: _Rim) -> NDArray[np.int64]:
    """(n + m, 3) vertices of triangles between rims that run opposite ways.

    From the nearest two corners on, each triangle has the shorter of the two diagonals that come next.
    """
    n, m = len(one.ids), len(other.ids)
    away, at = scipy.spatial.cKDTree(other.corners).query(one.corners)
    start = int(np.argmin(away))
    i, j = (start + np.arange(n + 1)) % n, (at[start] - np.arange(m + 1)) % m
    p, q = one.corners[i], other.corners[j]
    a, b, faces = 0, 0, []
    while a < n or b < m:
        if b == m or (a < n and np.linalg.norm(p[a + 1] - q[b]) <= np.linalg.norm(p[a] - q[b + 1])):
            faces.append((one.ids[i[a]], one.ids[i[a + 1]], other.ids[j[b]]))
            a += 1
        else:
            faces.append((one.ids[i[a]], other.ids[j[b + 1]], other.ids[j[b]]))
            b += 1
    return np.array(faces)
