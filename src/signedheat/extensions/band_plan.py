"""What every tile of a band needs: the faces, and the coarse field that tells sides where no face does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..fields.band_field import BandField
from ..fields.grid_field import GridField
from ..geometry.box_tree import BoxTree
from ..geometry.face_features import FaceFeatures
from ..geometry.face_tree import FaceTree
from ..geometry.touching_faces import touching_faces
from ..geometry.winding_tree import WindingTree
from ..operators.grid.blocks import CUBE, SIDE
from ..operators.grid.exact_surface import ExactSurface
from .band_grids import ENDS, FAR, LEAST, SLACK
from .rims import Rims, rims_of

TILE = SIDE * CUBE
"""Nodes along each edge of a tile."""
NEAR = 2.0
"""Coarse cells from a face within which it tells the side."""
WIDEST = 1e3
"""Half width of a band, relative to the grid, beyond which it is taken for a mistake."""
ROUGH = 0.1
"""By how much places may be farther away than asked, relative, where that saves time."""
TOUCHING = 1e-3
"""Cells between faces that lie on each other."""
BEYOND, COVERED = 2.0, 0.75
"""Cells beyond an end at which surface goes on inside bodies, as where they were united, if this is the winding number
there: nothing is missing."""
Kept: TypeAlias = Callable[[NDArray[np.int64], int], NDArray[np.bool_]]
"""From the places of cubes, and the number of blocks along their edges, to which of them to keep."""


@dataclass(frozen=True, eq=False)
class BandPlan:
    """A band around a shape, before any of its nodes has a value.

    Attributes
    ----------
    grid : Grid
        Of the band's nodes, few of which are there.
    coarse : GridField or BandField
        Distance on coarser nodes, of the whole box or in a band that is wide enough; first node at that of `grid`.
    width : float
        Distance up to which the band reaches on both sides, in units of length.
    features : FaceFeatures
        Faces, around the first node.
    telling : (m,) bool
        Those that tell a side.
    ends : (e, 3) float
        Places where the surface ends or bounds nothing, at most half a coarse cell apart, around the first node.
    asked : (m,) bool
        Those that do not, but beside which winding numbers do.
    share : float
        Of the surface that is there, by which winding numbers are divided.
    closed : bool
        Whether winding numbers tell all sides, and nothing is completed.
    tree : BoxTree, optional
        Over the boxes of the faces; made when it is first needed.
    """

    grid: Grid
    coarse: GridField | BandField
    width: float
    features: FaceFeatures
    telling: NDArray[np.bool_]
    ends: NDArray[np.float64]
    asked: NDArray[np.bool_]
    share: float = 1.0
    closed: bool = False
    tree: BoxTree | None = None

    @property
    def steps(self) -> NDArray[np.float64]:
        """(3,) distance between the nodes."""
        return self.grid.spacing

    @property
    def cell(self) -> float:
        """The largest of them."""
        return float(self.grid.spacing.max())

    @property
    def coarse_cell(self) -> float:
        """The same of the coarse grid."""
        return float(self.coarse.grid.spacing.max())

    @property
    def far(self) -> GridField:
        """Distance on the whole box."""
        return self.coarse.coarse if isinstance(self.coarse, BandField) else self.coarse

    @cached_property
    def faces(self) -> FaceTree | None:
        """The faces in a tree; None if there are none."""
        if not len(self.features.rows):
            return None
        return FaceTree.of(self.features) if self.tree is None else FaceTree(self.features, self.tree)

    @cached_property
    def winding(self) -> WindingTree | None:
        """Winding numbers of the faces; None if there are none."""
        if self.faces is None:
            return None
        return WindingTree(self.features.corners.reshape(-1, 3, 3), self.faces.tree)

    @cached_property
    def touching(self) -> NDArray[np.bool_]:
        """(m,) faces on which others lie: which of them is the nearer tells nothing."""
        if self.faces is None:
            return np.zeros(0, dtype=bool)
        bounds, items = self.faces.tree.bounds, self.faces.tree.items
        gap = TOUCHING * self.cell
        found: NDArray[np.bool_] = touching_faces(self.features.corners, self.features.face_normals, bounds, items, gap)
        return found

    @cached_property
    def rims(self) -> Rims | None:
        """Those of the faces."""
        if not len(self.features.rows):
            return None
        mesh = TriangleMesh(self.features.vertices, self.features.faces)
        return rims_of(mesh, Grid(np.zeros(3), self.coarse.grid.spacing, self.coarse.grid.shape))

    @cached_property
    def levels(self) -> tuple[scipy.spatial.cKDTree, NDArray[np.float64]] | None:
        """Places of the completed surface of the coarse field, far from faces, and their winding numbers."""
        surface = self.coarse.surface
        if surface is None or self.faces is None or self.winding is None or not len(surface.crossings):
            return None
        places = np.ascontiguousarray(surface.crossings[:, 1:4])
        places = places[self.faces.distances(places) > FAR * self.coarse_cell]
        return (scipy.spatial.cKDTree(places), self.winding.numbers(places) / self.share) if len(places) else None

    @cached_property
    def open_places(self) -> scipy.spatial.cKDTree | None:
        """Around which surface may have to be completed: `ends`, and what the coarse field completes."""
        surface = self.coarse.surface
        crossings = np.zeros((0, 3)) if surface is None or self.closed else surface.crossings[:, 1:4]
        places = np.concatenate([self.ends, crossings])
        return scipy.spatial.cKDTree(places) if len(places) else None

    @cached_property
    def end_tree(self) -> scipy.spatial.cKDTree | None:
        """The places where the surface ends."""
        return scipy.spatial.cKDTree(self.ends) if len(self.ends) else None

    @cached_property
    def tiles(self) -> NDArray[np.int64]:
        """(t, 3) first nodes, divided by `TILE`, of the tiles that hold blocks of the band, in their order."""
        limit = -(-np.array(self.grid.shape) // SIDE)
        found = self._divided(np.zeros(3, dtype=np.int64), limit, CUBE)
        return found[np.lexsort(found.T[::-1])]

    def blocks_in(self, low: NDArray[np.int64], high: NDArray[np.int64], kept: Kept | None = None) -> NDArray[np.int64]:
        """(n, 3) places of the blocks that may hold nodes of the band, in a box of blocks [low, high).

        With `kept`, those of them alone that it tells to keep; it is asked for cubes of ever fewer blocks.
        """
        limit = -(-np.array(self.grid.shape) // SIDE)
        return self._divided(np.maximum(low, 0), np.minimum(high, limit), 1, kept)

    def _divided(
        self, low: NDArray[np.int64], high: NDArray[np.int64], least: int, kept: Kept | None = None
    ) -> NDArray[np.int64]:
        """Places of cubes of `least` blocks in a box that may hold nodes of the band, by halving larger ones."""
        longest = max(int((high - low).max()), least)
        size = least << (-(-longest // least) - 1).bit_length()
        first, last = low // size, -(-high // size)
        places = first + np.argwhere(np.ones(np.maximum(last - first, 0), dtype=bool))
        inner = np.argwhere(np.ones((2, 2, 2), dtype=bool))
        while True:
            places = places[((places * size < high) & ((places + 1) * size > low)).all(axis=1)]
            if kept is not None:
                places = places[kept(places, size)]
            places = self._near(places, size * SIDE)
            if size == least:
                return places
            places = (2 * places[:, None] + inner).reshape(-1, 3)
            size //= 2

    def is_open(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> bool:
        """Whether surface may have to be completed within reach of a box of blocks."""
        return self._is_near(self.open_places, low, high, self.open_reach)

    def has_ends(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> bool:
        """Whether the surface ends so near to a box of blocks that the fine solution counts there."""
        return self._is_near(self.end_tree, low, high, ENDS * self.coarse_cell)

    def blocks_near(
        self, tree: scipy.spatial.cKDTree | None, places: NDArray[np.integer], size: int = 1
    ) -> NDArray[np.bool_]:
        """(n,) which cubes of `size` blocks have nodes so near to open places or ends that the fine solution counts."""
        if tree is None or not len(places):
            return np.zeros(len(places), dtype=bool)
        last = size * SIDE - 1
        centres = (places.astype(np.int64) * size * SIDE + 0.5 * last) * self.steps
        within = ENDS * self.coarse_cell + 0.5 * float(np.linalg.norm(last * self.steps))
        found: NDArray[np.bool_] = tree.query(centres, distance_upper_bound=within)[0] <= within
        return found

    def away_from_ends(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) which of some places are so far from all ends of the surface that the fine solution does not count."""
        if self.end_tree is None:
            return np.ones(len(points), dtype=bool)
        reach = ENDS * self.coarse_cell
        away: NDArray[np.bool_] = self.end_tree.query(points, distance_upper_bound=reach)[0] > reach
        return away

    def _is_near(
        self, tree: scipy.spatial.cKDTree | None, low: NDArray[np.int64], high: NDArray[np.int64], reach: float
    ) -> bool:
        if tree is None:
            return False
        centre = 0.5 * (low + high) * SIDE * self.steps
        radius = 0.5 * float(np.linalg.norm((high - low) * SIDE * self.steps))
        places = tree.data[tree.query_ball_point(centre, radius + reach + 2 * SIDE * self.cell)]
        excess = np.maximum(np.maximum(low * SIDE * self.steps - places, places - high * SIDE * self.steps), 0.0)
        return bool((np.linalg.norm(excess, axis=1) <= reach + SIDE * self.cell).any())

    @property
    def reach(self) -> float:
        """Distance from the surface up to which nodes are in the band: a contour at `width` has whole cells."""
        return self.width + float(np.linalg.norm(self.steps))

    @property
    def open_reach(self) -> float:
        """The same from open places, near which the finer surface need not be where the coarse one is."""
        return self.reach + FAR * self.coarse_cell

    def _near(self, places: NDArray[np.int64], size: int) -> NDArray[np.int64]:
        """Those of some cubes of `size` nodes that may hold nodes of the band."""
        if not len(places):
            return places
        centres = (places * size + 0.5 * (size - 1)) * self.steps
        radius = 0.5 * float(np.linalg.norm((size - 1) * self.steps))
        near = np.zeros(len(places), dtype=bool)
        if self.faces is not None:
            near = self.faces.distances(centres) <= self.reach + radius
        if self.open_places is not None:
            rest = np.flatnonzero(~near)
            within = self.open_reach + radius
            rest = rest[_may_be_within(self.open_places, centres[rest], within)]
            heights, cells = self._coarse_heights(centres[rest])
            near[rest] = np.abs(heights) <= self.reach + radius + SLACK * cells
            if self.end_tree is not None:  # where the fine surface need not be where the coarse one is
                rest = rest[~near[rest]]
                near[rest] = _may_be_within(self.end_tree, centres[rest], within)
            walls = np.flatnonzero(~near & self.at_walls(places, size))
            near[walls] = self.coarse_function(centres[walls]) < self.reach + radius
        return places[near]

    def at_walls(self, places: NDArray[np.integer], size: int) -> NDArray[np.bool_]:
        """Which of some cubes of `size` nodes hold nodes on the walls: where those are inside, contours are closed."""
        last = (np.array(self.grid.shape) - 1) // size
        return np.asarray(((places == 0) | (places == last)).any(axis=1))

    def coarse_function(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) the coarse field at places around the first node."""
        return self._coarse_heights(points)[0]

    def coarse_confidence(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """(n,) confidence of the coarse field at places around the first node."""
        if self.coarse.confidence is None:
            return np.ones(len(points), dtype=np.float32)
        if isinstance(self.coarse, BandField):
            return self.coarse.confidence_at(self.grid.origin + points)
        return _linear(self.coarse.confidence, self.coarse.grid, points)

    def _coarse_heights(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(n,) the coarse field at places around the first node, and the cells between whose nodes it is told."""
        far_cell = float(self.far.grid.spacing.max())
        if not isinstance(self.coarse, BandField):
            return _linear(self.far.values, self.far.grid, points), np.full(len(points), far_cell)
        values = self.coarse.blocks.interpolated(self.coarse.values, points / self.coarse.grid.spacing)
        beyond = np.flatnonzero(np.isnan(values))
        values[beyond] = _linear(self.far.values, self.far.grid, points[beyond])
        cells = np.full(len(points), self.coarse_cell)
        cells[beyond] = far_cell
        return values, cells

    def surface(self, crossings: NDArray[np.float64]) -> ExactSurface:
        """What the band has distances to: the faces, and (c, 18) crossings where they are missing."""
        telling = None if self.telling.all() else self.telling
        origin, steps = np.array(self.grid.origin), np.array(self.steps)
        return ExactSurface(self.features, crossings, origin, steps, telling, None, self.asked, self.share, self.closed)


