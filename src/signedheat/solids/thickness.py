"""Thickness of walls and width of gaps: diameters of the largest balls that touch a surface without crossing a wall.

At a point of the surface, that ball is tangent from within; its diameter is the local thickness there (Hildebrand &
Rüegsegger 1997). Only faces that point the other way count as walls, so that edges and rough faces do not make the ball
small. The ball through a point q is tangent at p if its diameter is |p − q|² / ((p − q) · n). The least of these is
found by Dinkelbach's method (1967), each step of which looks for the point nearest to the centre of a ball.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen, Ints
from ..compiled import compiled
from ..errors import SourceError, counted
from ..memory import refuse_beyond_memory
from ..mesh.box_tree import BOXES_PER_LEAF, BoxTree
from ..mesh.components import connected_components, sums_of
from ..mesh.edges import edge_table
from ..mesh.triangles import CREASE_ANGLE, area_vectors, corner_normals, cut_small, face_areas
from ..mesh.unit_vectors import unit
from ..mesh.welding import indexed
from ..packages import lazy_module
from ..parallel import in_chunks
from ..search.face_tree import FaceTree
from ..search.nearest_triangles import foot_on_triangle, weights_in
from ..shapes.kinds import ShapeLike
from ..surfaces.local_triangulations import OPPOSITE_SIDES
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import percentages, positive_number, public_call, whole_number
from .completion import complete
from .mesh_orientation import Mesh
from .sampling import evenly_on

pictures: Any = lazy_module("signedheat.view.surface_pictures", "pictures")

WIDTH_QUANTILE = 0.01
"""Quantile of the widths of walls, or gaps, that is reported as that of thin walls and narrow gaps."""
COINCIDENT_FACES = 1e-6
"""Faces at most this far apart coincide (in single precision), relative to the largest coordinate."""
ROUND_WALL = 4e-3
"""Walls may reach into a ball by this share of its squared radius in the first round of the search, since round walls
are made of flat faces."""
FINER = 1e-2
"""Factor by which that share shrinks in each further round, which only searches around the point that the ball
touches."""
SETTLED = 1e-12
"""The search ends once that share is as small as this, which flat walls need."""


@dataclass(frozen=True)
class Widths:
    """Widths of walls and gaps of a shape, in its units, measured at points spread evenly over it.

    Those of walls, or of gaps, are None if no two faces are opposite each other in that way.
    """

    wall: float | None  # first percentile of the thickness of walls
    gap: float | None  # first percentile of the width of gaps
    typical_wall: float | None  # medians
    typical_gap: float | None
    thinnest: float | None  # least thickness of all
    thinnest_place: tuple[float, ...] | None  # (3,) point where it is

    @property
    def spacing(self) -> float | None:
        """Spacing of a grid that has two cells across thin walls and narrow gaps; None if there are none."""
        widths = [width for width in (self.wall, self.gap) if width is not None]
        return 0.5 * min(widths) if widths else None


@dataclass(frozen=True, eq=False)
class Thickness(Frozen):
    """A map of the thickness of a solid: a value at the middle of each face.

    Attributes
    ----------
    mesh : TriangleMesh
        The boundary of the solid, facing outwards; large faces are cut.
    values : (m,) float
        Thickness behind each face, in the units of the solid; NaN where no wall is opposite.
    origins : (m,) int
        Face of the shape that each face is part of; −1 in the completion.

    See Also
    --------
    wall_thickness : How thick walls are.

    Examples
    --------
    >>> import signedheat as sh
    >>> walls = sh.wall_thickness(sh.samples.sphere(3))
    >>> walls.percentiles([0, 50, 100]).round(1).tolist(), walls.below(1.5)
    ([2.0, 2.0, 2.0], 0.0)
    """

    mesh: TriangleMesh
    values: Floats
    origins: Ints

    @cached_property
    def _from_thin_to_thick(self) -> Ints:
        """(k,) faces whose thickness is known, the thinnest first."""
        if np.isnan(self.values).all():
            raise SourceError("no wall has two opposite sides", remedy="measure a solid", element="thickness")
        return np.argsort(self.values, kind="stable")[: np.count_nonzero(~np.isnan(self.values))]  # NaN comes last

    @cached_property
    def thinnest(self) -> tuple[float, Floats]:
        """The least thickness, in the units of the solid, and the middle (3,) of the face where it is."""
        face = int(self._from_thin_to_thick[0])
        return float(self.values[face]), self.mesh.vertices[self.mesh.faces[face]].mean(axis=0)

    def below(self, least: float) -> float:
        """Compute the share of the area where walls are thinner than a length.

        Parameters
        ----------
        least : float
            A length in the units of the solid, such as the thinnest wall that a printer makes.

        Returns
        -------
        float
            Share of the area, from 0 to 1.

        See Also
        --------
        results.Thickness.percentiles : Percentiles of the thickness.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.wall_thickness(sh.samples.sphere(2)).below(3.0)
        1.0
        """
        areas = self.mesh.face_areas
        return float(areas[self.values < positive_number(least, "least")].sum() / areas.sum())

    def percentiles(self, percents: ArrayLike) -> Floats:
        """Compute percentiles of the thickness, by area.

        Parameters
        ----------
        percents : (k,) float
            Percentages from 0 to 100.

        Returns
        -------
        (k,) float
            Thickness that this percentage of the area does not exceed, in the units of the solid.

        Raises
        ------
        SourceError
            If no wall has two opposite sides, as in a tetrahedron.

        See Also
        --------
        results.Thickness.below : The share thinner than a length.

        Examples
        --------
        >>> import signedheat as sh
        >>> sh.wall_thickness(sh.samples.torus(major=1.0, minor=0.4)).percentiles([50]).round(1).tolist()
        [0.8]
        """
        order = self._from_thin_to_thick
        ends = np.cumsum(self.mesh.face_areas[order])
        ranks = np.searchsorted(ends, 0.01 * percentages(percents) * ends[-1])
        return self.values[order[np.minimum(ranks, len(order) - 1)]]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the map, in the units of the solid, to a file in the format given by its extension.

        Parameters
        ----------
        path : str or path
            ``.ply`` for the faces in colours, thin ones red, with a property ``thickness``. ``.npz`` for arrays
            ``vertices`` and ``faces``, and for each face its ``thickness``, NaN where no wall is opposite, and in
            ``origins`` the face of the given shape that it is part of, −1 in the completion. ``.png``, ``.pdf``,
            ``.svg`` or ``.jpg`` for a picture of the outside and of where it is thinnest.

        Raises
        ------
        FileFormatError
            If the format is unknown, or the file cannot be written.

        See Also
        --------
        wall_thickness : Measure the thickness of walls.

        Examples
        --------
        >>> import tempfile
        >>> import signedheat as sh
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     sh.wall_thickness(sh.samples.sphere(2)).save(f"{folder}/walls.ply")
        """
        pictures.save_thickness(self, path)

    def __repr__(self) -> str:
        if np.isnan(self.values).all():
            return f"Thickness({counted(len(self.values), 'face')}, none opposite another)"
        low, median, high = self.percentiles([0, 50, 100])
        return f"Thickness({counted(len(self.values), 'face')}, {low:.3g} to {high:.3g}, median {median:.3g})"


