"""The boundary of a solid as one closed mesh of the faces that were given and of what completes them.

Where they do not join, a contour replaces them within boxes around these places. Where only one of the two has its
inside at a wall of a box, the wall closes the step between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Bools, Floats, Ints, place
from ..errors import GeometryError, counted
from ..grids.grid import RESOLUTION, Grid
from ..mesh.arrangement import SAME_POINT, arranged, meeting_faces
from ..mesh.components import element_components, numbered, sums_of
from ..mesh.edges import edge_table
from ..mesh.pinches import split_at_pinches
from ..mesh.triangles import part_volumes
from ..mesh.welding import indexed, tolerances
from ..search.face_tree import FaceTree
from ..surfaces.triangle_mesh import TriangleMesh
from .bodies import crossing_faces, whole_boundary, without_doubles
from .contouring import sharp_surface
from .offsets import Offset
from .regions import TOLERANCES, widest
from .tiles import Evaluated
from .winding import Windings

MOST_CONTOURS = 6
"""Largest number of rounds in which more of a surface is contoured; one that does not improve it is the last."""
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
    def of(cls, points: Floats, faces: Ints, uncrossed: bool = False) -> Joined:
        """Find where triangles do not close or, unless they are `uncrossed`, pass through each other."""
        table = edge_table(faces)
        gaps = table.vertices[table.balance != 0]
        if uncrossed:
            return cls(points, faces, gaps, bool(len(gaps)))
        depths = TOLERANCES[-1] * tolerances(points, faces, SAME_POINT)  # merging leaves crossings as deep as this
        meeting = faces[np.unique(crossing_faces(points, faces, depths))]
        return cls(points, faces, np.concatenate([gaps, meeting[:, :2], meeting[:, 1:]]), bool(len(gaps)))

    @property
    def mesh(self) -> TriangleMesh:
        """The triangles as a mesh; where bodies touch along an edge or at a vertex, each has vertices of its own."""
        used, faces = np.unique(self.faces, return_inverse=True)
        return TriangleMesh(*split_at_pinches(self.points[used], faces.reshape(-1, 3)))


@dataclass(frozen=True, eq=False)
class KeptSurface:
    """The boundary of a solid as one closed mesh, and a note on where it is a contour, empty if nowhere."""

    mesh: TriangleMesh
    note: str = ""


def kept_surface(solid: Evaluated) -> KeptSurface:
    """Join the bounding triangles of a solid into a closed mesh, with parts of a contour where they do not join."""
    windings = solid.windings
    bounding = solid.triangles[solid.bounding]
    if not len(bounding):
        raise GeometryError(
            "nothing of the shape bounds a solid", remedy="thicken it, or take the surface at a distance above zero"
        )
    whole = Joined.of(*indexed(bounding), solid.uncrossed)
    if len(whole.bad):
        proven = whole_boundary(bounding, windings)
        whole = whole if proven is None else Joined.of(*indexed(proven))
    if not len(whole.bad):
        return KeptSurface(whole.mesh)
    grid = Grid.around(solid.bounds, RESOLUTION)
    cell = float(grid.spacing.max())
    surface = sharp_surface(Offset(solid, 0.0), grid)
    bad, best = [_far(surface, whole.points[whole.faces], MISSING_FACE * cell)], whole
    for attempt in range(MOST_CONTOURS):  # with other walls each time
        bad.append(_along(best.points[best.bad], 0.5 * cell))
        boxes = Boxes.around(np.concatenate(bad), cell, (attempt + 1) * WALL_SHIFT % 1)
        joined = _exchanged(whole, windings, surface, boxes)
        if attempt and (joined.open, len(joined.bad)) >= (best.open, len(best.bad)):
            break
        best, used = joined, boxes
        if not len(joined.bad):
            break
    if not best.open and (whole.open or len(best.bad) < len(whole.bad)):
        return KeptSurface(_without_crumbs(best.mesh, used), f"faces kept but {_unjoined(used.middles, solid.bounds)}")
    first = place(whole.points[whole.bad[0]].mean(axis=0), solid.bounds)
    if whole.open:
        return KeptSurface(surface, f"contoured: the faces do not join, first at {first}")
    return KeptSurface(whole.mesh, f"faces kept, but some cross, the first at {first}")


def _unjoined(places: Floats, bounds: Floats) -> str:
    """Return words for a message: around how many of (k, 3) places a surface is a contour, and the first."""
    around = "one place" if len(places) == 1 else f"{counted(len(places), 'place')}, the first"
    return f"around {around} at {place(places[0], bounds)}, where they do not join: contoured there"


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
    """Replace the triangles within boxes by those of a contour, and close the steps between both by walls of the boxes.

    There is a step where a wall is inside either the solid of `windings` or the contour `surface`, but not both.
    """
    contour = surface.vertices[surface.faces]
    near = contour[boxes.grown.have(surface.vertices)[surface.faces].any(axis=1)]
    points, faces = indexed(np.concatenate([whole.points[whole.faces], near, boxes.walls]))
    sets = np.repeat(np.arange(3), [len(whole.faces), len(near), len(boxes.walls)])
    pairs = meeting_faces(points, faces)
    pieces = arranged(points, faces, pairs[sets[pairs[:, 0]] != sets[pairs[:, 1]]])
    centres = widest(pieces)
    within, kind = boxes.have(centres), sets[pieces.origins]
    walls = np.flatnonzero(kind == 2)
    in_contour, in_solid = Windings(contour).inside(centres[walls]), windings.inside(centres[walls])
    chosen = [(kind == 0) & ~within, (kind == 1) & within, walls[in_contour & ~in_solid]]
    backwards = pieces.faces[walls[in_solid & ~in_contour]][:, ::-1]
    return Joined.of(
        pieces.points, without_doubles(np.concatenate([*(pieces.faces[rows] for rows in chosen), backwards]))
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
    """Some cells of a grid."""

    indices: Ints  # (n, 3) indices of the cells along each axis
    cell: float  # length of their edges
    shift: Floats  # (3,) position of the grid's origin, in cells

    @classmethod
    def around(cls, points: Floats, cell: float, shift: Floats) -> Boxes:
        """Return the cells that (m, 3) points are in, and all that touch them."""
        return cls(np.unique(np.floor(points / cell - shift).astype(np.int64), axis=0), cell, shift).grown

    @cached_property
    def grown(self) -> Boxes:
        """These cells and all that touch them."""
        near = self.indices[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1
        return Boxes(np.unique(near.reshape(-1, 3), axis=0), self.cell, self.shift)

    def have(self, points: Floats) -> Bools:
        """(m,) which of (m, 3) points are in these cells."""
        return _among(np.floor(points / self.cell - self.shift).astype(np.int64), self.indices)

    @cached_property
    def walls(self) -> Floats:
        """(k, 3, 3) triangles of the sides between these cells and others; they face the others."""
        sides = []
        for axis in range(3):
            for side in range(2):
                step = np.zeros(3, dtype=np.int64)
                step[axis] = 2 * side - 1
                outer = self.indices[~_among(self.indices + step, self.indices)]
                sides.append(outer[:, None] + np.roll(CELL_SQUARES[side], axis, axis=1))
        quads = np.concatenate(sides)
        return self.cell * (np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) + self.shift)

    @property
    def middles(self) -> Floats:
        """(k, 3) middle of each connected group of cells."""
        corners = (self.indices[:, None] + np.array(list(np.ndindex(2, 2, 2)))).reshape(-1, 3)
        _, ids = np.unique(corners, axis=0, return_inverse=True)
        parts = element_components(ids.reshape(-1, 8))
        counts = np.bincount(parts)
        return self.cell * (sums_of(self.indices + 0.5, parts, len(counts)) / counts[:, None] + self.shift)


def _among(cells: Ints, others: Ints) -> Bools:
    """(n,) which of (n, 3) cell indices are among the (k, 3) others."""
    both = np.concatenate([others, cells])
    keys = np.ravel_multi_index(tuple((both - both.min(axis=0)).T), tuple(np.ptp(both, axis=0) + 1))
    return np.isin(keys[len(others) :], keys[: len(others)])
