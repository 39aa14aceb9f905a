"""Triangulation of a point cloud: local Delaunay triangulations in tangent planes, reconciled by votes.

Every point triangulates its neighbours in its own tangent plane (as for the Laplacian of Sharp & Crane 2020) and
proposes the triangles around itself. A triangle has one vote for each of its corners that proposes it. Triangles are
accepted in order of votes, then of roundness, unless they overlap an accepted one around one of their corners. The
result is a mesh with at most two faces at every edge.

The two sides of a thin plate lie in the same tangent planes, and only normals keep them apart. So the distance of
neighbours increases with the angle between normals, and neighbours are projected along the mean of both normals, so
that the two faces at a sharp edge lie next to each other. First, points triangulate the neighbours on their own side.
Where that leaves a boundary, they are joined to boundary points of the other side, projected along the directions in
which both sides end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, mask_of
from ..compiled import compiled
from ..mesh.components import connected_components, grouped, members_of
from ..mesh.edges import edge_table
from ..mesh.planar_triangulation import triangulate_polygon
from ..mesh.signed_graph import Links, signs_of
from ..mesh.unit_vectors import axes_across, unit
from ..mesh.welding import distinct_rows
from ..parallel import PointTree, in_chunks
from ..search.nearest_triangles import TriangleTree
from .plane_fits import POINT_NEIGHBORS, point_spacing

NORMAL_DISTANCE = 2.0
"""Weight of the distance between unit normals in the distance of neighbours, in spacings: points on the other side of a
plate, whose normals are 2 apart, count as four spacings farther (by Pythagoras). With it 72 thin clouds have 2,750
edges at holes, with 1 4,400, with 3 2,030; but with 3, 6 of 12 balls of 200 random points have a hole, with 2 none."""
OPPOSITE_SIDES = -0.5
"""Two points lie on different sides of a plate or wall if the cosine between their normals is below this. With -0.8 and
0 there are 4 and 8 % more edges at holes of point clouds."""
SAME_SIDE_HEIGHT = 0.03
"""Up to this height over the tangent plane of a point, in spacings, another point lies on the same side, whatever its
normal. With 0.01 there are 3 % fewer edges at holes, with 0.1 51 % more."""
OWN_NORMAL_WEIGHT = 0.03
"""Weight of a point's own normal in its tangent plane, relative to that of its neighbours. It decides where neighbours
lie along a line, as on the narrow side of a plate. With 0.01 there are 44 % more edges at holes; with 0.1 6 % fewer,
but 3 of 12 balls of 200 random points have a hole."""
PROPOSED_AT_ONCE = 65536
"""Batch size of points that propose triangles."""


@dataclass(frozen=True, eq=False)
class LocalTriangulations:
    """Triangles on points, and the normals by which they are oriented."""

    faces: Ints  # (m, 3) point ids, oriented alike as far as the surface allows
    normals: Floats  # (n, 3) unit normals, on the side from which the faces at each point run counter-clockwise


def local_triangulations(
    points: Floats, normals: Floats, n_neighbors: int = 30, given: Floats | None = None
) -> LocalTriangulations:
    """Triangulate (n, 3) points in O(n log n) time, given (n, 3) unit normals by which sides are told apart.

    Each component of the result is oriented like most of the normals `given`, (n, 3), or of `normals` without these.
    """
    planes = TangentPlanes.of(points, normals, n_neighbors)
    faces, candidates = joined_triangles(planes)
    alone = islands(planes, faces)
    if alone.any():  # their normals contradict those of the points nearby, so they are taken for inverted
        planes = TangentPlanes.of(points, np.where(alone[:, None], -normals, normals), n_neighbors)
        faces, candidates = joined_triangles(planes)
    if len(faces) == 0:
        return LocalTriangulations(faces, planes.normals)
    faces = split_at_points_left(points, faces, candidates)
    signs = aligned(planes.normals, faces, normals, normals if given is None else given)
    oriented = planes.normals * signs[:, None]
    faces = facing(planes, oriented, faces)
    return LocalTriangulations(np.concatenate([faces, hole_fillings(points, oriented, faces)]), oriented)


def joined_triangles(planes: TangentPlanes) -> tuple[Ints, Ints]:
    """Triangulate the points of each side, and join the sides where they end.

    Return (m, 3) accepted faces, and all well-shaped proposals.
    """
    points, everywhere = planes.points, np.arange(len(planes.points))
    beside = ~planes.opposed(everywhere, planes.neighbors)
    proposals = [proposed_triangles(planes, everywhere, planes.neighbors, beside)]
    faces = accepted_triangles(planes, proposals)
    edges, is_open = edge_table(faces), np.ones(len(points), dtype=bool)
    is_open[faces] = False
    is_open[edges.vertices[edges.face_counts == 1]] = True
    ends = np.flatnonzero(is_open)
    if len(ends):
        near = PointTree(points).query(points[ends], k=planes.neighbors.shape[1] + 1)[1][:, 1:]
        proposals.append(proposed_triangles(planes, ends, near, is_open[near] | ~planes.opposed(ends, near)))
        faces = accepted_triangles(planes, proposals)
    candidates = np.concatenate([triangles for triangles, _ in proposals])
    return faces, candidates[well_shaped_triangles(points, candidates, planes.reach)[0]]


def islands(planes: TangentPlanes, faces: Ints) -> Bools:
    """(n,) whether each point is in a component of (m, 3) faces smaller than a neighbourhood, near another side."""
    n, k = planes.neighbors.shape
    tail, head = edge_table(faces).vertices.T
    part = connected_components(n, tail, head)
    few = np.flatnonzero((np.bincount(part) < k)[part])
    result = np.zeros(n, dtype=bool)
    if len(few) and len(few) < n:
        near = PointTree(planes.points).query(planes.points[few], k=k + 1)[1][:, 1:]
        result[few] = planes.opposed(few, near).any(axis=1)
    return result


@dataclass(frozen=True, eq=False)
class TangentPlanes:
    """Tangent planes at points, into which their neighbours are unfolded."""

    points: Floats  # (n, 3) positions
    normals: Floats  # (n, 3) unit normals of the planes
    axes: Floats  # (n, 2, 3) two axes in each plane
    outward: Floats  # (n, 3) unit vectors in the planes, away from the neighbours on the same side
    neighbors: Ints  # (n, k) ids of the nearest points, where those with other normals count as farther
    reach: Floats  # (n,) distance to the last of them, measured in this way
    flat: Floats  # (n,) height over the plane up to which points count as lying in it

    @classmethod
    def of(cls, points: Floats, normals: Floats, n_neighbors: int) -> TangentPlanes:
        """Fit a plane at each point to its neighbours on the same side; given normals of scans are often inexact."""
        k, many = (min(size, len(points) - 1) for size in (n_neighbors, 2 * n_neighbors))
        nearest = min(POINT_NEIGHBORS, many)
        tree = PointTree(points)

        def fitted(ids: Ints) -> tuple[NDArray[Any], ...]:
            """Principal axes, directions away from neighbours, neighbours, reach and `flat` for (k,) ids of points."""
            centers, own = points[ids], normals[ids]
            distances, near = tree.query(centers, k=many + 1)
            spacing = point_spacing(distances[:, nearest], nearest)
            flat = SAME_SIDE_HEIGHT * spacing
            apart, opposed = _normals_apart(points, normals, flat, near)
            distances = np.hypot(distances, NORMAL_DISTANCE * spacing[:, None] * apart)
            order = np.argsort(distances, axis=1, kind="stable")[:, : k + 1]
            near, distances, opposed = (np.take_along_axis(a, order, axis=1) for a in (near, distances, opposed))
            offsets, reach = points[near] - centers[:, None], distances[:, -1]
            weights = np.exp(-((2 * distances / reach[:, None]) ** 2)) * ~opposed
            away = -(weights[..., None] * offsets).sum(axis=1)
            return principal_axes(offsets, weights, own, reach), away, near[:, 1:], reach, flat

        axes, away, neighbors, reach, flat = in_chunks(fitted, np.arange(len(points)))
        axis = axes[:, 2] * np.where((axes[:, 2] * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        outward = unit(away - (away * axis).sum(axis=1)[:, None] * axis)
        return cls(points, axis, axes[:, :2], outward, neighbors, reach, flat)

    def opposed(self, here: Ints, there: Ints) -> Bools:
        """(m, k) whether the (m, k) points `there` lie on the other side of a plate than the (m,) points `here`."""

        def opposed_to_first(ids: Ints) -> tuple[Bools]:
            return (opposed_normals(self.points, self.normals, self.flat[ids[:, 0]], ids)[:, 1:],)

        return in_chunks(opposed_to_first, np.column_stack([here, there]))[0]

    def unfolded(self, here: Ints, there: Ints) -> Floats:
        """(m, 2) coordinates of points `there`, (m,) ids, in the tangent planes of points `here`, (m,) ids.

        The height of a point along the mean of both normals is removed, and the rest rotated into the plane. For points
        on the other side of a plate, the directions in which both sides end replace the normals.
        """
        known = self.points, self.normals, self.axes, self.outward, self.flat
        return in_chunks(lambda pairs: (_unfolded(*known, pairs),), np.column_stack([here, there]))[0]

    def unfolded_sides(self, triangles: Ints) -> Iterator[tuple[Floats, Floats]]:
        """Yield, for each corner of (m, 3) triangles, (m, 2) vectors to both other corners in the corner's plane."""
        for k in range(3):
            corners, right, left = (triangles[:, (k + shift) % 3] for shift in range(3))
            yield self.unfolded(corners, right), self.unfolded(corners, left)


