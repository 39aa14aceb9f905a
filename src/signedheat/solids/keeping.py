"""The boundary of a solid as one closed mesh of the faces that were given and of what completes them.

Where they do not join, the surface is contoured: within boxes around these places it is a contour, elsewhere the faces,
and between them walls of the boxes where only one of them has the inside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..geometry.box_tree import BoxTree
from ..geometry.components import element_components, sums_of
from ..geometry.conforming import conforming
from ..geometry.cut_faces import cut_faces
from ..geometry.directions import unit
from ..geometry.face_tree import FaceTree
from ..geometry.meshes import area_vectors, part_volumes
from ..geometry.self_intersections import self_intersections
from .fields import Evaluated
from .parts import parts_of
from .winding import Windings

TOGETHER = 1e-7
"""Distance, over the size of the solid, up to which corners are one: triangles that cut each other are cut one by one,
and come to the same place only up to rounding in their planes."""
OFF = 0.5
"""Cells between contour and faces from which on faces are missing; edges of contours are cut off by less."""
SHIFT = np.array([0.37, 0.41, 0.43])
"""Of the walls of boxes, in cells, so that they lie in no face along the axes."""
ATTEMPTS = 6
"""Times that boxes are put around what does not join, and around triangles that pass through each other; each time with
other walls."""
SQUARES = np.array([[[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]])
"""Corners of the sides of a cell across the first axis, counter-clockwise as seen from outside."""


def given_surface(
    solid: Evaluated, contour: Callable[[], TriangleMesh], cell: float
) -> tuple[TriangleMesh, NDArray[np.float64]]:
    """Triangles of a solid with the inside on one side, turned to have it behind them, joined into a closed mesh.

    Of faces that lie in each other, where bodies overlap, one is taken. Where triangles do not join, the surface of
    `contour`, with cells of this size, takes their place; the middles of such places, (k, 3), are returned, too.

    Raises
    ------
    GeometryError
        If there are no such triangles, or they do not join with the contour either.
    """
    windings = solid.windings
    size = float(np.ptp(solid.triangles.reshape(-1, 3), axis=0).max())
    turned, _ = outward(solid)
    if not len(turned):
        raise GeometryError(
            "nothing of the shape bounds a solid", remedy="thicken it, or take the surface at a distance above zero"
        )
    found: tuple[int, TriangleMesh, Boxes | None] | None = None
    boxes: Boxes | None = None
    bad: list[NDArray[np.float64]] = []
    pieces = turned
    for attempt in range(ATTEMPTS):
        vertices, faces, gaps = conforming(pieces, TOGETHER * size)
        meeting = faces[np.unique(self_intersections(vertices, faces))]
        if not len(gaps) and (found is None or len(meeting) < found[0]):
            found = len(meeting), _compact(vertices, faces), boxes
            if not len(meeting):
                break
        if not bad:
            surface = contour()
            bad.append(_far(surface, vertices[faces], OFF * cell))
        bad.append(_along(vertices[np.concatenate([gaps, meeting[:, :2], meeting[:, 1:]])], 0.5 * cell))
        boxes = Boxes.around(np.concatenate(bad), cell, (attempt + 1) * SHIFT % 1)
        pieces = _exchanged(turned, windings, surface, boxes)
    if found is None:
        place = vertices[gaps[0]].mean(axis=0)
        raise GeometryError(
            f"faces and completion do not join along {len(gaps)} edges, the first at "
            f"({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g})",
            remedy="leave out keep_faces: the sharp surface is closed",
            element="surface",
        )
    _, whole, boxes = found
    return (whole, np.zeros((0, 3))) if boxes is None else (_without_crumbs(whole, boxes), boxes.middles)


def outward(solid: Evaluated) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(k, 3, 3) triangles with the inside on one side, turned to have it behind them, and which ones these are.

    Of those that lie in each other, where bodies overlap, one is taken.
    """
    behind, ahead = solid.windings.sides(solid.triangles)
    chosen = np.flatnonzero(behind != ahead)
    turned = np.where(ahead[chosen, None, None], solid.triangles[chosen, ::-1], solid.triangles[chosen])
    size = float(np.ptp(solid.triangles.reshape(-1, 3), axis=0).max())
    once = ~covered(turned, _parts(solid)[chosen], TOGETHER * size)
    return turned[once], chosen[once]


def unjoined(places: NDArray[np.float64]) -> str:
    """Where a contour was taken, for messages."""
    x, y, z = places[0]
    around = "one place" if len(places) == 1 else f"{len(places)} places, the first"
    return f"around {around} at ({x:.4g}, {y:.4g}, {z:.4g}), where they do not join: contoured there"


def _compact(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> TriangleMesh:
    used, renumbered = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices[used], renumbered.reshape(-1, 3))


def _parts(solid: Evaluated) -> NDArray[np.int64]:
    """(m,) the part of the shape that each triangle is of; completion comes last."""
    if solid.source is None:
        return np.zeros(len(solid.triangles), dtype=np.int64)
    given = parts_of(solid.source.faces)
    return np.where(solid.origins >= 0, given[solid.origins], given.max() + 1)


