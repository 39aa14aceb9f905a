"""Signed distance to drawings in the plane, made of filled outlines and of strokes whose gaps heat completes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Frozen, Ints
from ..constraints import Constraint, EachComponent, LevelValues
from ..diagnostics import Diagnostics, Note
from ..errors import ConstraintError, InexactWarning, UnsupportedTypeError, warn_user
from ..fields.field import Field
from ..fields.solid_queries import Closest
from ..grids.grid import RESOLUTION, Grid
from ..grids.marching import values_at_walls
from ..grids.polyline import Polyline
from ..jobs import Stopwatch, bound_progress, part_of_work, run_cancellable
from ..mesh.components import sums_of
from ..mesh.polylines import FillRule, without_seams
from ..mesh.triangles import AREA_ROUNDING
from ..mesh.unit_vectors import unit
from ..mesh.welding import ONE_PLACE
from ..search.face_tree import EQUALLY_NEAR, FaceTree
from ..shapes.area_elements import bounds_around
from ..shapes.foreign import as_list
from ..shapes.kinds import Sources
from ..solver import SignedHeatSolver
from ..surfaces.extrapolation import Diffusion
from ..surfaces.source_segments import NEARLY_CLOSED
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import SMALLEST_EXTENT, flag, query_points, shaped
from .curve_distance import CurvesTaken, distance_to_pieces
from .gaps import Gaps
from .outlines import WHOLE, chains, enclosed, outlines_filled, segments_of_lines, turned_by_depth
from .resolution import on_resolving_triangles

FINEST_DRAWING = 1024
"""Largest number of cells along a drawing with which it is completed, however fine the grid is. Three broken drawings
differ by 0.010 of their radius between 128 and 512 cells, by 0.007 between 128 and 256."""
NARROW_GAP = 1 / 32
"""Width of a gap, relative to the length of the outline or of the shorter line at it, up to which it is closed straight
and the outline is filled. Of gaps in circles and in stars, straight lines are nearer to what is gone than heat is up to
1/16 of the length: 2 to 30 times up to 1/64, and about as near from 1/32."""
FAR_SHARE = 0.05
"""Share of the border of the grid that must be on either side for lines that nearly close to bound nothing. It is 0.03
or less in 86 of 88 random drawings that are right."""
STROKE_NODES = 96
"""Number of nodes along the longest side of the triangle mesh on which strokes are oriented. Of 150 drawings none is
wrong without a warning and 7 are right with one; halved 0 and 5, doubled 0 and 6."""
LEAST_SLOPE = 1e-6
"""Least component along the normal, of the unit vector from the nearest place to a point, for which the normal decides
the side of the point. Below it rays decide. At corners the normal is the sum of the unit normals. Of 13,440 points
beside spikes 355 are wrong, from 1e-6 to 0.1, all at spikes of 1e-8 or less. At 0 1,744 are."""
SIDE_CELLS = 1.5
"""Distance from a line, in cells, below which the line itself decides the side; beyond it the sign of φ does. φ is
smooth over about a cell."""


def distance_to_lines(
    lines: Sources,
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    constraint: Constraint | None = None,
    diffusion: Diffusion | None = None,
    fill: FillRule = "nonzero",
    as_oriented: bool = False,
    every_piece: bool = False,
) -> Field[Grid]:
    """Compute the signed distance to polylines in the plane, with the options of `signed_distance`.

    Closed outlines are replaced by the boundary of the region that they fill. Strokes, if there are any, are flipped so
    that they bound something together. Then the signed heat method decides the sides on a grid around the whole
    drawing, and closes gaps. The bounded region is inside, whatever the orientation of its boundary. If the grid has
    other than two dimensions, the result is φ of `SignedHeatSolver`.
    """
    if isinstance(constraint, EachComponent | LevelValues):
        raise ConstraintError(
            f"distance to lines is zero on all of them, which {constraint!r} denies",
            remedy="use SignedHeatSolver.distance",
        )
    listed: list[Any] = as_list(lines)
    if domain is None:
        domain = Grid.around(bounds_around(listed), resolution, padding, spacing)
    as_oriented, every_piece = flag(as_oriented, "as_oriented"), flag(every_piece, "every_piece")
    if domain.dimension != 2:
        return SignedHeatSolver(domain, diffusion, bound_progress()).distance(listed, constraint)
    notes: list[Note] = []
    across = np.empty((0, 2, 2))
    is_drawing = not as_oriented and all(isinstance(line, Polyline) for line in listed)
    if is_drawing:
        listed, numbers, filled, across = outlines_filled(listed, fill, NARROW_GAP)
        notes += [filled] if filled else []
        if filled and all(line.closed for line in listed):
            drawing = Drawing(*apart_from(without_seams(segments_of_lines(listed)), across))
            return _field_of(drawing, domain, Diagnostics(notes=tuple(notes)))
        with part_of_work(0.0, 0.4):
            listed, taken, doubt = strokes_that_agree(as_outlines(listed), numbers, every_piece)
        notes += [taken] if taken else []
    solver = SignedHeatSolver(_grid_around(listed, domain), diffusion, bound_progress())
    with part_of_work(0.4, 0.8):
        phi = cast("Field[Grid[Literal[2]]]", solver.distance(listed, constraint))
    if is_drawing:
        closing = closing_lines(listed)
        if closing and bulges(phi, listed, closing):
            with part_of_work(0.4, 0.8):
                phi = cast("Field[Grid[Literal[2]]]", solver.distance([*listed, *closing], constraint))
        beyond = values_at_walls(phi.values) < 0
        if closing and FAR_SHARE < beyond.mean() < 1 - FAR_SHARE and not doubt:
            doubt = (
                "lines that nearly close bound nothing, since some of them run against the others: which side is "
                "which is a guess. Draw what is missing, or flip lines that run the wrong way"
            )
        if doubt:
            warn_user(doubt, InexactWarning)
        if beyond.all() or (closing and beyond.mean() > 0.5):  # what is bounded is inside, whichever way it runs
            listed, phi = [line.reversed() for line in listed], phi.with_values(-phi.values)
    segments = segments_of_lines([line for line in listed if isinstance(line, Polyline)])
    drawing = Drawing.completed(*apart_from(segments, across), phi)
    diagnostics = replace(phi.diagnostics, notes=(*phi.diagnostics.notes, *notes))
    return _field_of(drawing, domain, diagnostics)


def unsigned_distance_to_lines(
    lines: Sources,
    domain: Grid | None = None,
    *,
    resolution: int = 128,
    spacing: ArrayLike | None = None,
    padding: float | None = None,
    completion: Literal["none"] = "none",
) -> Field[Grid]:
    """Compute the unsigned distance to polylines in the plane, without completion; see `signed_distance`."""
    listed: list[Any] = as_list(lines)
    for number, line in enumerate(listed):
        if not isinstance(line, Polyline):
            raise UnsupportedTypeError(
                f"unsigned distance in the plane is to polylines, not to a {type(line).__name__}",
                remedy="leave out completion",
                element=f"source {number}",
            )
    if domain is None:
        domain = Grid.around(bounds_around(listed), resolution, padding, spacing)
    return _field_of(Drawing(segments_of_lines(listed), has_sides=False), domain, Diagnostics())


def _field_of(drawing: Drawing, grid: Grid, diagnostics: Diagnostics) -> Field[Grid]:
    """Return the distance to a drawing at the nodes of a grid, as a field that holds the drawing."""
    watch = Stopwatch(1)
    with part_of_work(0.8, 1.0), watch("measure"):
        values = run_cancellable(lambda: drawing.distance(grid.points.reshape(-1, 2)).reshape(grid.shape))
    timings = {**diagnostics.timings, **watch.seconds}
    return Field(grid, values, replace(diagnostics, timings=timings), solid=drawing)


def as_outlines(lines: Sequence[Polyline]) -> list[Polyline]:
    """Orient open lines that nearly close together as outlines, and closed ones inside them as holes.

    `turned_by_depth` says how. Lines in chains that do not nearly close are returned as they are.
    """
    nearly = [
        chain
        for chain in chains({k: line for k, line in enumerate(lines) if not line.closed}, WHOLE)
        if chain.gaps[-1] < NEARLY_CLOSED * (chain.outline.length - chain.gaps[-1])
        and chain.encloses(float(chain.gaps[:-1].max(initial=0.0)))
    ]
    result = list(lines)
    closed = [k for k, line in enumerate(lines) if line.closed]
    turns, holes = turned_by_depth(nearly, [[lines[k] for k in closed]])
    for chain, turn in zip(nearly, turns, strict=True):
        for k in np.array(chain.members)[chain.backwards != turn].tolist():
            result[k] = result[k].reversed()
    for k, hole in zip(closed, holes, strict=True):
        if hole:
            result[k] = result[k].reversed()
    return result


def closing_lines(lines: Sequence[Polyline]) -> list[Polyline]:
    """Return straight lines across the gaps of curves that nearly close, from the end of each stroke to the next."""
    strokes = [line for line in lines if not line.closed]
    return [Polyline(line) for line in Gaps.of([line.points for line in strokes]).lines] if strokes else []


def bulges(phi: Field[Grid[Literal[2]]], lines: Sequence[Polyline], closing: Sequence[Polyline]) -> bool:
    """Whether the zero set of φ fails to close the gaps of lines by short lines.

    It fails if it runs out of the grid, or if a point of it is farther from the lines and the straight `closing` lines
    than the longest of the latter.
    """
    beyond = values_at_walls(phi.values) < 0
    if beyond.any() and not beyond.all():
        return True
    away = tree_of(segments_of_lines([*lines, *closing])).distances(_in_space(segments_of_lines(phi.contour())[:, 0]))
    return bool(away.max() > max(line.length for line in closing))


def _grid_around(sources: Sequence[Any], asked: Grid) -> Grid:
    """Return a grid around all sources on which heat flows; its cells are about as small as those of the grid `asked`.

    There are at least `RESOLUTION` and at most `FINEST_DRAWING` cells along the longest side of the sources.
    """
    bounds = bounds_around(sources)
    size = float(np.ptp(bounds, axis=0).max())
    if size == 0:
        return asked
    return Grid.around(bounds, spacing=float(np.clip(asked.spacing.min(), size / FINEST_DRAWING, size / RESOLUTION)))


def strokes_that_agree(
    lines: Sequence[Polyline], numbers: Sequence[int], every_piece: bool
) -> tuple[list[Polyline], CurvesTaken | None, str]:
    """Flip strokes so that they bound something together, and leave out those that do not.

    `distance_to_pieces` decides that on a triangle mesh of a rectangle around the lines. Also returns its note, None if
    all lines are used as given, and its warning, "" if the result is no guess. Both name the lines by `numbers`.
    """
    if all(line.closed for line in lines):
        return list(lines), None, ""
    bounds = bounds_around(lines)
    size = float(np.ptp(bounds, axis=0).max())
    sheet = _triangles_around((bounds - bounds[0]) / size)
    curves = [sheet.polyline(np.pad((line.points - bounds[0]) / size, ((0, 0), (0, 1))), line.closed) for line in lines]
    field, _, doubt = on_resolving_triangles(
        lambda solver: distance_to_pieces(solver, curves, None, every_piece, np.array(numbers)),
        SignedHeatSolver(sheet, 1.0),
        curves,
    )
    note = field.diagnostics.note(CurvesTaken)
    if note is None:
        return list(lines), None, doubt
    turned, left_out = set(note.turned), set(note.left_out)
    used = [(k, line) for k, line in zip(numbers, lines, strict=True) if k not in left_out]
    return [line.reversed() if k in turned else line for k, line in used], note, doubt


def _triangles_around(bounds: Floats) -> TriangleMesh:
    """Return a triangle mesh of a rectangle around a box, (2, 2) corners, made of squares with one diagonal each."""
    nodes = Grid.around(bounds, STROKE_NODES)
    index = np.arange(nodes.n_nodes).reshape(nodes.shape)
    a, b, c, d = (ids.ravel() for ids in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    rising = np.indices(index[1:, 1:].shape).sum(axis=0).ravel() % 2 == 0
    first = np.where(rising, [a, b, c], [a, b, d])
    second = np.where(rising, [a, c, d], [b, c, d])
    return TriangleMesh(np.pad(nodes.points.reshape(-1, 2), ((0, 0), (0, 1))), np.hstack([first, second]).T)


def apart_from(segments: Floats, closing: Floats) -> tuple[Floats, Floats]:
    """Divide (m, 2, 2) segments into those that were given, and those that run along (k, 2, 2) `closing` ones."""
    if not len(closing):
        return segments, closing
    rounding = AREA_ROUNDING * float(np.ptp(segments.reshape(-1, 2), axis=0).max())
    runs_along = tree_of(closing).distances(_in_space(segments.mean(axis=1))) <= rounding
    return segments[~runs_along], segments[runs_along]


@dataclass(frozen=True, eq=False)
class Drawing(Frozen):
    """Segments in the plane to which signed distance can be measured exactly at any point."""

    lines: Floats  # (m, 2, 2) ends of the given segments; distance is positive to their left
    # (k, 2, 2) ends of the segments that close gaps; with the lines, they form closed outlines if there is no φ
    completion: Floats = field(default_factory=lambda: np.empty((0, 2, 2)))
    # its sign decides the side farther than `SIDE_CELLS` from lines. Without it, the number of outlines around does
    phi: Field[Grid[Literal[2]]] | None = None
    has_sides: bool = True  # whether distance is negative on one side of lines

    @classmethod
    def completed(cls, lines: Floats, across: Floats, phi: Field[Grid[Literal[2]]]) -> Drawing:
        """Make a drawing of (m, 2, 2) segments, completed by those `across` gaps, (k, 2, 2), and by the zero set of φ.

        Of the zero set, the parts that are far from all of these count.
        """
        crosses = bool((phi.values < 0).any() and (phi.values >= 0).any())
        zero_set = segments_of_lines(phi.contour()) if crosses else np.empty((0, 2, 2))
        known = np.concatenate([lines, across])
        if len(known) and len(zero_set):
            away = tree_of(known).distances(_in_space(zero_set.mean(axis=1)))
            zero_set = zero_set[away > SIDE_CELLS * float(phi.domain.spacing.max())]
        return cls(lines, np.concatenate([across, zero_set]), phi)

    @property
    def triangles(self) -> Floats:
        """Given segments and those of the completion as m + k triangles without area, (m + k, 3, 2) corners."""
        return self._segments[:, [0, 1, 1]]

    @cached_property
    def _segments(self) -> Floats:
        """Given segments, then those of the completion, (m + k, 2, 2)."""
        return np.concatenate([self.lines, self.completion])

    @cached_property
    def _tree(self) -> FaceTree:
        return tree_of(self._segments)

    @cached_property
    def _corners(self) -> tuple[Ints, Floats, Ints, Floats]:
        """Return the c distinct ends of segments, called corners, and what meets there.

        These are (m + k, 2) the corner at both ends of each segment, (c, 2) the sum of the unit normals of the segments
        at each corner, (c,) the number of these segments, and (c,) the length of the shortest of them.
        """
        along = self._segments[:, 1] - self._segments[:, 0]
        normals = unit(np.stack([-along[:, 1], along[:, 0]], axis=1))
        corners, places = np.unique(self._segments.reshape(-1, 2), axis=0, return_inverse=True)
        shortest = np.full(len(corners), np.inf)
        np.minimum.at(shortest, places.ravel(), np.repeat(np.linalg.norm(along, axis=1), 2))
        return (
            places.reshape(-1, 2),
            sums_of(np.repeat(normals, 2, axis=0), places.ravel(), len(corners)),
            np.bincount(places.ravel()),
            shortest,
        )

    def distance(self, points: ArrayLike) -> Floats:
        """Return (...) signed distances of (..., 2) points, negative inside and to the right of lines."""
        places, shape = query_points(points, 2)
        return shaped(self._closest(places)[0], shape)

    def inside(self, points: ArrayLike) -> Bools:
        """Return (...) bool, true where the signed distance of (..., 2) points is negative."""
        return self.distance(points) < 0

    def closest(self, points: ArrayLike) -> Closest:
        """Return the nearest points of the drawing for (..., 2) points, as `Solid.closest` does in space.

        In the result, faces are given segments, −1 on the completion, and barycentric weights are those of the two ends
        of the segment.
        """
        places, shape = query_points(points, 2)
        distances, nearest, segments = self._closest(places)
        ends = self._segments[segments]
        along, away = ends[:, 1] - ends[:, 0], places - nearest
        shares = ((nearest - ends[:, 0]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), SMALLEST_EXTENT)
        left = np.stack([-along[:, 1], along[:, 0]], axis=1)
        gradients = unit(np.where((distances != 0)[:, None], np.sign(distances)[:, None] * away, left))
        given = segments < len(self.lines)
        results = (
            distances,
            nearest,
            np.where(given, segments, -1),
            np.stack([1 - shares, shares], axis=1),
            gradients,
            given.astype(np.float32),
        )
        return Closest(*(shaped(result, shape) for result in results))

    def _closest(self, points: Floats) -> tuple[Floats, Floats, Ints]:
        """Return (n,) signed distances of (n, 2) points, the (n, 2) nearest points, and the segments of these, (n,)."""
        found = self._tree.search(_in_space(points))
        nearest, places = self._tree.features.ids[found.faces], found.places[:, :2]
        if not self.has_sides:
            return found.distances, places, nearest
        on_line = np.ones(len(points), dtype=bool)
        sides = np.ones(len(points)) if self.phi is None else np.where(self.phi.interpolate(points) < 0, -1.0, 1.0)
        if self.phi is not None:
            on_line = nearest < len(self.lines)
            on_line &= found.distances < SIDE_CELLS * float(self.phi.domain.spacing.max())
        sides[on_line] = self._sides(points[on_line], places[on_line], nearest[on_line])
        return sides * found.distances, places, nearest

    def _sides(self, points: Floats, places: Floats, nearest: Ints) -> Floats:
        """Return (n,) 1 for points to the left of the nearest segment, −1 for points to its right.

        `places` are the nearest points, (n, 2), and `nearest` their segments, (n,). If that is an end of the segment,
        the sum of the normals of all segments there decides. Where this is unreliable and lines are closed outlines,
        the number of outlines around the point decides.
        """
        corners, sums, counts, shortest = self._corners
        ends = self._segments[nearest]
        along = ends[:, 1] - ends[:, 0]
        normals = unit(np.stack([-along[:, 1], along[:, 0]], axis=1))
        crowded = np.zeros(len(points), dtype=bool)
        away = np.linalg.norm(points - places, axis=1)
        # of the ends of a segment that is not longer than this, rounding decides which is nearer
        least = EQUALLY_NEAR * away + ONE_PLACE * np.spacing(np.abs(self._segments).max(initial=0.0))
        reach = np.maximum(1e-9 * np.linalg.norm(along, axis=1), least)
        for end in range(2):
            is_end = np.linalg.norm(places - ends[:, end], axis=1) <= reach
            corner = corners[nearest, end]
            normals = np.where(is_end[:, None], sums[corner], normals)
            crowded |= is_end & ((counts[corner] > 2) | (shortest[corner] <= least))
        heights = ((points - places) * normals).sum(axis=1)
        sides = np.where(heights < 0, -1.0, 1.0)
        crowded |= np.abs(heights) <= LEAST_SLOPE * away
        if self.phi is None and crowded.any():  # outlines touch, normals cancel at spikes, or corners are near
            sides[crowded] = np.where(enclosed(self._segments, points[crowded]), -1.0, 1.0)
        return sides


def _in_space(points: Floats) -> Floats:
    """Append z = 0 to (n, 2) points."""
    return np.pad(points, ((0, 0), (0, 1)))


def tree_of(segments: Floats) -> FaceTree:
    """Make a search tree for the nearest of m segments in the plane z = 0, with ends (m, 2, 2).

    Each segment is the side of a triangle that stands upright on the plane, so that the triangle's nearest point to a
    point in the plane lies on the segment.
    """
    a, b = segments.transpose(1, 0, 2)
    corners = np.pad(np.stack([a, b, (a + b) / 2], axis=1), ((0, 0), (0, 0), (0, 1)))
    corners[:, 2, 2] = np.linalg.norm(b - a, axis=1)
    return FaceTree.of_triangles(corners)
