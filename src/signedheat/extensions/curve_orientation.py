"""Orientation of the pieces of broken curves on surfaces: where one ends, another should begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..discretization import discretize
from ..domains.curves import Curve, CurveOrPoints
from ..domains.kinds import SurfaceDomain
from ..errors import UnsupportedTypeError
from ..frozen import Frozen
from ..geometry.curve_segments import interpolation_at
from ..geometry.synchronization import synchronize_signs
from ..linear import factorize
from ..lowering.surface.discretization import SurfaceDiscretization
from ..reprs import ShortRepr

AS_GIVEN = 0.02
"""Vote of a piece of mean length for its own direction. Pieces that follow each other at their length have about .1."""
BLOCK = 64
"""Pieces whose potential is solved for at a time."""
NEAREST = 64
"""Pieces with the strongest votes on each that are asked."""


@dataclass(frozen=True, eq=False, repr=False)
class CurveOrientation(Frozen, ShortRepr):
    """How the pieces of a broken curve were oriented.

    Attributes
    ----------
    curves : list of Curve and SurfacePoints
        All that was given, in order, some curves turned.
    turned : (k,) bool
        Which of them were turned.
    agreement : (k,) float
        How well each is completed by others: 1 if pieces begin where it ends and end where it begins, about 0 if it
        lies by itself, as spurious pieces often do; 1 for closed curves, unoriented ones and points.
    """

    curves: list[CurveOrPoints]
    turned: NDArray[np.bool_]
    agreement: NDArray[np.float64]

    def agreeing(self, least: float) -> list[CurveOrPoints]:
        """The curves that agree with others at least that well."""
        return [curve for curve, found in zip(self.curves, self.agreement, strict=True) if found >= least]


def curve_orientation(curves: Sequence[CurveOrPoints], domain: SurfaceDomain) -> CurveOrientation:
    """Turn the pieces of broken curves so that each begins where another ends.

    The boundary of a region has no ends. What its pieces lack of that is measured by ``⟨q, C⁻¹ q⟩``, where q is +1 at
    the end and −1 at the beginning of every piece and C the Laplacian: the energy of charges, which is small where
    opposite charges are close to each other. Directions s = ±1 that make the energy of ``Σ s_i q_i`` small are found
    from its pairwise terms (`synchronize_signs`), to which every piece adds a weak vote for its own direction. Only
    ends count, so that curves that run beside each other hardly disturb, unless their gaps lie side by side.

    Curves that are complete, unoriented curves and points stay as they are. Pieces of different curves that are far
    from each other have the direction that most of their length was given with.

    Takes one factorisation, and one solve for each piece.

    Parameters
    ----------
    curves : sequence of Curve and SurfacePoints
        The pieces.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that they lie on, its faces consistently oriented, or the curves with normals.

    Raises
    ------
    SourceError
        If a curve does not fit the surface.
    UnsupportedTypeError
        If the domain is no surface.

    Examples
    --------
    >>> from signedheat.samples import torus
    >>> mesh = torus(n_around=48, n_across=24)
    >>> pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    >>> pieces[1] = pieces[1].reversed()
    >>> curve_orientation(pieces, mesh).turned
    array([False,  True, False, False])
    """
    surface = discretize(domain)
    if not isinstance(surface, SurfaceDiscretization):
        raise UnsupportedTypeError(
            f"curves are oriented on surfaces, not on a {type(domain).__name__}", element="domain"
        )
    listed = list(curves)
    turned, agreement = np.zeros(len(listed), dtype=bool), np.ones(len(listed))
    pieces = [k for k, curve in enumerate(listed) if isinstance(curve, Curve) and curve.oriented and not curve.closed]
    if len(pieces) > 1:
        charges, lengths = _charges(surface, [listed[k] for k in pieces])
        votes, own = _votes(surface, charges)
        signs = _signs(votes, lengths)
        turned[pieces] = signs < 0
        agreed = votes.multiply(signs[:, None]).multiply(signs[None])
        agreement[pieces] = np.clip(np.asarray(agreed.sum(axis=1)).ravel() / np.maximum(own, 1e-300), 0.0, 1.0)
    made = [_turned(curve) if turn else curve for curve, turn in zip(listed, turned, strict=True)]
    return CurveOrientation(made, turned, agreement)


def _turned(curve: CurveOrPoints) -> CurveOrPoints:
    """A curve with its positive side negative."""
    assert isinstance(curve, Curve)
    if curve.normals is None:
        return curve.reversed()
    return Curve(curve.faces, curve.barycentric, curve.closed, curve.oriented, -curve.normals)


def _charges(
    surface: SurfaceDiscretization, pieces: Sequence[CurveOrPoints]
) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
    """(k, n) q: +1 where each piece ends, −1 where it begins, with its positive side to its left; and (k,) lengths."""
    rows, lengths = [], []
    for piece in pieces:
        assert isinstance(piece, Curve)
        ((part,),) = surface.segments([[piece]])
        at = interpolation_at(surface.triangles, part.nodes[np.array([part.ends[0, 0], part.ends[-1, 1]])])
        right = False
        if piece.normals is not None:
            ((plain,),) = surface.segments([[Curve(piece.faces, piece.barycentric)]])
            right = (np.conj(plain.vectors) * part.vectors).real.sum() < 0
        rows.append(at[0] - at[1] if right else at[1] - at[0])
        lengths.append(part.lengths.sum())
    return sparse.csr_matrix(sparse.vstack(rows)), np.array(lengths)


def _votes(surface: SurfaceDiscretization, charges: sparse.csr_matrix) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
    """(k, k) minus ``⟨q_i, C⁻¹ q_j⟩``, the strongest in each row; and (k,) ``⟨q_i, C⁻¹ q_i⟩``.

    C is shifted by M / A, which changes nothing near a piece, and makes it definite.
    """
    triangles, k = surface.triangles, charges.shape[0]
    masses = np.bincount(
        triangles.corner_vertices.ravel(), np.repeat(triangles.face_areas / 3, 3), triangles.n_vertices
    )
    area = float(masses.sum())
    factor = factorize(
        sparse.csr_matrix(surface.stiffness + sparse.diags_array(np.maximum(masses / area, 1e-12))),
        order=surface.vertex_order,
    )
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