def covered(triangles: NDArray[np.float64], parts: NDArray[np.int64], tolerance: float) -> NDArray[np.bool_]:
    """(m,) which triangles lie in triangles of a part that comes before theirs, and face the same way."""
    if not len(triangles):
        return np.zeros(0, dtype=bool)
    a, b, c = triangles.transpose(1, 0, 2)
    normals = unit(area_vectors(triangles))
    centres = triangles.mean(axis=1)
    tree = BoxTree.of(triangles.min(axis=1), triangles.max(axis=1))
    starts, near = tree.meeting(np.repeat(centres[:, None], 3, axis=1), tolerance)
    own = np.repeat(np.arange(len(triangles)), np.diff(starts))
    before = parts[near] < parts[own]
    own, near = own[before], near[before]
    inside = ((normals[own] * normals[near]).sum(axis=1) > 0.5) & (
        np.abs(((centres[own] - a[near]) * normals[near]).sum(axis=1)) <= tolerance
    )
    for tail, head in ((a, b), (b, c), (c, a)):
        across = unit(np.cross(normals[near], head[near] - tail[near]))
        inside &= ((centres[own] - tail[near]) * across).sum(axis=1) >= -tolerance
    result = np.zeros(len(triangles), dtype=bool)
    result[own[inside]] = True
    return result


def _along(edges: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """(n, 3) points on edges, (m, 2, 3), as far apart as that at most."""
    pieces = np.maximum(np.ceil(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / step), 1).astype(np.int64)
    row = np.repeat(np.arange(len(edges)), pieces + 1)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(pieces + 1) - pieces - 1, pieces + 1)) / pieces[row]
    points: NDArray[np.float64] = edges[row, 0] + share[:, None] * (edges[row, 1] - edges[row, 0])
    return points


def _far(surface: TriangleMesh, triangles: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """(n, 3) vertices and centres of a surface that are that far from all triangles."""
    points = np.concatenate([surface.vertices, surface.vertices[surface.faces].mean(axis=1)])
    tree = FaceTree.of_triangles(triangles)
    return points[tree.distances(points) > distance]


def _exchanged(
    triangles: NDArray[np.float64], windings: Windings, surface: TriangleMesh, boxes: Boxes
) -> NDArray[np.float64]:
    """Triangles outside of boxes, those of a surface within, and walls of the boxes where one of them is inside."""

    def cut(pieces: NDArray[np.float64], knives: NDArray[np.float64]) -> NDArray[np.float64]:
        ids = np.arange(3 * len(pieces)).reshape(-1, 3)
        return cut_faces(pieces, ids, knives, ids.size + np.arange(3 * len(knives)).reshape(-1, 3))[0]

    contour = surface.vertices[surface.faces]
    outer, inner = cut(triangles, boxes.walls), cut(contour, boxes.walls)
    outer, inner = outer[~boxes.have(outer.mean(axis=1))], inner[boxes.have(inner.mean(axis=1))]
    walls = cut(cut(boxes.walls, triangles), contour)
    centres = walls.mean(axis=1)
    here, there = Windings(contour).inside(centres), windings.inside(centres)
    return np.concatenate([outer, inner, walls[here & ~there], walls[there & ~here][:, ::-1]])


def _without_crumbs(mesh: TriangleMesh, boxes: Boxes) -> TriangleMesh:
    """A mesh without bodies and cavities smaller than a cell that lie in boxes or next to them."""
    parts, volumes = part_volumes(mesh.vertices, mesh.faces)
    small = np.abs(volumes) < boxes.cell**3
    beyond = ~boxes.grown.have(mesh.vertices)[mesh.faces].all(axis=1)
    crumbs = small & (np.bincount(parts, beyond) == 0)
    return _compact(mesh.vertices, mesh.faces[~crumbs[parts]])


@dataclass(frozen=True, eq=False)
class Boxes:
    """Cells of a grid.

    Attributes
    ----------
    places : (n, 3) int
        Which.
    cell : float
        Their size.
    shift : (3,) float
        In cells, of the grid against the origin.
    """

    places: NDArray[np.int64]
    cell: float
    shift: NDArray[np.float64]

    @classmethod
    def around(cls, points: NDArray[np.float64], cell: float, shift: NDArray[np.float64]) -> Boxes:
        """The cells that points are in, and all that touch them."""
        return cls(np.unique(np.floor(points / cell - shift).astype(np.int64), axis=0), cell, shift).grown

    @cached_property
    def grown(self) -> Boxes:
        """With all that touch them."""
        near = self.places[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1
        return Boxes(np.unique(near.reshape(-1, 3), axis=0), self.cell, self.shift)

    def have(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(m,) which of (m, 3) points are in them."""
        return _among(np.floor(points / self.cell - self.shift).astype(np.int64), self.places)

    @cached_property
    def walls(self) -> NDArray[np.float64]:
        """(k, 3, 3) triangles of their sides towards other cells, which face outwards."""
        found = []
        for axis in range(3):
            for side in range(2):
                step = np.zeros(3, dtype=np.int64)
                step[axis] = 2 * side - 1
                outer = self.places[~_among(self.places + step, self.places)]
                found.append(outer[:, None] + np.roll(SQUARES[side], axis, axis=1))
        quads = np.concatenate(found)
        return self.cell * (np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) + self.shift)

    @property
    def middles(self) -> NDArray[np.float64]:
        """(k, 3) of their connected parts."""
        corners = (self.places[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)
        _, ids = np.unique(corners, axis=0, return_inverse=True)
        parts = element_components(ids.reshape(-1, 8))
        counts = np.bincount(parts)
        return self.cell * (sums_of(self.places + 0.5, parts, len(counts)) / counts[:, None] + self.shift)


def _among(places: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) which of (n, 3) cells are among others."""
    both = np.concatenate([others, places])
    keys = np.ravel_multi_index(tuple((both - both.min(axis=0)).T), tuple(np.ptp(both, axis=0) + 1))
    return np.isin(keys[len(others) :], keys[: len(others)])
