"""Generalized winding numbers of points, through a tree of boxes (Barill et al. 2018).

Faces near a point count by their solid angles, faces far away by the moments of the nodes that contain them. Around a
centre p, with offsets e and area vectors a, 4π times the winding number at ``p − d`` is, by Taylor's theorem, ``a·d /
r³ + (tr M − 3 M(d) / r²) / r³ + (15 S(d) / r² − 3 tr S(d)) / 2 r⁵``, where ``M(d) = Σ (a·d) (e·d)`` and ``S(d) = Σ
(a·d) (e·d)²`` are polynomials, of which only the symmetric parts matter.
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
"""Offset of the points in front of a face and behind it that are tested, relative to its size."""
APEX_IN_PLANE = 1e-9
"""Volume of the cone to a triangle, relative to the product of its edges at the apex, up to which the apex is in its
plane."""
MOMENT_RADII = 1.25
"""Distance, relative to a node's radius, above which its moments replace its faces."""
SUMMED_TRIANGLES = 64
"""Of this many triangles or fewer all are summed for each point, which takes less time than their moments."""


@dataclass(frozen=True, eq=False)
class WindingTree:
    """Triangles in a tree, of which each node can replace its triangles for points far away."""

    triangles: Floats  # (m, 3, 3) their corners, counterclockwise from outside
    tree: BoxTree  # the tree of their boxes

    @classmethod
    def of(cls, triangles: Floats) -> WindingTree:
        """Build a tree over (m, 3, 3) triangles."""
        return cls(triangles, BoxTree.around(triangles))

    def numbers(self, points: Floats) -> Floats:
        """Return (n,) winding numbers around (n, 3) points, to a few hundredths; on a face, those of one side."""
        corners = np.ascontiguousarray(self.triangles).reshape(-1, 9)
        points = np.ascontiguousarray(points)  # the kernel is compiled for one kind of array
        (numbers,) = in_chunks(lambda chunk: (_winding(corners, self.tree.items, self._moments, chunk),), points)
        return numbers

    def levels(self, places: Floats, normals: Floats, areas: Floats) -> Floats:
        """Return (n,) means of the numbers on both sides of places on faces with these unit normals and areas."""
        steps = OFF_FACE * np.sqrt(areas)[:, None] * normals
        return 0.5 * (self.numbers(places - steps) + self.numbers(places + steps))

    def behind(self, faces: NDArray[np.integer], places: Floats) -> Floats:
        """Return (n,) winding numbers just behind places (n, 3) in faces (n,), away from their rims."""
        return self.numbers(places - steps_off(self.triangles[faces], OFF_FACE))

    @cached_property
    def _moments(self) -> Floats:
        return _moments(self.triangles, self.tree)


def steps_off(triangles: Floats, depth: float) -> Floats:
    """Return (m, 3) steps along the normals of triangles, as long as `depth` times the root of twice their areas."""
    normals = 2.0 * area_vectors(triangles)
    return depth * np.sqrt(np.linalg.norm(normals, axis=1))[:, None] * unit(normals)


def winding_sums(triangles: Floats, points: Floats) -> Floats:
    """Return (n,) winding numbers around few points, triangle by triangle (van Oosterom & Strackee 1983)."""
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
def _winding(corners: Floats, items: Ints, moments: Floats, points: Floats) -> Floats:
    """Return (n,) winding numbers, by the solid angles of faces in near leaves and by the `_moments` of far nodes."""
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
            if square > moments[node, 6]:
                m = moments[node]
                xx, yy, zz = dx * dx, dy * dy, dz * dz
                lean = xx * m[7] + yy * m[8] + zz * m[9] + dx * dy * m[10] + dx * dz * m[11] + dy * dz * m[12]
                bend = dx * (xx * m[13] + yy * m[18] + zz * m[20]) + dy * (yy * m[14] + xx * m[16] + zz * m[21])
                bend += dz * (zz * m[15] + xx * m[17] + yy * m[19]) + dx * dy * dz * m[22]
                trace = dx * (3.0 * m[13] + m[18] + m[20]) + dy * (3.0 * m[14] + m[16] + m[21])
                trace += dz * (3.0 * m[15] + m[17] + m[19])
                flux = dx * m[0] + dy * m[1] + dz * m[2] + m[7] + m[8] + m[9]
                flux += (7.5 * bend / square - 3.0 * lean - 1.5 * trace) / square
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
                        elif volume != 0.0:
                            total += 2.0 * np.arctan2(volume, rest)
                if imaginary != 0.0:
                    total += 2.0 * np.arctan2(imaginary, real)
        result[p] = total / (4.0 * np.pi)
    return result