ALIKE, MISTAKEN, OPPOSED = 0, 1, 2
"""How the normals of two points differ: by at most 120°, or since one is inverted by mistake, or as on the two sides of
a plate."""


@compiled
def _difference(points: Floats, normals: Floats, flat: float, p: int, q: int) -> int:
    """Return `ALIKE`, `MISTAKEN` or `OPPOSED`, for the normals of points p and q.

    Contrary normals are a mistake if q lies within `flat` of the tangent plane of p, or if only one of the points is
    above the other.
    """
    cosine, over, under = 0.0, 0.0, 0.0
    for d in range(3):
        offset = points[q, d] - points[p, d]
        cosine += normals[p, d] * normals[q, d]
        over += offset * normals[p, d]
        under -= offset * normals[q, d]
    if not cosine < OPPOSITE_SIDES:
        return ALIKE
    return MISTAKEN if abs(over) < flat or over * under < 0.0 else OPPOSED


@compiled
def _normals_apart(points: Floats, normals: Floats, flat: Floats, ids: Ints) -> tuple[Floats, Bools]:
    """(m, k) distances of normals from that of the first point in each row of ids, and (m, k) whether opposed to it.

    Normals that are inverted by mistake are inverted before. `flat` are (m,) heights, see `_difference`.
    """
    apart, opposed = np.empty(ids.shape), np.empty(ids.shape, dtype=np.bool_)
    for row in range(len(ids)):
        p = ids[row, 0]
        for column in range(ids.shape[1]):
            q = ids[row, column]
            difference = _difference(points, normals, flat[row], p, q)
            sign, square = -1.0 if difference == MISTAKEN else 1.0, 0.0
            for d in range(3):
                square += (sign * normals[q, d] - normals[p, d]) ** 2
            apart[row, column], opposed[row, column] = np.sqrt(square), difference == OPPOSED
    return apart, opposed