@public_call
def wall_thickness(shape: ShapeLike, *, resolution: int = 64) -> Thickness:
    """Measure the thickness of a solid behind each of its faces.

    It is the diameter of the largest ball that touches the face from within and crosses no wall: the thickness of slabs
    and tubes, the diameter of balls and rods. Walls are faces whose normals are more than 120° apart, so that a box has
    its whole width up to its edges, but a wedge of less than 60° becomes thinner towards its edge.

    Parameters
    ----------
    shape : shape or Solid
        A shape, broken or not; completed here unless it is a solid.
    resolution : int
        Number of squares along the longest side of the box around the solid; faces larger than half a square are cut.

    Returns
    -------
    Thickness
        The faces and their values, in the units of the shape.

    Raises
    ------
    SourceError
        If the shape bounds nothing.
    MemoryLimitError
        If so many faces do not fit in memory.

    See Also
    --------
    results.Thickness : Thickness on each face.
    morphology.thicken : Make a solid of an open sheet.
    deviation : Compare a scan with a part.

    Examples
    --------
    >>> from signedheat import samples
    >>> plate = samples.union(samples.sphere(3), samples.sphere(3, radius=0.2, center=(3.0, 0.0, 0.0)))
    >>> least, point = wall_thickness(plate).thinnest
    >>> round(least, 1), round(float(point[0])) in (3, 4)
    (0.4, True)
    """
    parts = whole_number(resolution, "resolution", 1)
    solid = complete(shape)
    if not solid.bounding.any():
        raise SourceError("the shape is a sheet, which has no thickness", remedy="thicken it, or close it")
    largest = float(np.ptp(solid.bounds, axis=0).max()) / parts
    halvings = np.log2(np.maximum(2.0 * face_areas(solid.outward), np.finfo(float).tiny)) - 2.0 * np.log2(largest)
    pieces = int(np.exp2(np.clip(np.ceil(halvings), 0.0, 100.0)).sum())
    refuse_beyond_memory(
        f"thickness at {pieces:,} centres",
        pieces,
        lambda n: 400.0 * n,  # measured on a ball cut into 240,000 pieces
        lambda fits: f"lower the resolution from {parts} to {int(parts * np.sqrt(fits / pieces))}",
    )
    triangles, owners = cut_small(solid.outward, lambda pieces: face_areas(pieces) <= 0.5 * largest * largest)
    centres = triangles.mean(axis=1)
    walls = solid.bounding[solid.features.ids]
    facing = np.where(walls[:, None], solid.features.face_normals, 0.0)
    values, _ = _diameters(solid.tree, facing, centres, _normals_at(solid.outward, owners, centres))
    return Thickness(TriangleMesh(*indexed(triangles)), values, solid.origins[solid.bounding][owners])