@compiled
def solid_angle(corners: Floats, face: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the parts of a complex number whose argument is half a solid angle (van Oosterom & Strackee 1983)."""
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
    """Return the signed solid angle of a triangle from a point; in its plane 0, the mean of those on both sides."""
    rest, volume = solid_angle(corners, face, x, y, z)
    scale = 1.0
    for c in range(0, 9, 3):
        dx, dy, dz = corners[face, c] - x, corners[face, c + 1] - y, corners[face, c + 2] - z
        scale *= np.sqrt(dx * dx + dy * dy + dz * dz)
    return 0.0 if abs(volume) <= APEX_IN_PLANE * scale else 2.0 * np.arctan2(volume, rest)


SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Terms of M: xx, yy, zz, xy, xz, yz."""
CUBES = ((0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 0, 1), (0, 0, 2), (0, 1, 1), (1, 1, 2), (0, 2, 2), (1, 2, 2), (0, 1, 2))
"""Terms of S: xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz."""


def _moments(triangles: Floats, tree: BoxTree) -> Floats:
    """Return (2 · leaves, 23) area vector, centre, (`MOMENT_RADII` · radius)², and coefficients of M and S."""
    leaves = len(tree.bounds) // 2
    if len(triangles) <= SUMMED_TRIANGLES:
        return np.full((2 * leaves, 7 + len(SQUARES) + len(CUBES)), np.inf)  # none is as far away as that
    grouped = tree.items.reshape(leaves, BOXES_PER_LEAF)
    blocks = [
        _of_leaves(triangles, grouped[start : start + ROWS_PER_TASK]) for start in range(0, leaves, ROWS_PER_TASK)
    ]
    vectors, weights, firsts, centres, first, second, radii = (
        np.concatenate(part, axis=-1) for part in zip(*blocks, strict=True)
    )
    moments = np.zeros((2 * leaves, 7 + len(SQUARES) + len(CUBES)))
    level = leaves
    while True:
        rows = slice(level, 2 * level)
        low, high = tree.bounds[rows, :3].T, tree.bounds[rows, 3:].T
        with np.errstate(invalid="ignore"):  # for empty nodes
            box = np.linalg.norm(np.maximum(centres - low, high - centres), axis=0)
        radii = np.where(weights > 0, np.minimum(radii, box), 0.0)
        moments[rows, :3], moments[rows, 3:6], moments[rows, 6] = vectors.T, centres.T, (MOMENT_RADII * radii) ** 2
        moments[rows, 7:13], moments[rows, 13:] = first.T, second.T
        if level == 1:
            return moments
        level //= 2
        firsts, total = _of_pairs(firsts), _of_pairs(weights)
        middle = _over(firsts, total)
        moved = np.where(weights > 0, centres - np.repeat(middle, 2, axis=1), 0.0)
        second = second + 2 * _product(first, moved) + _product(_product(vectors, moved), moved)
        first = first + _product(vectors, moved)
        radii = (radii + np.linalg.norm(moved, axis=0)).reshape(-1, 2).max(axis=1)
        vectors, first, second = (_of_pairs(moment) for moment in (vectors, first, second))
        centres, weights = middle, total


def _of_leaves(triangles: Floats, grouped: Ints) -> tuple[Floats, ...]:
    """Return sums of leaves: area vectors, areas, areas times centres; and their centres, M, S, and radii."""
    filled = grouped >= 0
    corners = np.where(filled[..., None, None], triangles[grouped], 0.0)
    corners = np.ascontiguousarray(corners.transpose(2, 3, 0, 1))  # corner, axis, leaf, place in it
    middles = corners.mean(axis=0)
    own = 0.5 * np.cross(corners[1] - corners[0], corners[2] - corners[0], axis=0)
    areas = np.linalg.norm(own, axis=0)
    vectors, weights, firsts = own.sum(axis=2), areas.sum(axis=1), (areas * middles).sum(axis=2)
    centres = _over(firsts, weights)
    offsets = np.where(filled, middles - centres[..., None], 0.0)
    linear = _product(own, offsets)
    quadratic = _product(linear, offsets)
    for corner in corners:  # the second moment of a triangle about its own centre
        arm = corner - middles
        quadratic += _product(_product(own, arm), arm) / 12
    first, second = linear.sum(axis=2), quadratic.sum(axis=2)
    reaches = np.where(filled, np.linalg.norm(corners - centres[..., None], axis=1), 0.0)
    radii = reaches.max(axis=(0, 2))
    return vectors, weights, firsts, centres, first, second, radii


def _product(form: Floats, line: Floats) -> Floats:
    """Return the coefficients of a linear or quadratic form, (3, …) or (6, …), times a linear one."""
    given, wanted = (((0,), (1,), (2,)), SQUARES) if len(form) == 3 else (SQUARES, CUBES)
    result = np.zeros((len(wanted), *form.shape[1:]))
    for term, axes in enumerate(given):
        for axis in range(3):
            result[wanted.index(tuple(sorted((*axes, axis))))] += form[term] * line[axis]
    return result


def _over(firsts: Floats, weights: Floats) -> Floats:
    return firsts / np.where(weights > 0, weights, 1.0)


def _of_pairs(values: Floats) -> Floats:
    """Return (…, n / 2) sums over the two children of each node."""
    return values[..., ::2] + values[..., 1::2]