def opposed_normals(points: Floats, normals: Floats, flat: Floats, ids: Ints) -> Bools:
    """(m, k) which points lie on the other side of a plate than the first of their row of (m, k) ids.

    `flat` are the (m,) heights up to which a point lies in the tangent plane of the first.
    """
    return _normals_apart(points, normals, flat, ids)[1]


@compiled
def _unfolded(points: Floats, normals: Floats, axes: Floats, outward: Floats, flat: Floats, pairs: Ints) -> Floats:
    """(m, 2) coordinates of the second point of each pair in the tangent plane of the first: `TangentPlanes.unfolded`.

    `pairs` are (m, 2) ids of points. For each point there are its unit normal, (n, 3), two `axes` in its tangent plane,
    (n, 2, 3), a unit vector `outward` in that plane, away from neighbours on the same side, (n, 3), and in `flat`,
    (n,), the height above the plane up to which points count as lying in it.
    """
    # `middle` is the mean normal, and `seen` the vector from p to q without its height along this, which is then
    # rotated from the plane across the mean normal into that of p
    result, middle, seen = np.empty((len(pairs), 2)), np.empty(3), np.empty(3)
    for row in range(len(pairs)):
        p, q = pairs[row]
        difference = _difference(points, normals, flat[p], p, q)
        sign, square = -1.0 if difference == MISTAKEN else 1.0, 0.0
        for d in range(3):
            both = outward[p, d] + outward[q, d] if difference == OPPOSED else normals[p, d] + sign * normals[q, d]
            middle[d], square = both, square + both * both
        height, cosine, lean = 0.0, 0.0, 0.0
        for d in range(3):
            middle[d] = middle[d] / np.sqrt(square) if square > 0.0 else 0.0
            height += (points[q, d] - points[p, d]) * middle[d]
            cosine += normals[p, d] * middle[d]
        for d in range(3):
            seen[d] = points[q, d] - points[p, d] - height * middle[d]
            lean += normals[p, d] * seen[d]
        for d in range(3):
            seen[d] -= lean / max(1.0 + cosine, 1e-9) * (normals[p, d] + middle[d])
            seen[d] += abs(height) * middle[d] if difference == OPPOSED else 0.0
        for a in range(2):
            result[row, a] = seen[0] * axes[p, a, 0] + seen[1] * axes[p, a, 1] + seen[2] * axes[p, a, 2]
    return result


