"""Gauss's formula: orient the pieces of a surface, and tell how much of a closed surface they are together.

The winding number of a closed surface that faces outwards is 0 in front of it and 1 behind it, so that the mean of both
sides, the *level*, is ½ on every face. Each piece gets an unknown weight s, and least squares ask for that level:

    E(s) = Σ A_i (½ − Σ_j W_ij s_j)² + μ Σ c_ij (s_i − sign(n_i · n_j) s_j)² + λ Σ A_i s_i²

W_ij is the mean winding number of piece j at piece i, for i = j the mean of both sides. The sign of s orients.
The second term, between neighbours in one plane, is for points and small pieces, each of which alone tells little.

For points: Lin et al., Surface reconstruction from point clouds without normals by parametrizing the Gauss formula (TOG
2022); Lin, Shi and Liu, Fast and globally consistent normal orientation based on the winding number normal consistency
(TOG 2024).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats, Frozen, Ints
from ..compiled import compiled
from ..linear.conjugate_gradients import conjugate_gradients
from ..mesh.box_tree import BOXES_PER_LEAF, BoxTree, order_along_curve
from ..mesh.components import first_members, numbered, sums_of
from ..mesh.triangles import area_vectors, face_areas, halved, side_lengths
from ..mesh.unit_vectors import ANGLE_ROUNDING, unit
from ..parallel import PointTree, in_chunks
from ..search.winding_tree import WindingTree, mean_angle
from ..surfaces.plane_fits import point_spacing

WEIGHT_DAMPING = 0.01
"""λ: weight of the last term, which keeps s small for pieces without samples of the level."""
LEAST_AREA_SHARE = 1e-12
"""Lower bound of A_i in the last term, relative to the whole area, so that pieces without area get a weight, too."""
PLANE_AGREEMENT = 1.0
"""μ: weight of neighbours that lie in one plane."""
PLANE_NEIGHBORS = 12
"""Number of nearest samples that each sample is compared with in the second term."""
LEVEL_POINTS = 10_000
"""Largest number of points at which the level is sampled, besides one on each piece."""
LOOSE_DIPOLES = 64
"""More loose triangles than this near each other become dipoles; fewer get exact solid angles, by which noise is
recognized."""
TREE_FACES = 256
"""The solid angles of a piece with more faces than this are summed by a tree; those of others one by one."""
PIECE_RADII, NODE_RADII = 4.0, 2.0
"""Pieces, and nodes of the tree, act as dipoles beyond this distance, relative to their radius."""
SLENDER_TRIANGLE = 12.0
"""Triangles are halved if the square of their longest side over their area exceeds this: one
dipole must not stand for a strip. An equilateral triangle has 2.3, a strip six times as long as wide 12."""
MOST_DIPOLES = 200_000
"""Largest number of dipoles; of more faces, this many are drawn evenly."""
DIPOLES_TOGETHER = 16
"""Number of neighbouring dipoles for which the others are summed together. Eight take a fifth longer, 32 as long."""
WEIGHT_TOLERANCE = 0.02
"""Relative residual up to which the weights of dipoles are solved for. With half of it noisy loose faces take a quarter
longer, and are no better; with 0.05 a torus with much noise is a quarter worse."""


@dataclass(frozen=True, eq=False)
class Pieces(Frozen):
    """Triangles in pieces; the triangles of a piece are oriented consistently."""

    triangles: Floats  # (m, 3, 3) corners
    labels: Ints  # (m,) piece of each triangle, from 0 to k − 1

    @cached_property
    def face_areas(self) -> Floats:
        """(m,) areas."""
        return face_areas(self.triangles)

    @cached_property
    def areas(self) -> Floats:
        """(k,) area of each piece."""
        return np.bincount(self.labels, self.face_areas).astype(np.float64)


def are_soups(pieces: Pieces, clusters: Ints) -> Bools:
    """(k,) whether pieces are in clusters, (k,), that consist mostly of many loose triangles."""
    single, areas = np.bincount(pieces.labels) == 1, pieces.areas
    whole, squares, loose = (np.bincount(clusters, values) for values in (areas, areas**2, areas * single))
    return np.asarray((whole**2 > LOOSE_DIPOLES * squares) & (loose > 0.5 * whole))[clusters]


def means(values: Floats, groups: Ints, weights: Floats, n: int) -> Floats:
    """(n,) means of (m,) values in groups, numbered by (m,) `groups`, with (m,) weights."""
    total = np.bincount(groups, weights, n)
    return np.bincount(groups, weights * values, n) / np.maximum(total, np.finfo(float).tiny)


def together(fixed: Bools) -> Ints:
    """(k,) index of the unknown weight of each piece: all `fixed` pieces share unknown 0, so that none flips alone.

    Their weight is not set to 1, since a broken body has a level below ½, for which others would have to make up.
    """
    return np.where(fixed, 0, np.cumsum(~fixed) - (0 if fixed.any() else 1))


def as_fixed(weights: Floats, names: Ints, fixed: Bools) -> Floats:
    """(k,) weights of pieces: the unknowns at (k,) indices `names`, all negated if that of `fixed` pieces is < 0."""
    negated = fixed.any() and weights[0] < 0
    return np.asarray(-weights if negated else weights)[names]


@dataclass(frozen=True, eq=False)
class Matrix:
    """Matrix W of k pieces at n sample points on them, by exact solid angles."""

    matrix: Floats  # (n, k) winding number of each piece at each sample; of the sample's own piece, mean of both sides
    points: Floats  # (n, 3) sample points
    normals: Floats  # (n, 3) unit normals at the samples
    owners: Ints  # (n,) piece that each sample is on
    areas: Floats  # (n,) part of the area of its piece that each sample stands for
    within: Floats  # (n,) winding numbers of the bodies that each sample ignores

    @classmethod
    def of(cls, pieces: Pieces) -> Matrix:
        """Sample points on the pieces, and compute the winding number of each piece there."""
        faces, points = sampled(pieces, min(LEVEL_POINTS, 5_000_000 // len(pieces.areas)))  # limits the size of W
        # triangles piece by piece, where each piece starts, and the place of each given triangle
        order = np.argsort(pieces.labels, kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(pieces.labels))])
        triangles = pieces.triangles[order]
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        # pieces as dipoles: area vector, centre and radius of each
        k, owners = len(pieces.areas), pieces.labels[faces]
        vectors = sums_of(area_vectors(pieces.triangles), pieces.labels, k)
        centres = sums_of(pieces.triangles.mean(axis=1) * pieces.face_areas[:, None], pieces.labels, k)
        centres /= np.maximum(pieces.areas, np.finfo(float).tiny)[:, None]
        radii = np.zeros(k)
        reaches = np.linalg.norm(pieces.triangles - centres[pieces.labels][:, None], axis=2).max(axis=1)
        np.maximum.at(radii, pieces.labels, reaches)
        matrix, balls = np.zeros((len(points), k)), np.c_[centres, radii]
        corners = np.ascontiguousarray(triangles).reshape(-1, 9)
        _small_pieces(corners, starts, vectors, balls, points, rank[faces], matrix)
        for piece in np.flatnonzero(np.diff(starts) > TREE_FACES):
            own, begin = owners == piece, starts[piece]
            tree = WindingTree.of(triangles[begin : starts[piece + 1]])
            matrix[~own, piece] = tree.numbers(points[~own])
            matrix[own, piece] = tree.behind(rank[faces[own]] - begin, points[own]) - 0.5
        counts = np.bincount(owners, minlength=k)
        normals = unit(area_vectors(pieces.triangles[faces]))
        areas = pieces.areas[owners] / counts[owners]
        return cls(matrix, points, normals, owners, areas, within=np.zeros(len(owners)))

    def chosen(self, kept: Bools) -> Matrix:
        """Restrict the system to some of the pieces, which are renumbered."""
        if kept.all():
            return self
        rows = kept[self.owners]
        owners = (np.cumsum(kept) - 1)[self.owners[rows]]
        matrix = self.matrix[np.ix_(rows, kept)]
        return Matrix(matrix, self.points[rows], self.normals[rows], owners, self.areas[rows], self.within[rows])

    def weights(self, fixed: Bools, start: Floats | None = None) -> Floats:
        """(k,) least-squares weights, whose signs orient the pieces; the (k,) `fixed` ones get the same weight ≥ 0.

        `start` is not used, since the system is solved directly.
        """
        shares = self.areas / max(self.areas.sum(), np.finfo(float).tiny)
        unknowns, k = together(fixed), self.matrix.shape[1]
        sums = sparse.csr_array((np.ones(k), (np.arange(k), unknowns)))  # (k, unknowns): weights from the unknowns
        weighted = self.matrix * shares[:, None]
        normal = weighted.T @ self.matrix
        normal += agreement(links_of(self.points, self.normals, self.owners), shares, self.owners).toarray()
        damping = np.bincount(self.owners, shares, k)
        normal[np.diag_indices_from(normal)] += WEIGHT_DAMPING * np.maximum(damping, LEAST_AREA_SHARE)
        right_side = weighted.T @ (0.5 + self.within)
        weights = scipy.linalg.solve(sums.T @ (sums.T @ normal).T, sums.T @ right_side, assume_a="pos")
        return as_fixed(weights, unknowns, fixed)

    def levels(self, signs: Floats) -> Floats:
        """(n,) levels at the samples for (k,) signs of the pieces, without the bodies ignored there."""
        return np.asarray(self.matrix @ signs - self.within)

    def levels_within(self, signs: Floats, groups: Ints) -> Floats:
        """(n,) levels at the samples due to the pieces of their own group only; `signs` and `groups` are (k,)."""
        result = np.empty(len(self.owners))
        for group in np.unique(groups):
            members, rows = groups == group, groups[self.owners] == group
            result[rows] = self.matrix[np.ix_(rows, members)] @ signs[members]
        return result


def without_slender(pieces: Pieces) -> Pieces:
    """Halve slender triangles, up to six times and as long as there are at most `MOST_DIPOLES`.

    Triangles without area, up to rounding, are left as they are: their halves are as slender.
    """
    triangles, labels = pieces.triangles, pieces.labels
    for _ in range(6):
        squares, areas = side_lengths(triangles).max(axis=1) ** 2, face_areas(triangles)
        slender = (squares > SLENDER_TRIANGLE * areas) & (areas > ANGLE_ROUNDING * squares)
        if not slender.any() or len(triangles) + slender.sum() > MOST_DIPOLES:
            break
        triangles = np.concatenate([triangles[~slender], halved(triangles[slender])])
        labels = np.concatenate([labels[~slender], labels[slender], labels[slender]])
    return Pieces(triangles, labels)


def elements(pieces: Pieces) -> tuple[Pieces, Ints]:
    """Return the pieces with slender triangles halved, and (n,) all their triangles, or `MOST_DIPOLES` drawn evenly."""
    pieces = without_slender(pieces)
    n = len(pieces.triangles)
    return pieces, np.arange(n) if n <= MOST_DIPOLES else np.unique(sampled(pieces, MOST_DIPOLES)[0])


def sampled(pieces: Pieces, count: int) -> tuple[Ints, Floats]:
    """Sample points on pieces: (n,) the faces they are on, and (n, 3) positions.

    There is one on each piece, and about `count` more: half of them are shared out by area, half evenly.
    """
    shares = pieces.areas / max(pieces.areas.sum(), np.finfo(float).tiny)
    numbers = 1 + np.floor(0.5 * count * (shares + 1 / len(shares))).astype(np.int64)
    faces = _faces_drawn(pieces, numbers)
    # points on one face, which follow each other, are spread over it by Roberts's sequence R₂, from its centre on; it
    # is folded from the parallelogram of the sides into the triangle
    same = np.concatenate([[False], faces[1:] == faces[:-1]])
    place = np.arange(len(faces)) - np.maximum.accumulate(np.where(same, 0, np.arange(len(faces))))
    u, v = (1 / 3 + place * 0.7548776662466927) % 1.0, (1 / 3 + place * 0.5698402909980532) % 1.0
    beyond = u + v > 1
    u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
    a, b, c = _corners_in_order(pieces.triangles[faces])
    return faces, a + u[:, None] * (b - a) + v[:, None] * (c - a)


def _faces_drawn(pieces: Pieces, numbers: Ints) -> Ints:
    """(n,) faces for points on pieces, piece by piece; `numbers`, (k,), are those of the points.

    The faces of a piece follow each other along a space-filling curve, each over a length that is its area. The points
    are at equal distances on this line.
    """
    order = order_along_curve(pieces.triangles.mean(axis=1), pieces.labels)
    owners, number = numbered(numbers)
    share = (number + 0.5) / numbers[owners]  # of the area of the piece that comes before the point
    ends = np.cumsum(pieces.face_areas[order])
    lasts = np.cumsum(np.bincount(pieces.labels, minlength=len(numbers))) - 1
    firsts = np.concatenate([[0], lasts[:-1] + 1])
    begins = np.concatenate([[0.0], ends[lasts[:-1]]])
    rows = np.searchsorted(ends, begins[owners] + share * (ends[lasts] - begins)[owners])
    return order[np.clip(rows, firsts[owners], lasts[owners])]


def _corners_in_order(triangles: Floats) -> Floats:
    """(3, n, 3) corners of (n, 3, 3) triangles in an order that does not depend on how they are given.

    They are sorted by the length of the opposite side, and by position where sides are equal up to rounding.
    """
    opposite = np.linalg.norm(np.roll(triangles, -1, axis=1) - np.roll(triangles, 1, axis=1), axis=2)
    opposite = np.round(opposite / np.maximum(opposite.max(axis=1, keepdims=True), np.finfo(float).tiny), 9)
    x, y, z = triangles.transpose(2, 0, 1)
    order = np.lexsort((z, y, x, opposite), axis=1)
    return np.take_along_axis(triangles, order[..., None], axis=1).transpose(1, 0, 2)


@compiled
def _small_pieces(
    corners: Floats, starts: Ints, vectors: Floats, balls: Floats, points: Floats, own: Ints, matrix: Floats
) -> None:
    """Write winding numbers of pieces of at most `TREE_FACES` faces at (n, 3) points into the (n, k) matrix.

    `corners` are (m, 9), piece by piece from `starts`, (k + 1,). `vectors` are (k, 3) area vectors, and `balls` (k, 4)
    centres and radii: at points beyond `PIECE_RADII` radii a piece is a dipole. `own` is the face each point is on.
    """
    for piece in range(len(starts) - 1):
        begin, end = starts[piece], starts[piece + 1]
        if end - begin > TREE_FACES:
            continue
        beyond = (PIECE_RADII * balls[piece, 3]) ** 2
        for p in range(len(points)):
            dx, dy, dz = balls[piece, 0] - points[p, 0], balls[piece, 1] - points[p, 1], balls[piece, 2] - points[p, 2]
            square = dx * dx + dy * dy + dz * dz
            if square > beyond:
                flux = dx * vectors[piece, 0] + dy * vectors[piece, 1] + dz * vectors[piece, 2]
                matrix[p, piece] = flux / (4.0 * np.pi * square * np.sqrt(square))
                continue
            angle = 0.0
            for f in range(begin, end):
                if f != own[p]:
                    angle += mean_angle(corners, f, points[p, 0], points[p, 1], points[p, 2])
            matrix[p, piece] = angle / (4.0 * np.pi)


class Links(NamedTuple):
    """Pairs of neighbouring samples on different pieces, and how strongly each pair asks for agreement."""

    tails: Ints  # (p,) samples
    heads: Ints  # (p,) samples
    strength: Floats  # (p,) from −1 to 1, negative where the normals point apart

    def chosen(self, rows: Bools) -> Links:
        """Restrict the pairs to samples for which `rows`, (n,), is true; these are renumbered in order."""
        numbers, kept = np.cumsum(rows) - 1, rows[self.tails] & rows[self.heads]
        return Links(numbers[self.tails[kept]], numbers[self.heads[kept]], self.strength[kept])


class Walk(NamedTuple):
    """A tree of dipoles, and the nodes by which their field is summed for each group of neighbouring dipoles."""

    points: Floats  # (n, 3) positions of the dipoles
    softening: Floats  # (n,) see `Dipoles`
    items: Ints  # (leaves · `BOXES_PER_LEAF`,) the dipoles in each leaf; −1 where it has fewer
    balls: Floats  # (2 · leaves, 4) see `Dipoles.balls`
    order: Ints  # (n,) the dipoles in the order of the tree; each `together` of them are a group
    starts: Ints  # (groups + 1,) where the nodes of each group begin in `nodes`
    nodes: NDArray[np.int32]  # see `_nodes_for`
    together: int  # number of dipoles in a group


@dataclass(frozen=True, eq=False)
class Dipoles:
    """The map W of many small faces or points, as dipoles softened at the scale of the distance to neighbours."""

    points: Floats  # (n, 3) positions of the dipoles, at which the level is sampled, too
    normals: Floats  # (n, 3) unit normals
    areas: Floats  # (n,) area of each dipole
    owners: Ints  # (n,) piece that each dipole is part of
    softening: Floats  # (n,) distance below which the field of a dipole levels off
    within: Floats  # (n,) winding numbers of the bodies that are ignored at each dipole
    links: Links  # neighbours among all dipoles that were made: to find them again takes longer than to solve

    @classmethod
    def of_triangles(cls, pieces: Pieces) -> Dipoles:
        """Make a dipole for each of the `elements` of pieces."""
        pieces, faces = elements(pieces)
        areas = pieces.face_areas
        if len(faces) < len(areas):
            kept = np.bincount(pieces.labels[faces], areas[faces], len(pieces.areas))
            areas = areas * (pieces.areas / np.maximum(kept, np.finfo(float).tiny))[pieces.labels]
        triangles = pieces.triangles[faces]
        points = triangles.mean(axis=1)
        normals, owners, none = unit(area_vectors(triangles)), pieces.labels[faces], np.zeros(len(faces))
        return cls(points, normals, areas[faces], owners, spacing(points), none, links_of(points, normals, owners))

    @cached_property
    def tree(self) -> BoxTree:
        """Tree over the positions."""
        return BoxTree.of(self.points, self.points)

    @cached_property
    def balls(self) -> Floats:
        """(2 · leaves, 4) middle of each node's box, and the squared distance beyond which the node is one dipole."""
        low, high = self.tree.bounds[:, :3], self.tree.bounds[:, 3:]
        with np.errstate(invalid="ignore"):  # nodes without points have infinite bounds
            radii = 0.5 * np.linalg.norm(high - low, axis=1) + float(np.median(self.softening))
            balls = np.concatenate([0.5 * (low + high), (NODE_RADII * radii[:, None]) ** 2], axis=1)
        return np.where(np.isfinite(balls), balls, 0.0)

    def chosen(self, kept: Bools) -> Dipoles:
        """Restrict the system to some of the pieces, which are renumbered."""
        rows = kept[self.owners]
        owners = (np.cumsum(kept) - 1)[self.owners[rows]]
        values = (self.points, self.normals, self.areas, self.softening, self.within)
        points, normals, areas, softening, within = (array[rows] for array in values)
        return Dipoles(points, normals, areas, owners, softening, within, self.links.chosen(rows))

    def weights(self, fixed: Bools, start: Floats | None = None) -> Floats:
        """(k,) least-squares weights by conjugate gradients, from `start` or from zero.

        Their signs orient the pieces; the (k,) `fixed` ones get the same weight ≥ 0.
        """
        shares = self.areas / max(self.areas.sum(), np.finfo(float).tiny)
        laplacian, unknowns = agreement(self.links, shares, self.owners), together(fixed)
        n = int(unknowns.max()) + 1
        damping = WEIGHT_DAMPING * np.bincount(self.owners, shares)

        def system(values: Floats) -> Floats:
            """Multiply the matrix of the least-squares problem by values of the unknowns."""
            weights = values[unknowns]
            gradient = self._adjoint(shares * self._numbers(weights)) + laplacian @ weights + damping * weights
            return sums_of(gradient, unknowns, n)

        inverse = 1.0 / np.maximum(sums_of(laplacian.diagonal() + damping, unknowns, n), np.finfo(float).tiny)
        right_side = sums_of(self._adjoint((0.5 + self.within) * shares), unknowns, n)
        first_guess = None if start is None else start[first_members(unknowns, n)]
        goal = WEIGHT_TOLERANCE * np.linalg.norm(inverse * right_side)  # pieces count alike, however large others are
        weights = conjugate_gradients(
            system,
            right_side,
            lambda rest: inverse * rest,
            first_guess,
            tolerance=0.0,
            converged=lambda _, rest: bool(np.linalg.norm(inverse * rest) <= goal),
        )
        return as_fixed(weights, unknowns, fixed)

    def levels(self, signs: Floats) -> Floats:
        """(n,) levels at the dipoles for (k,) signs of the pieces, without the bodies ignored there."""
        return self._numbers(signs) - self.within

    def _numbers(self, signs: Floats) -> Floats:
        """(n,) winding number at each dipole due to all others, for (k,) weights of the pieces."""
        vectors = self.normals * (self.areas * signs[self.owners])[:, None]
        nodes = self._sums(vectors)
        return self._at_dipoles(partial(_potentials, self._walk, vectors, nodes)) / (4.0 * np.pi)

    def levels_within(self, signs: Floats, groups: Ints) -> Floats:
        """(n,) zeros in place of levels due to their own group only; `signs` and `groups` are (k,), as for `Matrix`.

        With zeros, no group counts as a body by itself: dipoles stand for loose triangles, which are judged cluster by
        cluster.
        """
        return np.zeros(len(self.owners))

    def _adjoint(self, charges: Floats) -> Floats:
        """Multiply (n,) charges at the dipoles by the transpose of W: (k,) fluxes of their field through the pieces."""
        away = self.points - self.balls[1, :3]  # from the middle of the root, so that moments can be added
        nodes = self._sums(np.c_[charges, charges[:, None] * away])
        nodes[:, 1:] -= nodes[:, :1] * (self.balls[:, :3] - self.balls[1, :3])  # moments about the middles of nodes
        field = self._at_dipoles(partial(_fields, self._walk, charges, nodes))
        flux = self.areas * (field * self.normals).sum(axis=1) / (4.0 * np.pi)
        return np.bincount(self.owners, flux).astype(np.float64)

    @cached_property
    def _walk(self) -> Walk:
        """The tree, and the nodes for each group; the same for all products with W."""
        order = self.tree.items[self.tree.items >= 0]
        nodes = _nodes_for(self.points[order], self.balls, DIPOLES_TOGETHER)
        return Walk(self.points, self.softening, self.tree.items, self.balls, order, *nodes, DIPOLES_TOGETHER)

    def _at_dipoles(self, kernel: Callable[[Ints], Floats]) -> Floats:
        """(n, ...) values of a kernel at all dipoles; it is given ranges of indices into the order of the tree."""
        (in_tree_order,) = in_chunks(lambda rows: (kernel(rows),), np.arange(len(self.points)))
        values = np.empty_like(in_tree_order)
        values[self._walk.order] = in_tree_order
        return values

    def _sums(self, values: Floats) -> Floats:
        """(2 · leaves, d) sums of (n, d) values of the dipoles below each node of the tree."""
        leaves = len(self.tree.items) // BOXES_PER_LEAF
        sums = np.zeros((2 * leaves, values.shape[1]))
        filled = self.tree.items >= 0
        np.add.at(sums, leaves + np.flatnonzero(filled) // BOXES_PER_LEAF, values[self.tree.items[filled]])
        level = leaves
        while level > 1:  # nodes of a level are as many as its first number; node k has the children 2 k and 2 k + 1
            sums[level // 2 : level] = sums[level : 2 * level].reshape(-1, 2, values.shape[1]).sum(axis=1)
            level //= 2
        return sums


def links_of(points: Floats, normals: Floats, owners: Ints) -> Links:
    """Link (n, 3) samples with neighbours on other pieces that lie roughly in one plane with them.

    `normals` are (n, 3) unit vectors, and `owners` the (n,) pieces that samples lie on. Links are strong where normals
    are parallel, and the direction to the neighbour is perpendicular to both; from 30° on they are 0.
    """
    n, k = len(points), min(PLANE_NEIGHBORS, len(points) - 1)
    near = PointTree(points).query(points, k + 1)[1].reshape(n, -1)[:, 1:]
    tails, heads = np.repeat(np.arange(n), k), near.ravel()
    apart = owners[tails] != owners[heads]
    tails, heads = tails[apart], heads[apart]
    directions = unit(points[heads] - points[tails])
    cosines = (normals[tails] * normals[heads]).sum(axis=1)
    rises = [np.abs((directions * normals[ends]).sum(axis=1)) for ends in (tails, heads)]
    return Links(tails, heads, np.maximum(0.0, 1.0 - 2.0 * np.maximum(*rises)) * cosines * np.abs(cosines))


def agreement(links: Links, shares: Floats, owners: Ints) -> sparse.csr_array:
    """(k, k) matrix of the second term of E: a signed graph Laplacian of the pieces, times μ.

    `links` join pairs of the n samples, with strengths from −1 to 1 that are negative where normals point apart. A link
    is weaker the more samples its pieces have. `owners`, (n,), are the k pieces that samples lie on, and `shares`,
    (n,), the shares of the whole area that they stand for.
    """
    (tails, heads, strength), n = links, len(owners)
    total = np.bincount(tails, np.abs(strength), n) + np.bincount(heads, np.abs(strength), n)
    scale = np.sqrt(shares / np.maximum(total, 1e-12))
    counts = np.bincount(owners)[owners]  # points of two large pieces may be farther apart than the pieces are
    weights = strength * PLANE_AGREEMENT * scale[tails] * scale[heads] / np.minimum(counts[tails], counts[heads])
    size = int(owners.max()) + 1
    sums = sparse.coo_array((weights, (owners[tails], owners[heads])), shape=(size, size)).tocsr()
    sums = sums + sums.T
    degrees = np.asarray(abs(sums).sum(axis=1), dtype=np.float64).ravel()
    return (sparse.diags_array(degrees) - sums).tocsr()


def spacing(points: Floats) -> Floats:
    """(n,) spacing of (n, 3) points around each of them, from the distance to its fourth neighbour."""
    k = min(4, len(points) - 1)
    return point_spacing(PointTree(points).query(points, [k + 1])[0][:, 0], k) if k else np.ones(len(points))


@compiled
def _nodes_for(points: Floats, balls: Floats, together: int) -> tuple[Ints, NDArray[np.int32]]:
    """List the tree nodes that act on each group of `together` successive points of (n, 3).

    Return where the list of each group begins and ends, (groups + 1,), and the concatenated lists. A node that all
    points of the group are far from is listed by its number, and acts as one dipole. A leaf near some of them is listed
    by minus its number, and its items count one by one.
    """
    leaves, stack, count = len(balls) // 2, np.empty(64, dtype=np.int64), 0
    starts, nodes = np.zeros(-(-len(points) // together) + 1, dtype=np.int64), np.empty(leaves, dtype=np.int32)
    x, y, z = np.empty(together), np.empty(together), np.empty(together)
    for begin in range(0, len(points), together):
        if count + leaves > len(nodes):
            more = np.empty(2 * len(nodes) + leaves, dtype=np.int32)
            more[:count] = nodes[:count]
            nodes = more
        for k in range(together):
            p = min(begin + k, len(points) - 1)
            x[k], y[k], z[k] = points[p, 0], points[p, 1], points[p, 2]
        stack[0], depth = 1, 1
        while depth > 0:
            depth -= 1
            node, near = stack[depth], 0  # near: number of points for which the node is not one dipole
            ax, ay, az, square = balls[node, 0], balls[node, 1], balls[node, 2], balls[node, 3]
            for k in range(together):
                dx, dy, dz = ax - x[k], ay - y[k], az - z[k]
                near += 1 if dx * dx + dy * dy + dz * dz <= square else 0
            if near > 0 and node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
            else:
                nodes[count] = -node if near > 0 else node
                count += 1
        starts[begin // together + 1] = count
    return starts, nodes[:count]


@compiled
def _potentials(walk: Walk, vectors: Floats, sums_below: Floats, rows: Ints) -> Floats:
    """(k,) sums of ``v · d / (|d|² + ε²)^(3/2)`` over all other dipoles v, with d the vector from a point to v.

    The points are those at `rows` of the walk's order, which begin at a multiple of `together`. `vectors` are (n, 3),
    `sums_below` their (2 · leaves, 3) sums below nodes.
    """
    points, softening, items, balls, order, starts, nodes, together = walk
    leaves, result = len(balls) // 2, np.empty(len(rows))
    x, y, z, sums = np.empty(together), np.empty(together), np.empty(together), np.empty(together)
    for begin in range(0, len(rows), together):
        for k in range(together):
            p = order[rows[min(begin + k, len(rows) - 1)]]
            x[k], y[k], z[k], sums[k] = points[p, 0], points[p, 1], points[p, 2], 0.0
        group = rows[begin] // together
        for node in nodes[starts[group] : starts[group + 1]]:
            if node > 0:  # all that is below it, at its middle
                ax, ay, az = balls[node, 0], balls[node, 1], balls[node, 2]
                vx, vy, vz = sums_below[node, 0], sums_below[node, 1], sums_below[node, 2]
                for k in range(together):
                    dx, dy, dz = ax - x[k], ay - y[k], az - z[k]
                    square = dx * dx + dy * dy + dz * dz
                    sums[k] += (dx * vx + dy * vy + dz * vz) / (square * np.sqrt(square))
            else:  # the items of a leaf, one by one
                for item in range((-node - leaves) * BOXES_PER_LEAF, (-node - leaves + 1) * BOXES_PER_LEAF):
                    e = items[item]
                    if e < 0:
                        continue
                    ax, ay, az, soft = points[e, 0], points[e, 1], points[e, 2], softening[e] ** 2
                    vx, vy, vz = vectors[e, 0], vectors[e, 1], vectors[e, 2]
                    for k in range(together):  # a dipole adds nothing at its own position, where d = 0
                        dx, dy, dz = ax - x[k], ay - y[k], az - z[k]
                        square = dx * dx + dy * dy + dz * dz + soft
                        square = square if square > 0.0 else 1.0
                        sums[k] += (dx * vx + dy * vy + dz * vz) / (square * np.sqrt(square))
        for k in range(min(together, len(rows) - begin)):
            result[begin + k] = sums[k]
    return result


@compiled
def _fields(walk: Walk, charges: Floats, sums_below: Floats, rows: Ints) -> Floats:
    """(k, 3) sums of ``c d / (|d|² + ε²)^(3/2)`` over all other charges c, with d the vector from c to a point.

    The points are those at `rows` of the walk's order, which begin at a multiple of `together`; ε is the softening at
    the point. `charges` are (n,), `sums_below` (2 · leaves, 4) charges and dipole moments of nodes.
    """
    points, softening, items, balls, order, starts, nodes, together = walk
    leaves, result = len(balls) // 2, np.empty((len(rows), 3))
    x, y, z, soft = np.empty(together), np.empty(together), np.empty(together), np.empty(together)
    fx, fy, fz = np.empty(together), np.empty(together), np.empty(together)
    for begin in range(0, len(rows), together):
        for k in range(together):
            p = order[rows[min(begin + k, len(rows) - 1)]]
            x[k], y[k], z[k], soft[k] = points[p, 0], points[p, 1], points[p, 2], softening[p] ** 2
            fx[k], fy[k], fz[k] = 0.0, 0.0, 0.0
        group = rows[begin] // together
        for node in nodes[starts[group] : starts[group + 1]]:
            if node > 0:  # all that is below it, at its middle
                ax, ay, az = balls[node, 0], balls[node, 1], balls[node, 2]
                # the field c d / r³ of a charge, and 3 (d · m) d / r⁵ − m / r³ of a dipole moment
                charge, mx = sums_below[node, 0], sums_below[node, 1]
                my, mz = sums_below[node, 2], sums_below[node, 3]
                for k in range(together):
                    dx, dy, dz = x[k] - ax, y[k] - ay, z[k] - az
                    square = dx * dx + dy * dy + dz * dz
                    cube = 1.0 / (square * np.sqrt(square))
                    straight = (charge + 3.0 * (dx * mx + dy * my + dz * mz) / square) * cube
                    fx[k] += straight * dx - mx * cube
                    fy[k] += straight * dy - my * cube
                    fz[k] += straight * dz - mz * cube
            else:  # the items of a leaf, one by one
                for item in range((-node - leaves) * BOXES_PER_LEAF, (-node - leaves + 1) * BOXES_PER_LEAF):
                    e = items[item]
                    if e < 0:
                        continue
                    ax, ay, az, charge = points[e, 0], points[e, 1], points[e, 2], charges[e]
                    for k in range(together):
                        dx, dy, dz = x[k] - ax, y[k] - ay, z[k] - az
                        square = dx * dx + dy * dy + dz * dz + soft[k]
                        square = square if square > 0.0 else 1.0
                        share = charge / (square * np.sqrt(square))
                        fx[k] += share * dx
                        fy[k] += share * dy
                        fz[k] += share * dz
        for k in range(min(together, len(rows) - begin)):
            result[begin + k, 0], result[begin + k, 1], result[begin + k, 2] = fx[k], fy[k], fz[k]
    return result
