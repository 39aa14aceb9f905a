"""The boundary of a solid as one closed mesh of the faces that were given and of what completes them.

Where they do not join, a contour replaces them within boxes around these places. Where only one of the two has its
inside at a wall of a box, the wall closes the step between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError
from ..mesh.arrangement import SAME_POINT, arranged, meeting_faces
from ..mesh.components import by_first_use, connected_components, element_components, numbered, sums_of
from ..mesh.edges import edge_table
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import divided_at, part_volumes
from ..mesh.unit_vectors import angles_around
from ..mesh.welding import coincident_faces, indexed, tolerances
from ..search.face_tree import FaceTree
from ..surfaces.triangle_mesh import TriangleMesh
from ..words import counted
from .regions import cut_and_sided, widest
from .tiles import Evaluated
from .winding import Windings

MISSING_FACE = 0.5
"""Distance from the faces, in cells, above which a contour shows that faces are missing. Cut edges are nearer."""
WALL_SHIFT = np.array([0.37, 0.41, 0.43])
"""Shift of the walls of boxes, in cells, so that they do not lie in faces along the axes."""
CELL_SQUARES = np.array([[[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]]])
"""Corners of the sides of a cell across the first axis, counter-clockwise as seen from outside."""


@dataclass(frozen=True, eq=False)
class Joined:
    """Triangles that meet in whole edges, and where they do not close or pass through each other."""

    points: Floats  # (n, 3)
    faces: Ints  # (m, 3)
    bad: Ints  # (k, 2) ends of unbalanced edges, and of edges of faces that pass through each other
    open: bool  # whether any edges are unbalanced

    @classmethod
    def of(cls, points: Floats, faces: Ints) -> Joined:
        """Find where triangles do not close or pass through each other."""
        table = edge_table(faces)
        gaps = table.vertices[table.balance != 0]
        meeting = faces[np.unique(self_intersections(points, faces))]
        return cls(points, faces, np.concatenate([gaps, meeting[:, :2], meeting[:, 1:]]), bool(len(gaps)))

    @property
    def mesh(self) -> TriangleMesh:
        """The triangles as a mesh; where bodies touch along an edge or at a vertex, each has vertices of its own."""
        used, faces = np.unique(self.faces, return_inverse=True)
        return TriangleMesh(*split_at_pinches(self.points[used], faces.reshape(-1, 3)))


def given_surface(solid: Evaluated, contour: Callable[[], TriangleMesh], cell: float) -> tuple[TriangleMesh, Floats]:
    """Join the bounding triangles of a solid into a closed mesh; return it, and (k, 3) places where it is a contour."""
    windings = solid.windings
    bounding = solid.triangles[solid.bounding]
    if not len(bounding):
        raise GeometryError(
            "nothing of the shape bounds a solid", remedy="thicken it, or take the surface at a distance above zero"
        )
    whole = Joined.of(*indexed(bounding))
    if len(whole.bad):
        whole = _conforming(whole, windings)
    if not len(whole.bad):
        return whole.mesh, np.zeros((0, 3))
    best: tuple[Joined, Boxes | None] | None = None if whole.open else (whole, None)
    surface = contour()
    bad = [_far(surface, whole.points[whole.faces], MISSING_FACE * cell)]
    found: Joined = whole
    for attempt in range(6):  # with other walls each time
        bad.append(_along(found.points[found.bad], 0.5 * cell))
        boxes = Boxes.around(np.concatenate(bad), cell, (attempt + 1) * WALL_SHIFT % 1)
        found = _exchanged(whole, windings, surface, boxes)
        if not found.open and (best is None or len(found.bad) < len(best[0].bad)):
            best = found, boxes
        if not len(found.bad):
            break
    if best is None:
        place = found.points[found.bad[0]].mean(axis=0)
        raise GeometryError(
            f"faces and completion do not join, first at ({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g})",
            remedy="leave out keep_faces: the sharp surface is closed",
            element="surface",
        )
    found, places = best
    return (found.mesh, np.zeros((0, 3))) if places is None else (_without_crumbs(found.mesh, places), places.middles)


def _conforming(whole: Joined, windings: Windings) -> Joined:
    """Divide triangles where they cross or end on each other, and drop parts that lie inside or cancel in pairs."""
    cut = partial(arranged, whole.points, whole.faces, None)
    slacks = tolerances(whole.points, whole.faces, SAME_POINT)
    pieces, regions = cut_and_sided(cut, slacks, np.ones(len(whole.faces), dtype=bool), windings)
    return Joined.of(pieces.points, _without_doubles(pieces.faces[regions.bounds]))


def _without_doubles(faces: Ints) -> Ints:
    """Drop pairs of faces on the same vertices that face opposite ways, and faces on fewer than three vertices."""
    first, reverse = coincident_faces(faces.ravel(), np.arange(0, faces.size + 1, 3))
    proper = first >= 0
    forth, back = (np.bincount(first[proper & (reverse == way)], minlength=len(faces)) for way in (False, True))
    return faces[proper & ~((forth == 1) & (back == 1))[first]]


def unjoined(places: Floats) -> str:
    """Say where a contour was taken, for messages."""
    x, y, z = places[0]
    around = "one place" if len(places) == 1 else f"{counted(len(places), 'place')}, the first"
    return f"around {around} at ({x:.4g}, {y:.4g}, {z:.4g}), where they do not join: contoured there"


def _along(edges: Floats, step: float) -> Floats:
    """Return (n, 3) points on (m, 2, 3) edges, both ends among them, at most a step apart."""
    pieces = np.maximum(np.ceil(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / step), 1).astype(np.int64)
    row, number = numbered(pieces + 1)
    return edges[row, 0] + (number / pieces[row])[:, None] * (edges[row, 1] - edges[row, 0])


def _far(surface: TriangleMesh, triangles: Floats, distance: float) -> Floats:
    """Return the (n, 3) vertices and face centres of a surface that are farther than a distance from all triangles."""
    points = np.concatenate([surface.vertices, surface.vertices[surface.faces].mean(axis=1)])
    tree = FaceTree.of_triangles(triangles)
    return points[tree.distances(points) > distance]


def _exchanged(whole: Joined, windings: Windings, surface: TriangleMesh, boxes: Boxes) -> Joined:
    """Replace what is in boxes by a surface, and add walls of the boxes where only one of the two has its inside."""
    contour = surface.vertices[surface.faces]
    points, faces = indexed(np.concatenate([whole.points[whole.faces], contour, boxes.walls]))
    sets = np.repeat(np.arange(3), [len(whole.faces), len(contour), len(boxes.walls)])
    pairs = meeting_faces(points, faces)
    pieces = arranged(points, faces, pairs[sets[pairs[:, 0]] != sets[pairs[:, 1]]])
    centres = widest(pieces)
    within, kind = boxes.have(centres), sets[pieces.origins]
    walls = np.flatnonzero(kind == 2)
    here, there = Windings(contour).inside(centres[walls]), windings.inside(centres[walls])
    chosen = [(kind == 0) & ~within, (kind == 1) & within, walls[here & ~there]]
    backwards = pieces.faces[walls[there & ~here]][:, ::-1]
    return Joined.of(
        pieces.points, _without_doubles(np.concatenate([*(pieces.faces[each] for each in chosen), backwards]))
    )


def _without_crumbs(mesh: TriangleMesh, boxes: Boxes) -> TriangleMesh:
    """Return a mesh without bodies and cavities smaller than a cell that lie in boxes or next to them."""
    parts, volumes = part_volumes(mesh.vertices, mesh.faces)
    small = np.abs(volumes) < boxes.cell**3
    beyond = ~boxes.grown.have(mesh.vertices)[mesh.faces].all(axis=1)
    crumbs = small & (np.bincount(parts, beyond) == 0)
    used, faces = np.unique(mesh.faces[~crumbs[parts]], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Boxes:
    """Cells of a grid."""

    places: Ints  # (n, 3) indices of the cells along each axis
    cell: float  # length of their edges
    shift: Floats  # (3,) position of the grid's origin, in cells

    @classmethod
    def around(cls, points: Floats, cell: float, shift: Floats) -> Boxes:
        """Return the cells that points are in, and all that touch them."""
        return cls(np.unique(np.floor(points / cell - shift).astype(np.int64), axis=0), cell, shift).grown

    @cached_property
    def grown(self) -> Boxes:
        """These cells and all that touch them."""
        near = self.places[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1
        return Boxes(np.unique(near.reshape(-1, 3), axis=0), self.cell, self.shift)

    def have(self, points: Floats) -> Bools:
        """(m,) which of (m, 3) points are in these cells."""
        return _among(np.floor(points / self.cell - self.shift).astype(np.int64), self.places)

    @cached_property
    def walls(self) -> Floats:
        """(k, 3, 3) triangles of the sides between these cells and others; they face the others."""
        found = []
        for axis in range(3):
            for side in range(2):
                step = np.zeros(3, dtype=np.int64)
                step[axis] = 2 * side - 1
                outer = self.places[~_among(self.places + step, self.places)]
                found.append(outer[:, None] + np.roll(CELL_SQUARES[side], axis, axis=1))
        quads = np.concatenate(found)
        return self.cell * (np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) + self.shift)

    @property
    def middles(self) -> Floats:
        """(k, 3) middle of each connected group of cells."""
        corners = (self.places[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)
        _, ids = np.unique(corners, axis=0, return_inverse=True)
        parts = element_components(ids.reshape(-1, 8))
        counts = np.bincount(parts)
        return self.cell * (sums_of(self.places + 0.5, parts, len(counts)) / counts[:, None] + self.shift)


def _among(places: Ints, others: Ints) -> Bools:
    """(n,) which of (n, 3) cells are among others."""
    both = np.concatenate([others, places])
    keys = np.ravel_multi_index(tuple((both - both.min(axis=0)).T), tuple(np.ptp(both, axis=0) + 1))
    return np.isin(keys[len(others) :], keys[: len(others)])


def split_at_pinches(points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Double the edges and vertices at which parts of a closed mesh touch, so that the insides of parts do not meet."""
    points, faces = _split(points, faces)
    while True:
        table = edge_table(faces)
        crowded = np.where(table.face_counts[table.face_edges] > 2, table.face_edges, len(table.vertices))
        if not (crowded < len(table.vertices)).any():
            return points, faces
        least = crowded.min(axis=1)  # of each face only one edge is divided at a time
        agreed = np.bincount(least, minlength=len(table.vertices) + 1)[:-1] == table.face_counts
        edges = np.flatnonzero(agreed & (table.face_counts > 2))
        rows, corners = np.nonzero(np.isin(table.face_edges, edges))
        middles = len(points) + np.searchsorted(edges, table.face_edges[rows, corners])
        points = np.concatenate([points, points[table.vertices[edges]].mean(axis=1)])
        points, faces = _split(points, divided_at(faces, rows, corners, middles))