def principal_axes(offsets: Floats, weights: Floats, normals: Floats, reach: Floats) -> Floats:
    """(n, 3, 3) principal axes of (n, k, 3) offsets with (n, k) weights, from the longest extent to the shortest.

    The last axis is pulled towards the (n, 3) normals. `reach` are the (n,) distances of the farthest offsets.
    """
    weights = weights[..., None]
    offsets = offsets - (weights * offsets).sum(axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True)
    covariance = (weights * offsets).transpose(0, 2, 1) @ offsets
    pull = OWN_NORMAL_WEIGHT * reach**2 * weights.sum(axis=(1, 2))
    covariance += pull[:, None, None] * (np.eye(3) - normals[:, :, None] * normals[:, None])
    first, second = np.moveaxis(np.linalg.eigh(covariance)[1][:, :, :0:-1], 2, 0)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def proposed_triangles(planes: TangentPlanes, centers: Ints, neighbors: Ints, allowed: Bools) -> tuple[Ints, Ints]:
    """(m, 3) distinct triangles that (c,) `centers` propose around themselves, and (m,) how many propose each.

    They use the neighbours, (c, k), that are `allowed`, (c, k).
    """
    triangles = [np.empty((0, 3), dtype=np.int64)]
    k = neighbors.shape[1]
    for begin in range(0, len(centers), PROPOSED_AT_ONCE):
        part = slice(begin, begin + PROPOSED_AT_ONCE)
        chunk = centers[part]
        coordinates = planes.unfolded(np.repeat(chunk, k), neighbors[part].ravel()).reshape(len(chunk), k, 2)
        # neighbours not allowed are moved to the origin, where voronoi_fans skips them
        x, y = np.moveaxis(coordinates * allowed[part, :, None], 2, 0)
        order = np.argsort(x * x + y * y, axis=1)
        x, y = np.take_along_axis(x, order, axis=1), np.take_along_axis(y, order, axis=1)
        # places in `order` of the neighbours around each point; −1 where no neighbour bounds its cell
        fans, counts = in_chunks(voronoi_fans, np.stack([x, y], axis=2) / planes.reach[chunk, None, None])
        column = np.arange(fans.shape[1])
        # the next one around; after the last comes the first
        following = np.where(column + 1 < counts[:, None], np.roll(fans, -1, axis=1), fans[:, :1])
        row, columns = np.nonzero((column < counts[:, None]) & (fans >= 0) & (following >= 0))
        near = np.take_along_axis(neighbors[part], order, axis=1)
        triangles.append(
            np.stack([chunk[row], near[row, fans[row, columns]], near[row, following[row, columns]]], axis=1)
        )
    sorted_corners = np.sort(np.concatenate(triangles), axis=1)
    number, first = distinct_rows(sorted_corners)
    distinct = sorted_corners[first]
    order = np.lexsort(distinct.T[::-1])
    return distinct[order], np.bincount(number)[order]