def _may_be_within(tree: scipy.spatial.cKDTree, points: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
    """(n,) which points have places of a tree within reach; some a little beyond are told, too.

    Exactly the nearest is searched for long where many are about as near.
    """
    found = tree.query(points, eps=ROUGH, distance_upper_bound=(1 + ROUGH) * reach)[0]
    return np.asarray(np.isfinite(found))


def _linear(values: NDArray[Any], grid: Grid, points: NDArray[np.float64]) -> NDArray[Any]:
    """(n,) values of nodes at places around the first, linear between them, and beyond the walls as at them."""
    index = (points / grid.spacing).T
    result: NDArray[Any] = scipy.ndimage.map_coordinates(values, index, order=1, mode="nearest")
    return result


def plan_band(coarse: GridField | BandField, grid: Grid, band: float) -> BandPlan:
    """The plan of a band of half width `band` on a grid, from the distance on a coarser one.

    Raises
    ------
    GeometryError
        If the band is no positive length.
    """
    if not (np.isfinite(band) and band > 0):
        raise GeometryError(f"the band must be a positive length, not {band}", remedy="give its half width")
    extent = float((coarse.grid.upper - coarse.grid.origin).max())
    if band > WIDEST * extent:
        raise GeometryError(
            f"the band, {band:g} on either side, is {WIDEST:g} times wider than the grid, {extent:g}",
            remedy="leave it out",
            element="band",
        )
    surface = coarse.surface
    if surface is None:
        raise GeometryError("the coarse field does not know its surface", remedy="measure to a solid")
    features = surface.features
    telling = np.ones(len(features.rows), dtype=bool) if surface.telling is None else surface.telling
    telling = telling | _closed_parts(features)
    width = max(float(band), LEAST * float(grid.spacing.max()))
    asked = np.zeros_like(telling) if surface.asked is None else surface.asked & ~telling
    tree, ends = None, np.zeros((0, 3))
    if not surface.closed and len(features.rows):
        tree = FaceTree.of(features).tree
        ends, ahead = _ends(features, telling | asked, 0.5 * float(coarse.grid.spacing.max()))
        winding = WindingTree(features.corners.reshape(-1, 3, 3), tree)
        covered = winding.numbers(ends + BEYOND * float(grid.spacing.max()) * ahead) > COVERED * surface.share
        ends = ends[~covered]
    return BandPlan(grid, coarse, width, features, telling, ends, asked, surface.share, surface.closed, tree)


def _closed_parts(features: FaceFeatures) -> NDArray[np.bool_]:
    """(m,) whether a face is part of a surface without ends."""
    n = len(features.rows)
    if n == 0:
        return np.zeros(0, dtype=bool)
    rows, other = np.repeat(np.arange(n), 3), features.across.ravel()
    joined = other >= 0
    graph = scipy.sparse.coo_matrix((joined[joined], (rows[joined], other[joined])), shape=(n, n))
    count, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    is_open = np.bincount(label, weights=(features.across < 0).any(axis=1), minlength=count) > 0
    return np.asarray(~is_open[label])


def _ends(
    features: FaceFeatures, telling: NDArray[np.bool_], gap: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples, at most `gap` apart, of edges beyond which the surface does not go on, and of faces that do not tell.

    Beside each the direction in which its face would go on.
    """
    corners = features.corners.reshape(-1, 3, 3)
    face, side = np.nonzero((features.across < 0) | ~telling[:, None])
    start, stop = corners[face, side], corners[face, (side + 1) % 3]
    lengths = np.linalg.norm(stop - start, axis=1)
    counts = np.ceil(lengths / gap).astype(np.int64) + 1
    which = np.repeat(np.arange(len(counts)), counts)
    along = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) / np.maximum(counts[which] - 1, 1)
    places = start[which] + along[:, None] * (stop[which] - start[which])
    if not len(places):
        return np.zeros((0, 3)), np.zeros((0, 3))
    kept = np.unique(np.floor(places / gap).astype(np.int64), axis=0, return_index=True)[1]
    edge = which[kept]
    ahead = np.cross(stop[edge] - start[edge], features.face_normals[face[edge]])
    return places[kept], ahead / np.where(lengths > 0, lengths, 1.0)[edge, None]
