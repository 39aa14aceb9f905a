"""Generalized winding numbers of points, by a tree of boxes (Barill et al. 2018).

Faces near a point count by their solid angles, and faces far away by the moments of a node that contains them. Let p be
the centre of a node, e the offsets of its faces from p, and a their area vectors, and let r be the length of d. Then
4π times the winding number at ``p − d`` is, by Taylor's theorem, ``a·d / r³ + (tr M − 3 M(d) / r²) / r³ + (15 S(d) / r²
− 3 tr S(d)) / 2 r⁵``. Here ``M(d) = Σ (a·d) (e·d)`` and ``S(d) = Σ (a·d) (e·d)²`` are polynomials, of which only the
symmetric parts matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..mesh.box_tree import BOXES_PER_LEAF, BoxTree
from ..mesh.triangles import area_vectors
from ..mesh.unit_vectors import unit
from ..parallel import ROWS_PER_TASK, in_chunks

OFF_FACE = 1e-6
"""Distance of test points in front of a face and behind it, relative to its size. Nearer points count as in it."""
APEX_IN_PLANE = 1e-9
"""Volume that a point spans with a triangle, relative to the product of its distances to the corners, up to which the
point counts as lying in the plane of the triangle."""
MOMENT_RADII = 1.25
"""Distance of a point from a node's centre, relative to the node's radius, above which moments replace its faces."""
SUMMED_TRIANGLES = 64
"""Number of triangles up to which all are summed for each point, which takes less time than to compute moments."""


@dataclass(frozen=True, eq=False)
class WindingTree:
    """Triangles in a tree of boxes, for winding numbers around points."""

    triangles: Floats  # (m, 3, 3) corners, counter-clockwise as seen from outside
    tree: BoxTree  # the tree of their boxes

    @classmethod
    def of(cls, triangles: Floats) -> WindingTree:
        """Build a tree over (m, 3, 3) triangles."""
        return cls(triangles, BoxTree.around(triangles))

    def numbers(self, points: Floats) -> Floats:
        """Return (n,) winding numbers around (n, 3) points, with errors of a few hundredths.

        For a point on a face it is that on one of the sides.
        """
        return self._numbers(points, 0.0)

    def levels(self, points: Floats) -> Floats:
        """Return (n,) winding numbers around (n, 3) points; for points on faces, the mean of those on both sides."""
        return self._numbers(points, OFF_FACE)

    def _numbers(self, points: Floats, thickness: float) -> Floats:
        """Return (n,) winding numbers around (n, 3) points, 0 of the faces within whose thickness they lie."""
        corners = np.ascontiguousarray(self.triangles).reshape(-1, 9)
        points = np.ascontiguousarray(points)  # the kernel is compiled for one kind of array
        (numbers,) = in_chunks(
            lambda chunk: (_winding(corners, self.tree.items, self._moments, chunk, thickness),), points
        )
        return numbers

    def behind(self, faces: NDArray[np.integer], places: Floats) -> Floats:
        """Return (n,) winding numbers just behind (n, 3) points in (n,) faces, which are not near their edges."""
        return self.numbers(places - steps_off(self.triangles[faces], OFF_FACE))

    @cached_property
    def _moments(self) -> Floats:
        """Moments of the nodes of the tree, (2 · leaves, 23) float."""
        return _moments(self.triangles, self.tree)


def steps_off(triangles: Floats, depth: float) -> Floats:
    """Return (m, 3) vectors along the normals of (m, 3, 3) triangles, of length `depth` times √(2 · area)."""
    normals = 2.0 * area_vectors(triangles)
    return depth * np.sqrt(np.linalg.norm(normals, axis=1))[:, None] * unit(normals)


def winding_sums(triangles: Floats, points: Floats) -> Floats:
    """Return (n,) winding numbers of (m, 3, 3) triangles around few points, (n, 3), by summing solid angles.

    The solid angle is computed as by van Oosterom & Strackee (1983).
    """
    numbers = np.zeros(len(points))
    for begin in range(0, len(triangles), ROWS_PER_TASK):
        block = np.ascontiguousarray(
            triangles[begin : begin + ROWS_PER_TASK].transpose(1, 2, 0)
        )  # fast along long rows
        for k, point in enumerate(points):
            a, b, c = block - point[:, None]
            x, y, z = (np.sqrt(np.einsum("dn,dn->n", corner, corner)) for corner in (a, b, c))
            ab, bc, ca = (np.einsum("dn,dn->n", *sides) for sides in ((a, b), (b, c), (c, a)))
            volumes = np.einsum("dn,dn->n", a, np.cross(b, c, axis=0))
            numbers[k] += np.arctan2(volumes, x * y * z + ab * z + bc * x + ca * y).sum() / (2 * np.pi)
    return numbers


@compiled
def _winding(corners: Floats, items: Ints, moments: Floats, points: Floats, thickness: float) -> Floats:
    """Return (n,) winding numbers, from the solid angles of faces in near leaves and the moments of far nodes.

    `corners` are (m, 9), `items` the faces in the leaves of the tree, and `moments`, (2 · leaves, 23), those of its
    nodes: area vector, centre, squared distance beyond which they are used, and coefficients of M (6) and S (10).
    Points in a face, up to a height of `thickness` relative to its size, see as much of it on one side as on the other:
    nothing.
    """
    leaves = len(moments) // 2
    stack = np.empty(64, dtype=np.int64)
    result = np.zeros(len(points))
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        total, depth = 0.0, 1
        stack[0] = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            dx, dy, dz = moments[node, 3] - x, moments[node, 4] - y, moments[node, 5] - z
            square = dx * dx + dy * dy + dz * dz
            if square > moments[node, 6]:  # far away: the formula of this module
                m = moments[node]
                xx, yy, zz = dx * dx, dy * dy, dz * dz
                m_of_d = xx * m[7] + yy * m[8] + zz * m[9] + dx * dy * m[10] + dx * dz * m[11] + dy * dz * m[12]
                s_of_d = dx * (xx * m[13] + yy * m[18] + zz * m[20]) + dy * (yy * m[14] + xx * m[16] + zz * m[21])
                s_of_d += dz * (zz * m[15] + xx * m[17] + yy * m[19]) + dx * dy * dz * m[22]
                trace_of_s = dx * (3.0 * m[13] + m[18] + m[20]) + dy * (3.0 * m[14] + m[16] + m[21])
                trace_of_s += dz * (3.0 * m[15] + m[17] + m[19])
                flux = dx * m[0] + dy * m[1] + dz * m[2] + m[7] + m[8] + m[9]
                flux += (7.5 * s_of_d / square - 3.0 * m_of_d - 1.5 * trace_of_s) / square
                total += flux / (square * np.sqrt(square))
            elif node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
            else:
                real, imaginary = 1.0, 0.0
                for k in range((node - leaves) * BOXES_PER_LEAF, (node - leaves + 1) * BOXES_PER_LEAF):
                    if items[k] >= 0:
                        rest, volume = solid_angle(corners, items[k], x, y, z)
                        # angles below an eighth of a turn are added by multiplying complex numbers
                        if rest > abs(volume):
                            share = volume / rest
                            real, imaginary = real - imaginary * share, imaginary + real * share
                        elif abs(volume) > -thickness * rest:  # near the face, half of its angle is near a half turn
                            total += 2.0 * np.arctan2(volume, rest)
                if imaginary != 0.0:
                    total += 2.0 * np.arctan2(imaginary, real)
        result[p] = total / (4.0 * np.pi)
    return result


@compiled
def solid_angle(corners: Floats, face: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return real and imaginary part of a complex number whose argument is half the solid angle of a triangle.

    The triangle is a row of (m, 9) corners, seen from (x, y, z) (van Oosterom & Strackee 1983).
    """
    ax, ay, az = corners[face, 0] - x, corners[face, 1] - y, corners[face, 2] - z
    bx, by, bz = corners[face, 3] - x, corners[face, 4] - y, corners[face, 5] - z
    cx, cy, cz = corners[face, 6] - x, corners[face, 7] - y, corners[face, 8] - z
    a = np.sqrt(ax * ax + ay * ay + az * az)
    b = np.sqrt(bx * bx + by * by + bz * bz)
    c = np.sqrt(cx * cx + cy * cy + cz * cz)
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    rest = a * b * c + (ax * bx + ay * by + az * bz) * c
    rest += (bx * cx + by * cy + bz * cz) * a + (cx * ax + cy * ay + cz * az) * b
    return rest, volume