def widths(shape: Mesh) -> Widths:
    """Measure widths of walls and gaps at points spread evenly over a shape; faces with a common corner have none."""
    mesh, exponent = shape.triangulation, int(np.frexp(np.abs(shape.bounds).max())[1])
    triangles = np.ldexp(mesh.vertices, -exponent)[mesh.faces]  # so that no product leaves the range of numbers
    size = float(np.ldexp(1.0, exponent))
    triangles = triangles[face_areas(triangles) > 0]
    if not len(triangles):
        return Widths(None, None, None, None, None, None)
    points, faces = evenly_on(triangles, 10_000, np.random.default_rng(0))
    normals, tree = _normals_at(triangles, faces, points), FaceTree.of_triangles(triangles)
    facing = tree.features.face_normals
    corner_ids, ids = indexed(triangles)[1], tree.features.ids
    measured = []
    for side in (1.0, -1.0):
        diameters, touched = _diameters(tree, side * facing, points, side * normals)
        folds = (corner_ids[faces][:, :, None] == corner_ids[ids[touched]][:, None, :]).any(axis=(1, 2))
        measured.append(np.where(folds, np.nan, size * diameters))
    walls, gaps = measured
    thinnest = None if np.isnan(walls).all() else int(np.nanargmin(walls))
    return Widths(
        wall=_quantile(walls, WIDTH_QUANTILE),
        gap=_quantile(gaps, WIDTH_QUANTILE),
        typical_wall=_quantile(walls, 0.5),
        typical_gap=_quantile(gaps, 0.5),
        thinnest=None if thinnest is None else float(walls[thinnest]),
        thinnest_place=None if thinnest is None else tuple((size * points[thinnest]).tolist()),
    )


def _diameters(tree: FaceTree, facing: Floats, points: Floats, normals: Floats) -> tuple[Floats, Ints]:
    """(n,) diameter of the largest ball behind each of (n, 3) points, or NaN, and (n,) the face that it touches.

    `normals` are (n, 3) unit normals at the points, and `facing` (m, 3) those of the faces of the tree, or 0 for faces
    that are no walls.
    """
    lower, upper = tree.tree.bounds[1, :3], tree.tree.bounds[1, 3:]
    extent = float(np.linalg.norm(upper - lower))
    least = COINCIDENT_FACES * float(np.abs(tree.tree.bounds[1]).max())

    # least and greatest components of the normals of all faces below each node: a tree of their "positions"
    normal_bounds = BoxTree.in_order(facing, facing, tree.tree.items[: len(facing)]).bounds

    def measured(rays: Floats) -> tuple[Floats, Ints]:
        """Measure the same for (k, 6) points and their normals."""
        diameters, touched = np.full(len(rays), extent), np.zeros(len(rays), dtype=np.int64)
        rows, boxes = tree.features.rows, tree.tree
        _descend(rows, facing, boxes.bounds, tree.discs, normal_bounds, boxes.items, rays, least, diameters, touched)
        return diameters, touched

    diameters, touched = in_chunks(measured, np.column_stack([points, normals]))
    return np.where(diameters < extent, diameters, np.nan), touched


