"""Directions of the pieces of broken curves: told by their ends, and by how they wind round each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.synchronization import best_signs, nested_groups
from .curve_votes import Votes

FACING = (1.0, 2.0)
"""Weights of a winding number that is wrong by one, beside the energy of ends: small ones first, as both agree more
easily then."""
STRICT, NONE = 4.0, 0.05
"""Weight, and scatter beside that of smaller weights, with which curves hardly scatter at all: nothing is spurious."""
AS_GIVEN = 0.1
"""Vote of a piece of mean length for its own direction, beside them: what spurious pieces tell is less."""
MANY = 1000
"""Pieces from which those that their ends tie most to each other are turned together."""
MOST = 0.35
"""Length that may be turned, of all, where the ends of pieces tell to turn none and no curve is complete."""
CLEARLY = 0.5
"""Scatter of winding numbers, relative to that as given, above which nothing is turned where ends tell to turn none."""


def directions(votes: Votes, among: NDArray[np.int64]) -> NDArray[np.float64]:
    """(k,) directions ±1 of some of the pieces, relative to those given.

    Ends of pieces tell how the pieces of one curve follow each other, and nearly nothing of how two curves face.
    Winding numbers tell that (`Windings`): where all curves bound one region, their sum is the same at all of them.
    Directions are sought that make the energy of ends and the scatter of winding numbers small together. Complete
    curves are as given, and tell with the others.

    Where no piece disagrees with the next, curves are taken as they are, such as parallel lines that all look the same
    way, unless few of them disagree with all others, or all with complete curves.
    """
    by_ends, _ = votes.counted(among)
    unit = units(votes, among)
    held = sparse.csr_matrix((by_ends, (unit, np.arange(len(among)))), shape=(int(unit.max()) + 1, len(among)))
    pairs = sparse.csr_matrix(votes.pairs[among][:, among])
    agreed = np.asarray((held @ (0.5 * (pairs + pairs.T)) @ held.T).todense())
    lengths = votes.lengths[among]
    stay = AS_GIVEN * (held @ lengths) / max(float(lengths.mean()), 1e-300)
    told = np.block([[agreed, stay[:, None]], [stay[None], np.zeros((1, 1))]])
    scattered = scatter(votes, among, held)
    found = np.ones(len(told))
    for weight in FACING:
        found = best_signs(told - 2 * weight * scattered, found)
    strictly = best_signs(told - 2 * STRICT * scattered, found)
    if strictly @ scattered @ strictly < NONE * (found @ scattered @ found):
        found = strictly
    signs: NDArray[np.float64] = held.T @ (found[:-1] * found[-1])
    none_complete = len(votes.pieces) == len(votes.windings.parts)
    many = none_complete and lengths[signs < 0].sum() > MOST * lengths.sum()
    ones = np.ones(len(found))
    still = found @ scattered @ found > CLEARLY * (ones @ scattered @ ones)
    return by_ends if (by_ends > 0).all() and (many or still) else signs


def scatter(votes: Votes, among: NDArray[np.int64], held: sparse.csr_matrix) -> NDArray[np.float64]:
    """(j + 1, j + 1) Q: ``sᵀ Q s`` is the scatter of the winding numbers at curves, of units with the signs s.

    The last unit is all complete curves. Numbers are compared within each part of the surface.
    """
    k, n = len(votes.pieces), len(votes.windings.parts)
    rows = np.concatenate([among, np.arange(k, n)])
    columns = sparse.csr_matrix((np.ones(len(rows)), (np.arange(len(rows)), rows)), shape=(len(rows), n))
    whole = sparse.csr_matrix(np.ones((1, n - k)))
    sums = sparse.csr_matrix(sparse.block_diag([held, whole]) @ columns)
    found = votes.windings.of_sums(sums)[rows]
    parts = np.unique(votes.windings.parts[rows], return_inverse=True)[1].ravel()
    member = sparse.csr_matrix((np.ones(len(rows)), (parts, np.arange(len(rows)))))
    means = (member @ found) / np.bincount(parts)[:, None]
    scattered = found - means[parts]
    result: NDArray[np.float64] = scattered.T @ scattered
    return result


def units(votes: Votes, among: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) what some of the pieces are turned with: each alone or, if they are many, in groups told by their ends."""
    if len(among) <= MANY:
        return np.arange(len(among))
    tails, heads, weights = sparse.find(votes.pairs[among][:, among])
    levels = nested_groups(tails, heads, weights, len(among))
    few = [level for level in levels if level.max() < MANY]
    return few[-1] if few else np.arange(len(among))