@compiled
def mean_angle(corners: Floats, face: int, x: float, y: float, z: float) -> float:
    """Return the signed solid angle of a triangle, a row of (m, 9) corners, seen from (x, y, z).

    For points in its plane it is 0, the mean of the angles on both sides.
    """
    rest, volume = solid_angle(corners, face, x, y, z)
    scale = 1.0
    for c in range(0, 9, 3):
        dx, dy, dz = corners[face, c] - x, corners[face, c + 1] - y, corners[face, c + 2] - z
        scale *= np.sqrt(dx * dx + dy * dy + dz * dz)
    return 0.0 if abs(volume) <= APEX_IN_PLANE * scale else 2.0 * np.arctan2(volume, rest)


SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Axes of the terms of M, which are xx, yy, zz, xy, xz, yz."""
CUBES = ((0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 0, 1), (0, 0, 2), (0, 1, 1), (1, 1, 2), (0, 2, 2), (1, 2, 2), (0, 1, 2))
"""Axes of the terms of S, which are xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz."""


def _moments(triangles: Floats, tree: BoxTree) -> Floats:
    """Return (2 · leaves, 23) moments of the nodes of a tree.

    The columns are the area vector (3), the centre (3), (`MOMENT_RADII` · radius)², and the coefficients of M (6) and S
    (10). For few triangles, the radius is infinite, so that moments are not used.
    """
    leaves = len(tree.bounds) // 2
    if len(triangles) <= SUMMED_TRIANGLES:
        return np.full((2 * leaves, 7 + len(SQUARES) + len(CUBES)), np.inf)  # none is as far away as that
    grouped = tree.items.reshape(leaves, BOXES_PER_LEAF)
    blocks = [
        _of_leaves(triangles, grouped[start : start + ROWS_PER_TASK]) for start in range(0, leaves, ROWS_PER_TASK)
    ]
    vectors, weights, weighted_centres, centres, moments_m, moments_s, radii = (
        np.concatenate(part, axis=-1) for part in zip(*blocks, strict=True)
    )
    moments = np.zeros((2 * leaves, 7 + len(SQUARES) + len(CUBES)))
    level = leaves
    while True:  # level by level, from the leaves to the root
        rows = slice(level, 2 * level)
        low, high = tree.bounds[rows, :3].T, tree.bounds[rows, 3:].T
        with np.errstate(invalid="ignore"):  # for empty nodes
            box = np.linalg.norm(np.maximum(centres - low, high - centres), axis=0)
        radii = np.where(weights > 0, np.minimum(radii, box), 0.0)
        moments[rows, :3], moments[rows, 3:6], moments[rows, 6] = vectors.T, centres.T, (MOMENT_RADII * radii) ** 2
        moments[rows, 7:13], moments[rows, 13:] = moments_m.T, moments_s.T
        if level == 1:
            return moments
        # move the moments of both children to their common centre, and add them
        level //= 2
        weighted_centres, weights_above = _of_pairs(weighted_centres), _of_pairs(weights)
        centres_above = _over(weighted_centres, weights_above)
        offsets = np.where(weights > 0, centres - np.repeat(centres_above, 2, axis=1), 0.0)
        moments_s = moments_s + 2 * _product(moments_m, offsets) + _product(_product(vectors, offsets), offsets)
        moments_m = moments_m + _product(vectors, offsets)
        radii = (radii + np.linalg.norm(offsets, axis=0)).reshape(-1, 2).max(axis=1)
        vectors, moments_m, moments_s = (_of_pairs(moment) for moment in (vectors, moments_m, moments_s))
        centres, weights = centres_above, weights_above


def _of_leaves(triangles: Floats, grouped: Ints) -> tuple[Floats, ...]:
    """Return moments of leaves, whose triangles are rows of `grouped`, −1 for none.

    These are the sums of area vectors, of areas, and of areas times centroids, and then centres, coefficients of M and
    S, and radii. The last axis of each counts the leaves.
    """
    filled = grouped >= 0
    corners = np.where(filled[..., None, None], triangles[grouped], 0.0)
    corners = np.ascontiguousarray(corners.transpose(2, 3, 0, 1))  # corner, axis, leaf, place in it
    middles = corners.mean(axis=0)
    own_vectors = 0.5 * np.cross(corners[1] - corners[0], corners[2] - corners[0], axis=0)
    areas = np.linalg.norm(own_vectors, axis=0)
    vectors, weights, firsts = own_vectors.sum(axis=2), areas.sum(axis=1), (areas * middles).sum(axis=2)
    centres = _over(firsts, weights)
    offsets = np.where(filled, middles - centres[..., None], 0.0)
    m_of_faces = _product(own_vectors, offsets)
    s_of_faces = _product(m_of_faces, offsets)
    for corner in corners:  # the second moment of a triangle about its own centre
        arm = corner - middles
        s_of_faces += _product(_product(own_vectors, arm), arm) / 12
    moments_m, moments_s = m_of_faces.sum(axis=2), s_of_faces.sum(axis=2)
    reaches = np.where(filled, np.linalg.norm(corners - centres[..., None], axis=1), 0.0)
    radii = reaches.max(axis=(0, 2))
    return vectors, weights, firsts, centres, moments_m, moments_s, radii


def _product(form: Floats, line: Floats) -> Floats:
    """Return the coefficients of the product of a linear or quadratic form, (3, …) or (6, …), and a linear one."""
    given, wanted = (((0,), (1,), (2,)), SQUARES) if len(form) == 3 else (SQUARES, CUBES)
    result = np.zeros((len(wanted), *form.shape[1:]))
    for term, axes in enumerate(given):
        for axis in range(3):
            result[wanted.index(tuple(sorted((*axes, axis))))] += form[term] * line[axis]
    return result


def _over(firsts: Floats, weights: Floats) -> Floats:
    """Return quotients, and the numerator where the weight is 0."""
    return firsts / np.where(weights > 0, weights, 1.0)


def _of_pairs(values: Floats) -> Floats:
    """Return (…, n / 2) sums over the two children of each node."""
    return values[..., ::2] + values[..., 1::2]
