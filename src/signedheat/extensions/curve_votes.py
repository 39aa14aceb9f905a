"""What the ends of pieces of broken curves on surfaces tell about each other's directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..domains.curves import Curve, CurveOrPoints
from ..geometry.curve_segments import interpolation_at
from ..geometry.synchronization import nested_groups, synchronize_signs
from ..lowering.surface.discretization import SurfaceDiscretization

AS_GIVEN = 0.02
"""Vote of a piece of mean length for its own direction. Pieces that follow each other at their length have about .1."""
BLOCK = 64
"""Pieces whose potential is solved for at a time."""
NEAREST = 64
"""Pieces with the strongest votes on each that are asked."""


@dataclass(frozen=True, eq=False)
class Votes:
    """What the pieces of curves tell about each other's directions.

    Attributes
    ----------
    pieces : (k,) int
        Which of the curves are pieces: oriented, open, and not from boundary to boundary of the surface.
    inner : (k,) bool
        Whether both ends of a piece lie away from the boundary.
    pairs : (k, k) sparse
        Minus ``⟨q_i, C⁻¹ q_j⟩``, the strongest in each row: positive if the directions of both agree.
    own : (k,) float
        ``⟨q_i, C⁻¹ q_i⟩``.
    lengths : (k,) float
        Of the pieces.
    """

    pieces: NDArray[np.int64]
    inner: NDArray[np.bool_]
    pairs: sparse.csr_matrix
    own: NDArray[np.float64]
    lengths: NDArray[np.float64]

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveOrPoints]) -> Votes:
        """Ask all pieces: one solve with the factor of C for each."""
        is_open = [k for k, c in enumerate(curves) if isinstance(c, Curve) and c.oriented and not c.closed]
        none = np.empty(0)
        if len(is_open) < 2:
            return cls(none.astype(np.int64), none.astype(bool), sparse.csr_matrix((0, 0)), none, none)
        charges, lengths, outer = _charges(surface, [curves[k] for k in is_open])
        asked = np.flatnonzero(outer < 2)
        pairs, own = _pairs(surface, sparse.csr_matrix(charges[asked]))
        return cls(np.array(is_open)[asked], outer[asked] == 0, pairs, own, lengths[asked])

    def counted(self, among: NDArray[np.int64] | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(j,) directions ±1 relative to those given, and (j,) agreement, of some of the pieces with each other."""
        chosen = np.arange(len(self.pieces)) if among is None else among
        pairs = sparse.csr_matrix(self.pairs[chosen][:, chosen])
        signs = _signs(pairs, self.lengths[chosen])
        return signs, self.agreement(signs, chosen)

    def agreement(self, signs: NDArray[np.float64], among: NDArray[np.int64]) -> NDArray[np.float64]:
        """(j,) how well each of some of the pieces is completed by others, if they have these directions."""
        pairs = sparse.csr_matrix(self.pairs[among][:, among])
        agreed = np.asarray(pairs.multiply(signs[:, None]).multiply(signs[None]).sum(axis=1)).ravel()
        return np.clip(agreed / np.maximum(self.own[among], 1e-300), 0.0, 1.0)

    def told(self, among: NDArray[np.int64], one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        """How much better some of the pieces agree with the rest in one choice of directions than in another: from −1
        to 1, of the energy of the fewer that were turned.
        """
        pairs = sparse.csr_matrix(self.pairs[among][:, among])
        gain = 0.5 * float(one @ (pairs @ one) - other @ (pairs @ other))
        own = self.own[among]
        return gain / max(min(float(own[one != other].sum()), float(own[one == other].sum())), 1e-300)

    def groups(self, among: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        """Groups of some of the pieces that tell most about each other, each (j,) group of every piece, large first."""
        tails, heads, weights = sparse.find(self.pairs[among][:, among])
        return nested_groups(tails, heads, weights, len(among))


def _charges(
    surface: SurfaceDiscretization, pieces: Sequence[CurveOrPoints]
) -> tuple[sparse.csr_matrix, NDArray[np.float64], NDArray[np.int64]]:
    """(k, n) q: +1 where each piece ends, −1 where it begins, with its positive side to its left; (k,) lengths; and
    (k,) how many of its ends lie on the boundary of the surface, or on nonmanifold edges.
    """
    rows, lengths, outer = [], [], []
    at_boundary = np.zeros(surface.triangles.n_vertices, dtype=bool)
    edges = surface.triangles.edges
    at_boundary[edges.vertices[edges.face_counts != 2]] = True  # across three faces no direction goes on to the others
    for piece in pieces:
        assert isinstance(piece, Curve)
        ((part,),) = surface.segments([[piece]])
        tips = part.nodes[np.array([part.ends[0, 0], part.ends[-1, 1]])]
        at = interpolation_at(surface.triangles, tips)
        right = False
        if piece.normals is not None:
            ((plain,),) = surface.segments([[Curve(piece.faces, piece.barycentric)]])
            right = (np.conj(plain.vectors) * part.vectors).real.sum() < 0
        rows.append(at[0] - at[1] if right else at[1] - at[0])
        lengths.append(part.lengths.sum())
        outer.append(sum(bool(at_boundary[at[k].indices].all()) for k in (0, 1)))
    return sparse.csr_matrix(sparse.vstack(rows)), np.array(lengths), np.array(outer)


def _pairs(surface: SurfaceDiscretization, charges: sparse.csr_matrix) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
    """(k, k) minus ``⟨q_i, C⁻¹ q_j⟩``, the strongest in each row; and (k,) ``⟨q_i, C⁻¹ q_i⟩``.

    The charges of a piece add up to zero, so that the constant up to which C⁻¹ is defined does not matter.
    """
    k, factor = charges.shape[0], surface.integration.factor
    own, rows, columns, values = np.empty(k), [], [], []
    for begin in range(0, k, BLOCK):
        block = np.arange(begin, min(begin + BLOCK, k))
        potential = factor.solve(np.asfortranarray(charges[block].T.toarray()))
        energy = np.asarray(charges @ potential).T
        own[block] = energy[np.arange(len(block)), block]
        energy[np.arange(len(block)), block] = 0.0
        order = np.argsort(-np.abs(energy), axis=1, kind="stable")[:, :NEAREST]
        rows.append(np.repeat(block, order.shape[1]))
        columns.append(order.ravel())
        values.append(-np.take_along_axis(energy, order, axis=1).ravel())
    if not rows:
        return sparse.csr_matrix((0, 0)), own
    found = sparse.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(k, k))
    return found, own


def _signs(votes: sparse.csr_matrix, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) ±1, relative to the directions that the pieces were given with."""
    k = len(lengths)
    tails, heads, weights = sparse.find(votes)
    stay = (
        AS_GIVEN * lengths / max(float(lengths.mean()), 1e-300)
    )  # votes of one more node, which stands for "as given"
    signs = synchronize_signs(
        np.concatenate([tails, np.arange(k)]),
        np.concatenate([heads, np.full(k, k)]),
        np.concatenate([weights / 2, stay]),
        k + 1,
    )
    result: NDArray[np.float64] = signs[:k] * signs[k]
    return result