def accepted_triangles(planes: TangentPlanes, proposals: Sequence[tuple[Ints, Ints]]) -> Ints:
    """(m, 3) well-shaped triangles that do not overlap a better one.

    `proposals` are pairs of triangles and their votes. Better are those of earlier pairs, then those with more votes,
    then rounder ones.
    """
    triangles = np.concatenate([part for part, _ in proposals])
    votes = np.concatenate([part for _, part in proposals])
    rank = np.repeat(np.arange(len(proposals)), [len(part) for part, _ in proposals])
    once = np.sort(distinct_rows(triangles)[1])
    keep, circumradii = well_shaped_triangles(planes.points, triangles[once], planes.reach)
    once = once[keep]
    return nonoverlapping_triangles(planes, triangles[once[np.lexsort((circumradii, -votes[once], rank[once]))]])


def well_shaped_triangles(points: Floats, triangles: Ints, reach: Floats) -> tuple[Ints, Floats]:
    """(k,) ids of triangles with an area and a circumradius within the (n,) reach of all corners; (k,) circumradii."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    u, v, w = b - a, c - b, a - c
    twice_area = np.linalg.norm(np.cross(u, w), axis=1)
    product = np.prod([np.linalg.norm(side, axis=1) for side in (u, v, w)], axis=0)
    limit = reach[triangles].min(axis=1)
    keep = np.flatnonzero((product <= 2 * limit * twice_area) & (twice_area > 0))
    return keep, product[keep] / (2 * twice_area[keep])


def nonoverlapping_triangles(planes: TangentPlanes, triangles: Ints) -> Ints:
    """(k, 3) triangles that are accepted, in order, unless they overlap an earlier one around a common corner."""
    starts, widths = np.empty(triangles.shape), np.empty(triangles.shape)
    for k, sides in enumerate(planes.unfolded_sides(triangles)):
        right, left = (np.arctan2(side[:, 1], side[:, 0]) for side in sides)
        turn = np.mod(left - right + np.pi, 2 * np.pi) - np.pi
        starts[:, k], widths[:, k] = np.where(turn < 0, left, right), np.abs(turn)
    return triangles[accept_apart(triangles, starts, widths, len(planes.points))]


def split_at_points_left(points: Floats, faces: Ints, candidates: Ints) -> Ints:
    """Split the (m, 3) faces until each point of a (k, 3) candidate triangle is a vertex; return all faces.

    Faces are split at a point that they are nearest to. Points in no candidate are outliers, and are left out.
    """
    while len(left := np.setdiff1d(candidates, faces)):
        nearest, _ = TriangleTree.of(points[faces]).nearest(points[left])
        split, first = np.unique(nearest, return_index=True)
        around = faces[split]
        parts = [np.column_stack([around[:, k], around[:, (k + 1) % 3], left[first]]) for k in range(3)]
        faces = np.concatenate([np.delete(faces, split, axis=0), *parts])
    return faces


def aligned(axes: Floats, faces: Ints, normals: Floats, given: Floats) -> Ints:
    """(n,) signs that orient (n, 3) axes consistently across edges and like `normals`, and components like `given`.

    Both are (n, 3) unit vectors; edges are those of (m, 3) faces.
    """
    n = len(axes)
    tail, head = edge_table(faces).vertices.T
    parts = connected_components(n, tail, head)
    across = (axes[tail] * axes[head]).sum(axis=1)
    links = Links(tail, head, across * np.abs(across))  # creases weigh little
    agreement = (axes * normals).sum(axis=1)  # with estimates, node n, weighs as much as a neighbour in the same plane
    node_signs = signs_of(Links.joined(links, Links(np.arange(n), np.full(n, n), agreement)), n + 1)
    signs = (node_signs[:n] * node_signs[n]).astype(np.int64)
    preference = np.bincount(parts, signs * (axes * given).sum(axis=1))
    return np.where(preference < 0, -1, 1)[parts] * signs


def facing(planes: TangentPlanes, normals: Floats, faces: Ints) -> Ints:
    """(m, 3) faces, flipped so that they face to where the normals at their corners point, in tangent planes there."""
    up = np.sign((np.cross(planes.axes[:, 0], planes.axes[:, 1]) * normals).sum(axis=1))
    area = np.zeros(len(faces))
    for k, (a, b) in enumerate(planes.unfolded_sides(faces)):
        area += up[faces[:, k]] * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return np.where((area < 0)[:, None], faces[:, [0, 2, 1]], faces)


CELL_ROOM = 64
"""Largest number of sides of a Voronoi cell, and of triangles at a point."""
SECTOR_OVERLAP = 1e-7
"""The sectors of two triangles at a corner may overlap by this angle, in radians."""


@compiled
def voronoi_fans(places: Floats) -> tuple[Ints, Ints]:
    """Find the Delaunay neighbours of the origin among (n, k, 2) points, n times, which must be sorted by distance.

    Return (n, CELL_ROOM) indices, counter-clockwise, and their (n,) numbers. The Voronoi cell of the origin, at first a
    square from −1 to 1, is cut by the bisectors of neighbours. Sides of the square that remain are listed as −1.
    """
    n, k = places.shape[:2]
    neighbours = np.full((n, CELL_ROOM), -1, dtype=np.int64)
    counts = np.zeros(n, dtype=np.int64)
    for i in range(n):
        corner = np.empty((CELL_ROOM, 2))  # of the cell; corner c is where side c starts
        beyond = np.full(CELL_ROOM, -1, dtype=np.int64)  # the neighbour beyond each side
        new_corner = np.empty((CELL_ROOM, 2))
        new_beyond = np.empty(CELL_ROOM, dtype=np.int64)
        corner[0, 0], corner[1, 0], corner[2, 0], corner[3, 0] = 1.0, 1.0, -1.0, -1.0
        corner[0, 1], corner[1, 1], corner[2, 1], corner[3, 1] = -1.0, 1.0, 1.0, -1.0
        m, farthest = 4, 2.0  # number of corners, and squared distance of the farthest
        for j in range(k):
            px, py = places[i, j]
            square = px * px + py * py
            if square > 4 * farthest or square < 1e-24:
                continue
            half = 0.5 * square
            slack = 1e-9 * half  # a bisector that only touches a corner of the cell does not cut it
            cut = False
            for c in range(m):
                cut = cut or corner[c, 0] * px + corner[c, 1] * py > half + slack
            if not cut or m + 1 >= CELL_ROOM:
                continue
            new = 0
            for c in range(m):
                d = (c + 1) % m
                # heights of the ends of side c beyond the bisector, times the distance of the neighbour
                tail_height = corner[c, 0] * px + corner[c, 1] * py - half
                head_height = corner[d, 0] * px + corner[d, 1] * py - half
                if tail_height <= slack:
                    new_corner[new, 0], new_corner[new, 1] = corner[c, 0], corner[c, 1]
                    new_beyond[new] = beyond[c]
                    new += 1
                if (tail_height <= slack) != (head_height <= slack):
                    s = min(max(tail_height / (tail_height - head_height), 0.0), 1.0)
                    for axis in range(2):
                        new_corner[new, axis] = corner[c, axis] + s * (corner[d, axis] - corner[c, axis])
                    new_beyond[new] = j if tail_height <= slack else beyond[c]
                    new += 1
            m, farthest = new, 0.0
            for c in range(m):
                corner[c, 0], corner[c, 1] = new_corner[c, 0], new_corner[c, 1]
                beyond[c] = new_beyond[c]
                farthest = max(farthest, corner[c, 0] ** 2 + corner[c, 1] ** 2)
        counts[i] = m
        for c in range(m):
            neighbours[i, c] = beyond[c]
    return neighbours, counts


@compiled
def accept_apart(triangles: Ints, starts: Floats, widths: Floats, n_points: int) -> Bools:
    """(m,) whether each triangle is accepted, since its sectors at its corners overlap none accepted before.

    Sectors are (m, 3) angles from `starts` on, `widths` wide.
    """
    accepted = np.zeros(len(triangles), dtype=np.bool_)
    sectors = np.zeros((n_points, CELL_ROOM, 2))
    count = np.zeros(n_points, dtype=np.int64)
    for f in range(len(triangles)):
        apart = True
        for k in range(3):
            v = triangles[f, k]
            apart = apart and count[v] < CELL_ROOM
            for s in range(count[v]):
                ahead = (starts[f, k] - sectors[v, s, 0]) % (2 * np.pi)
                behind = (sectors[v, s, 0] - starts[f, k]) % (2 * np.pi)
                inside = min(ahead, behind) > SECTOR_OVERLAP and (ahead < sectors[v, s, 1] - SECTOR_OVERLAP)
                around = min(ahead, behind) > SECTOR_OVERLAP and (behind < widths[f, k] - SECTOR_OVERLAP)
                same = min(ahead, behind) <= SECTOR_OVERLAP and min(widths[f, k], sectors[v, s, 1]) > SECTOR_OVERLAP
                apart = apart and not (inside or around or same)
        if apart:
            accepted[f] = True
            for k in range(3):
                v = triangles[f, k]
                sectors[v, count[v], 0], sectors[v, count[v], 1] = starts[f, k], widths[f, k]
                count[v] += 1
    return accepted


HOLE_SIDES = 12
"""Holes with more sides are left open."""


def hole_fillings(points: Floats, normals: Floats, faces: Ints) -> Ints:
    """(k, 3) triangles that fill holes of at most `HOLE_SIDES` sides, without diagonals that are already edges.

    Points and unit normals are (n, 3), faces (m, 3).
    """
    edges = edge_table(faces)
    face, side = np.nonzero(edges.face_counts[edges.face_edges] == 1)
    tails, heads = faces[face, side], faces[face, (side + 1) % 3]
    following = next_around_gap(points, normals, tails, heads)
    at_boundary = mask_of(len(points), tails)
    existing = {_pair(i, j) for i, j in edges.vertices[at_boundary[edges.vertices].all(axis=1)].tolist()}
    fillings: list[list[int]] = []
    passed = np.zeros(len(tails), dtype=bool)
    for start in range(len(tails)):
        if not passed[start]:
            clockwise = _loop_from(start, following)  # faces are left of their edges, and the hole is to the right
            passed[clockwise] = True
            fillings += _filling(points, normals, tails[clockwise[::-1]].tolist(), existing)
    return np.array(fillings, dtype=np.int64).reshape(-1, 3)


def next_around_gap(points: Floats, normals: Floats, tails: Ints, heads: Ints) -> Ints:
    """(b,) the boundary edge that follows each around the gap to its right, or −1.

    Edges have (b,) tails and heads among (n, 3) points with unit normals. Of several, it is the first counter-clockwise
    as seen from the normal.
    """
    arriving, onward = members_of(*grouped(tails, len(points)), heads)
    vertices = heads[arriving]
    back, forth = points[tails[arriving]] - points[vertices], points[heads[onward]] - points[vertices]
    sine = (np.cross(back, forth) * normals[vertices]).sum(axis=1)
    flat = [d - (d * normals[vertices]).sum(axis=1)[:, None] * normals[vertices] for d in (back, forth)]
    turn = np.mod(np.arctan2(sine, (flat[0] * flat[1]).sum(axis=1)), 2 * np.pi)
    order = np.lexsort((turn, arriving))
    following = np.full(len(tails), -1, dtype=np.int64)
    following[arriving[order[::-1]]] = onward[order[::-1]]  # the first in order is written last
    return following


def _loop_from(start: int, following: Ints) -> list[int]:
    """List the boundary edges of the loop from `start` on; none if it does not close within `HOLE_SIDES` edges."""
    loop = [start]
    while len(loop) <= HOLE_SIDES:
        onward = int(following[loop[-1]])
        if onward == start:
            return loop
        if onward < 0:
            break
        loop.append(onward)
    return []


def _filling(points: Floats, normals: Floats, loop: list[int], existing: set[tuple[int, int]]) -> list[list[int]]:
    """Triangulate a hole, whose vertices are listed counter-clockwise; return no triangles if that is not possible.

    Points and unit normals are (n, 3). Its diagonals must not be among the `existing` edges, to which they are added.
    """
    if len(set(loop)) < max(len(loop), 3):
        return []
    corners = points[loop]
    normal = normals[loop].sum(axis=0)
    fan = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
    if fan @ normal <= 0:
        return []
    axes = np.concatenate(axes_across(normal[None]))
    cut = triangulate_polygon((corners - corners[0]) @ axes.T, len(loop))
    if cut is None:
        return []
    triangles: list[list[int]] = np.array(loop)[cut].tolist()
    sides = {_pair(loop[k - 1], loop[k]) for k in range(len(loop))}
    diagonals = {_pair(row[k - 1], row[k]) for row in triangles for k in range(3)} - sides
    if diagonals & existing:
        return []
    existing |= diagonals
    return triangles


def _pair(i: int, j: int) -> tuple[int, int]:
    """Return two vertex ids in ascending order, as the key of an edge."""
    return min(i, j), max(i, j)