def _split(points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Give each fan of faces around a vertex a vertex of its own."""
    table = edge_table(faces)
    starts, halfedges = table.halfedges
    edges = table.face_edges.ravel()
    crowded = np.flatnonzero(table.face_counts[edges[halfedges]] > 2)  # two faces have only one order
    around = halfedges.copy()
    around[crowded] = _in_turn(points, faces, table.vertices[edges[halfedges[crowded]]], halfedges[crowded])
    previous = np.arange(len(around)) - 1
    previous[starts[:-1]] = starts[1:] - 1
    forward = table.forward.ravel()
    paired = forward[around] & ~forward[around[previous]]
    one, other = around[paired], around[previous[paired]]
    following, beyond = (3 * (each // 3) + (each + 1) % 3 for each in (one, other))
    corners = connected_components(faces.size, np.concatenate([one, following]), np.concatenate([beyond, other]))
    if int(corners.max(initial=-1)) + 1 == len(np.unique(faces)):
        return points, faces
    numbers, _ = by_first_use(corners, int(corners.max()) + 1)
    owners = np.empty(int(numbers.max()) + 1, dtype=np.int64)
    owners[numbers] = faces.ravel()
    return points[owners], numbers.reshape(-1, 3)


def _in_turn(points: Floats, faces: Ints, ends: Ints, halfedges: Ints) -> Ints:
    """Sort (k,) halfedges, given edge by edge with (k, 2) ends of their edges, by the angles of faces around edges."""
    tails, heads = points[ends].swapaxes(0, 1)
    away = points[faces.ravel()[3 * (halfedges // 3) + (halfedges + 2) % 3]] - tails
    angles = angles_around(heads - tails, away)
    edges = np.cumsum(np.append(0, (ends[1:] != ends[:-1]).any(axis=1)))
    return halfedges[np.lexsort((angles, edges[: len(ends)]))]