def _normals_at(triangles: Floats, faces: Ints, points: Floats) -> Floats:
    """(n, 3) unit normals at (n, 3) points on (n,) faces of triangles, interpolated from mean normals at corners.

    Unlike them, face normals would tilt balls and make them too small.
    """
    ids = indexed(triangles)[1]
    flat, pairs = unit(area_vectors(triangles)), edge_table(ids).pairs
    pairs = pairs[np.einsum("ij,ij->i", *flat[pairs // 3].swapaxes(0, 1)) > np.cos(CREASE_ANGLE)]
    following = np.roll(np.arange(ids.size).reshape(-1, 3), -1, axis=1).ravel()
    # corners at one vertex are in one fan if their faces are connected by edges that are not sharp
    first, second = pairs.T
    fans = connected_components(ids.size, np.append(first, following[first]), np.append(following[second], second))
    corners = unit(sums_of(corner_normals(triangles), fans, ids.size))[fans].reshape(-1, 3, 3)
    return unit(np.einsum("nk,nki->ni", weights_in(triangles[faces], points), corners[faces]))


def _quantile(widths: Floats, share: float) -> float | None:
    """Return a quantile of the widths that are not NaN; None if there are none."""
    known = np.sort(widths[~np.isnan(widths)])
    return float(known[int(share * len(known))]) if len(known) else None


@compiled
def _descend(
    rows: Floats,
    facing: Floats,
    bounds: Floats,
    discs: Floats,
    normal_bounds: Floats,
    items: Ints,
    points: Floats,
    coincident: float,
    out: Floats,
    touched: Ints,
) -> None:
    """Shrink the diameters in `out` at (n, 6) points and their normals until no wall reaches into a ball.

    `touched` becomes the face that each ball touches. `rows` are those of `FaceFeatures`, `facing` the (m, 3) normals
    of walls, and `bounds`, `discs` and `items` those of a search tree; `normal_bounds`, (2 · leaves, 6), are the bounds
    of the normals below its nodes. Points nearer than `coincident` to a face coincide with it.

    In the first round walls may reach in by `ROUND_WALL`, since a ball that fits a round wall touches all of it. In
    each further round, near the point that the ball touches, they may do so by `FINER` times as much. In the body, m is
    the centre of a ball, t the point that it touches so far, and q that which a smaller one touches.
    """
    leaves, stack = len(bounds) // 2, np.empty(66, dtype=np.int64)
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        nx, ny, nz = points[p, 3], points[p, 4], points[p, 5]
        diameter, tx, ty, tz, reach, slack = out[p], x, y, z, np.inf, ROUND_WALL
        while slack > SETTLED:
            stack[0], depth = 1, 1
            while depth > 0:
                # leave out nodes that the ball does not reach, or only farther than `reach` from where it touches
                depth -= 1
                node = stack[depth]
                radius = 0.5 * diameter
                mx, my, mz = x - radius * nx, y - radius * ny, z - radius * nz
                limit = radius * radius * (1.0 - slack)
                if not _square(bounds, node, mx, my, mz) < limit or _square(bounds, node, tx, ty, tz) > reach:
                    continue
                # nodes whose faces are no walls, since all normals are too near that of the point
                least_cosine = 0.0
                for k, along in ((0, nx), (1, ny), (2, nz)):
                    least_cosine += min(along * normal_bounds[node, k], along * normal_bounds[node, 3 + k])
                if least_cosine >= OPPOSITE_SIDES:
                    continue
                # and nodes whose disc the ball does not reach
                if discs[node, 7] >= 0.0:
                    dx, dy, dz = mx - discs[node, 0], my - discs[node, 1], mz - discs[node, 2]
                    along = dx * discs[node, 3] + dy * discs[node, 4] + dz * discs[node, 5]
                    height = max(abs(along) - discs[node, 7], 0.0)
                    across = np.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
                    outside = max(across - discs[node, 6], 0.0)
                    if not height * height + outside * outside < limit:
                        continue
                if node < leaves:  # visit the child nearer to the point first
                    first = _square(bounds, 2 * node, x, y, z) <= _square(bounds, 2 * node + 1, x, y, z)
                    stack[depth] = 2 * node + 1 if first else 2 * node
                    stack[depth + 1] = stack[depth] ^ 1
                    depth += 2
                    continue
                for item in range((node - leaves) * BOXES_PER_LEAF, (node - leaves + 1) * BOXES_PER_LEAF):
                    f = items[item]
                    if f < 0 or not facing[f, 0] * nx + facing[f, 1] * ny + facing[f, 2] * nz < OPPOSITE_SIDES:
                        continue
                    # shrink the ball to the one through the point of the face nearest to its centre, until it is empty
                    best, qx, qy, qz = diameter, tx, ty, tz
                    for _ in range(60):
                        radius = 0.5 * best
                        mx, my, mz = x - radius * nx, y - radius * ny, z - radius * nz
                        square, _, fx, fy, fz = foot_on_triangle(rows, f, mx, my, mz)
                        if not square < radius * radius * (1.0 - SETTLED):
                            break
                        dx, dy, dz = x - fx, y - fy, z - fz
                        ahead, square = dx * nx + dy * ny + dz * nz, dx * dx + dy * dy + dz * dz
                        if not square > coincident * coincident or not ahead > 0.0:
                            best = diameter
                            break
                        if not square / ahead < best:
                            break
                        best, qx, qy, qz = square / ahead, fx, fy, fz
                    if best < diameter:
                        diameter, tx, ty, tz, touched[p] = best, qx, qy, qz, f
            # walls that reach in by less are searched for near the point that the ball touches
            reach, slack = 4.0 * slack * diameter * diameter, slack * FINER
        out[p] = diameter


@compiled
def _square(bounds: Floats, node: int, x: float, y: float, z: float) -> float:
    """Squared distance of a point to the box of a node of the tree; infinite if the node is empty."""
    dx = max(bounds[node, 0] - x, x - bounds[node, 3], 0.0)
    dy = max(bounds[node, 1] - y, y - bounds[node, 4], 0.0)
    dz = max(bounds[node, 2] - z, z - bounds[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz
