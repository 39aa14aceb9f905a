"""What the ends of pieces of broken curves on surfaces tell about each other's directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..domains.curves import Curve, CurveOrPoints
from ..geometry.curve_segments import CurveSegments, interpolation_at
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..geometry.synchronization import synchronize_signs
from ..lowering.surface.discretization import SurfaceDiscretization
from .curve_windings import Windings

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
    windings : Windings
        Of the pieces and, after them, of the other oriented curves, which are complete.
    """

    pieces: NDArray[np.int64]
    inner: NDArray[np.bool_]
    pairs: sparse.csr_matrix
    own: NDArray[np.float64]
    lengths: NDArray[np.float64]
    windings: Windings

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveOrPoints]) -> Votes:
        """Ask all pieces: one solve with the factor of C for each."""
        listed = {k: c for k, c in enumerate(curves) if isinstance(c, Curve) and c.oriented}
        parts = {k: part for k, (part,) in zip(listed, surface.segments([[c] for c in listed.values()]), strict=True)}
        charges = {k: charge(surface, curve, parts[k]) for k, curve in listed.items()}
        outer = outer_ends(surface.triangles, list(parts.values()))
        is_piece = np.array([charges[k].nnz > 0 for k in listed], dtype=bool) & (outer < 2)
        numbers = np.array(list(listed), dtype=np.int64)
        pieces = numbers[is_piece]
        if not len(pieces):
            return cls.none(surface)
        pairs, own = _pairs(surface, sparse.csr_matrix(sparse.vstack([charges[k] for k in pieces.tolist()])))
        ordered = [parts[k] for k in (*pieces.tolist(), *numbers[~is_piece].tolist())]
        lengths = np.array([part.lengths.sum() for part in ordered[: len(pieces)]])
        return cls(pieces, outer[is_piece] == 0, pairs, own, lengths, Windings.of(surface, ordered))

    @classmethod
    def none(cls, surface: SurfaceDiscretization) -> Votes:
        """Of no pieces."""
        nothing, empty, numbers = np.empty(0), sparse.csr_matrix((0, 0)), np.empty(0, dtype=np.int64)
        windings = Windings(surface, empty, empty, numbers)
        return cls(numbers, nothing.astype(bool), empty, nothing, nothing, windings)

    @property
    def are_several(self) -> bool:
        """Whether there are pieces, and other oriented curves that tell about them, pieces or not."""
        return len(self.pieces) > 0 and len(self.windings.parts) > 1

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


def charge(surface: SurfaceDiscretization, curve: Curve, part: CurveSegments) -> sparse.csr_matrix:
    """(1, n) q: +1 where an oriented curve ends, −1 where it begins, if left of it is positive; 0 if it is closed."""
    if curve.closed or part.ends[0, 0] == part.ends[-1, 1]:
        return sparse.csr_matrix((1, surface.triangles.n_vertices))
    right = False
    if curve.normals is not None:
        ((plain,),) = surface.segments([[Curve(curve.faces, curve.barycentric)]])
        right = (np.conj(plain.vectors) * part.vectors).real.sum() < 0
    at = interpolation_at(surface.triangles, part.nodes[part.ends[[0, -1], [0, 1]]])
    return sparse.csr_matrix(at[0] - at[1] if right else at[1] - at[0])


def outer_ends(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> NDArray[np.int64]:
    """(k,) how many ends of curves lie on the boundary of the surface, or on nonmanifold edges."""
    at_boundary = np.zeros(triangles.n_vertices, dtype=bool)
    edges = triangles.edges
    at_boundary[edges.vertices[edges.face_counts != 2]] = True  # across three faces no direction goes on to the others
    found = np.zeros(len(parts), dtype=np.int64)
    for k, part in enumerate(parts):
        at = interpolation_at(triangles, part.nodes[part.ends[[0, -1], [0, 1]]])
        found[k] = sum(bool(at_boundary[at[end].indices].all()) for end in (0, 1))
    return found


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
    stay = AS_GIVEN * lengths / max(float(lengths.mean()), 1e-300)  # of one more node, which stands for "as given"
    signs = synchronize_signs(
        np.concatenate([tails, np.arange(k)]),
        np.concatenate([heads, np.full(k, k)]),
        np.concatenate([weights / 2, stay]),
        k + 1,
    )
    result: NDArray[np.float64] = signs[:k] * signs[k]
    return result
