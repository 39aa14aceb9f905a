"""Plane sections of shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Frozen, Ints
from ..errors import GeometryError, counted
from ..grids.polyline import Polyline
from ..mesh.components import numbered
from ..mesh.edges import edge_table
from ..mesh.polylines import assemble_polylines, filled_outlines
from ..mesh.surface_points import crossed_sides
from ..mesh.triangles import AREA_ROUNDING
from ..mesh.unit_vectors import ANGLE_ROUNDING, unit
from ..mesh.welding import indexed
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import numbers, refuse_extreme

PLANE_ROUNDING = 16.0
"""A vertex lies in a plane up to this distance, in units in the last place of the largest coordinate: the rounding of
coordinates and of their product with the normal. Of 120 rotated boxes that were cut along their sides, 15 are wrong
with 0.5, 2 with 1 and none with 2 or more."""


@dataclass(frozen=True, eq=False, repr=False)
class Section(Frozen):
    """The section of a shape by a plane.

    Coordinates in the plane are those of space along two perpendicular directions, so that parallel sections lie over
    each other. Across z they are x and y. In other planes the second one points as far upwards as it can, and they are
    right-handed as seen from the tip of the normal.

    Attributes
    ----------
    outlines : list of Polyline
        What bounds the inside, closed: counter-clockwise around it, and clockwise around holes.
    sheets : list of Polyline
        Where the plane crosses sheets, which bound nothing; open or closed.
    matrix : (4, 4) float
        Maps (x, y, 0, 1) of the plane to space.

    See Also
    --------
    Solid.section : Section of a solid by a plane, or by many parallel ones.
    to_shapely : The outlines as polygons with holes.
    io.write_polylines : Write the outlines to a drawing.
    """

    outlines: list[Polyline]
    sheets: list[Polyline]
    matrix: Floats

    @property
    def area(self) -> float:
        """Area of the inside, in square units."""
        return float(sum(line.signed_area for line in self.outlines))

    @property
    def in_space(self) -> list[Floats]:
        """List of the (n, 3) points in space of each outline, and then of each line on sheets."""
        return [line.points @ self.matrix[:3, :2].T + self.matrix[:3, 3] for line in (*self.outlines, *self.sheets)]

    def __repr__(self) -> str:
        sheets = f", {counted(len(self.sheets), 'line')} of sheets" if self.sheets else ""
        return f"Section({counted(len(self.outlines), 'outline')}, area {self.area:.4g}{sheets})"


class Plane(NamedTuple):
    """A plane in space."""

    origin: Floats  # (3,)
    axes: Floats  # (3, 3) the two directions of its coordinates, and its unit normal

    @classmethod
    def of(cls, origin: ArrayLike, normal: ArrayLike) -> Plane:
        """Make the plane through a point across a normal, or raise if they are not three finite numbers each."""
        point, direction = (numbers(value, name) for value, name in ((origin, "origin"), (normal, "normal")))
        for value, name in ((point, "origin"), (direction, "normal")):
            if value.shape != (3,) or not np.isfinite(value).all():
                raise GeometryError(f"the {name} of a plane has 3 finite numbers, not {value.tolist()}", element=name)
            refuse_extreme(value, value, name)
        if not direction.any():
            raise GeometryError("the normal of a plane has no length", remedy="give its direction", element="normal")
        up = unit(direction)
        level = np.array([-up[1], up[0], 0.0])
        across = unit(level) if np.abs(level).max() > ANGLE_ROUNDING else np.array([1.0, 0.0, 0.0])
        second = unit(np.cross(up, across))
        return cls(point, np.stack([np.cross(second, up), second, up]))

    def rounding(self, points: Floats) -> float:
        """Return the distance from the plane up to which (n, 3) points lie in it."""
        return PLANE_ROUNDING * 2.0**-53 * float(max(np.abs(points).max(), np.abs(self.origin).max()))


def section_levels(heights: ArrayLike | None) -> Floats:
    """Return heights as a (k,) array, or raise if they are not finite; None stands for the height 0."""
    levels = np.zeros(1) if heights is None else numbers(heights, "heights")
    if levels.ndim != 1 or not np.isfinite(levels).all():
        raise GeometryError(
            "heights are finite numbers, one for each plane", remedy="give a list of numbers", element="heights"
        )
    return levels


def sections(surface: TriangleMesh | None, others: Floats, plane: Plane, levels: Floats) -> list[Section]:
    """Cut a closed surface, and `others`, (m, 3, 3) triangles of sheets, by planes at (k,) levels above a plane."""
    outlines: list[list[Floats]] = [[] for _ in levels]
    if surface is not None:
        crossed = Crossed.of(surface.vertices, surface.faces, plane, levels)
        outlines = crossed.lines(above=True, directed=True)[0]
        for k in np.unique(crossed.flat):  # what is above the plane counts, too
            beyond = crossed.lines(above=False, directed=True)[0][k]
            outlines[k] = [line[::-1] for line in filled_outlines([*outlines[k], *beyond], "nonzero")]
    open_lines: list[list[Floats]] = [[] for _ in levels]
    closed_lines: list[list[Floats]] = [[] for _ in levels]
    if len(others):
        sheets = Crossed.of(*indexed(others), plane, levels)
        closed_lines, open_lines = sheets.lines(above=True, directed=False)
    sections = []
    for k in range(len(levels)):
        matrix = np.eye(4)
        matrix[:3, :3] = plane.axes.T
        matrix[:3, 3] = (plane.origin @ plane.axes[2] + levels[k]) * plane.axes[2]
        loops = [Polyline(points, closed=True) for points in outlines[k] if _has_area(points)]
        lines = [Polyline(points, closed=True) for points in closed_lines[k] if np.ptp(points, axis=0).any()]
        lines += [Polyline(points) for points in open_lines[k] if np.ptp(points, axis=0).any()]
        sections.append(Section(loops, lines, matrix))
    return sections


class Crossed(NamedTuple):
    """Triangles and the parallel planes that they meet; vertices in a plane up to rounding have the height 0."""

    points: Floats  # (n, 2) vertices in coordinates of the planes
    face_edges: Ints  # (m, 3)
    ends: Ints  # (e, 2) vertices of edges
    faces: Ints  # (p,) face of each pair of a face and a plane that meet
    planes: Ints  # (p,) plane of each pair
    corners: Floats  # (p, 3) heights of the corners of the face above the plane
    sides: Floats  # (p, 3, 2) the same for the ends of its sides, in the direction of `ends`
    n_planes: int

    @classmethod
    def of(cls, vertices: Floats, faces: Ints, plane: Plane, levels: Floats) -> Crossed:
        """Find which faces meet which of the planes at (k,) levels above `plane`."""
        table = edge_table(faces)
        heights = (vertices - plane.origin) @ plane.axes[2]
        slack = plane.rounding(vertices)
        order = np.argsort(levels, kind="stable")
        low, high = heights[faces].min(axis=1) - slack, heights[faces].max(axis=1) + slack
        first = np.searchsorted(levels[order], low)
        met, number = numbered(np.searchsorted(levels[order], high, side="right") - first)
        planes = order[first[met] + number]

        def above(corners: Ints) -> Floats:
            """Heights of corners, with one row for each pair of a face and a plane, above the plane of the pair."""
            away = heights[corners] - levels[planes].reshape(-1, *[1] * (corners.ndim - 1))
            return np.where(np.abs(away) <= slack, 0.0, away)

        sides = above(table.vertices[table.face_edges[met]])
        in_plane = vertices @ plane.axes[:2].T
        return cls(in_plane, table.face_edges, table.vertices, met, planes, above(faces[met]), sides, len(levels))

    @property
    def flat(self) -> Ints:
        """(f,) the plane of each face that lies in one."""
        return self.planes[(self.corners == 0).all(axis=1)]

    def lines(self, above: bool, directed: bool) -> tuple[list[list[Floats]], list[list[Floats]]]:
        """Return for each plane the closed and the open lines along which it meets faces, each as (n, 2) points.

        Vertices in a plane count as above it if `above`, and otherwise as below it. If `directed`, lines run so that
        the inside is to their left.
        """
        upper = self.corners >= 0 if above else self.corners > 0
        pairs, crossed = crossed_sides(upper, np.ones(len(upper), dtype=bool))
        edges = self.face_edges[self.faces[pairs][:, None], crossed]
        low, high = np.moveaxis(np.take_along_axis(self.sides[pairs], crossed[:, :, None], axis=1), -1, 0)
        along = (low / (low - high))[..., None]
        tails, heads = np.moveaxis(self.points[self.ends[edges]], 2, 0)
        crossings = np.where(along == 1, heads, tails + along * (heads - tails))
        nodes = edges * self.n_planes + self.planes[pairs][:, None]
        closed_lines: list[list[Floats]] = [[] for _ in range(self.n_planes)]
        open_lines: list[list[Floats]] = [[] for _ in range(self.n_planes)]
        for order, backwards, closed in assemble_polylines(nodes[:, 0], nodes[:, 1], directed):
            points = crossings[order, backwards.astype(np.int64)]
            if not closed:
                points = np.concatenate([points, crossings[order[-1:], 1 - backwards[-1:].astype(np.int64)]])
            repeated = (points == np.roll(points, 1, axis=0)).all(axis=1)
            repeated[0] &= closed
            lines = closed_lines if closed else open_lines
            lines[self.planes[pairs[order[0]]]].append(points[~repeated])
        return closed_lines, open_lines


def _has_area(points: Floats) -> bool:
    """Whether a closed line bounds more than rounding."""
    if len(points) < 3 or not np.ptp(points, axis=0).any():
        return False
    x, y = (points - points[0]).T
    doubled = float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)
    return abs(doubled) > AREA_ROUNDING * float(np.abs(x).max() ** 2 + np.abs(y).max() ** 2)
