"""Step 3 of the method by a factorisation of C, for unknowns at the vertices of a mesh.

Constraints at sample points are imposed exactly or, where a linear function cannot satisfy them without becoming flat,
by springs, that is, by quadratic penalties.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Floats, Frozen, Ints, LastUsed, fingerprint
from ..discretization import Levels, SourceTerm
from ..errors import ConstraintError
from . import Factor, PardisoFactor, factorize, upper_triangle, whole
from .conjugate_gradients import conjugate_gradients

STIFFEST_SPRING = 1e10
"""Strength of springs, relative to C, above which it makes no difference beyond rounding. Below the inverse of it,
springs are left out."""
COLUMNS_AT_ONCE = 32
"""Number of right-hand sides that are solved at a time, which bounds the memory."""
PIN_STIFFNESS = 1e6
"""Stiffness of the springs at vertices on the source, relative to the largest diagonal entry of C."""
LEAST_STIFFNESS = 10.0
"""Least total stiffness of the springs that hold φ in `anchored`, relative to the largest diagonal entry of C."""


@dataclass(frozen=True, eq=False)
class DirectIntegration(Frozen):
    """Solver of ``C φ = b`` with n unknowns, with the constraints of Sec. 7.1; derived classes define `fit`.

    Methods take b, (n,), as `divergence`, and return φ, (n,).
    """

    stiffness: sparse.csr_matrix  # (n, n) upper triangle of C, whose kernel are the constants on each component
    factorize: Callable[..., Factor] = factorize  # takes an upper triangle, and a `PardisoFactor` as `like`
    spring: float = 1e8
    """ρ of the augmented Lagrangian for exact constraints, relative to the largest diagonal entry of C. A larger one
    needs fewer rounds, and worsens the condition of the matrix."""
    # factors: the last one with springs, and the last one of each sparsity pattern, whose memory is used again
    _pulled: LastUsed[bytes, Factor] = field(default_factory=LastUsed, init=False, repr=False)
    _of_this_pattern: LastUsed[bytes, list[Factor]] = field(default_factory=LastUsed, init=False, repr=False)

    @cached_property
    def components(self) -> Ints:
        """Connected component of the domain in which each unknown lies, (n,) int."""
        labels: NDArray[np.int32] = sparse.csgraph.connected_components(self.stiffness, directed=False)[1]
        return labels.astype(np.int64)

    @cached_property
    def factor(self) -> Factor:
        """Factor of C, made definite by grounding one vertex of each connected component."""
        return self.factorize(_grounded(self.stiffness, self._first_vertices))

    def solve(self, divergence: Floats, source: SourceTerm) -> Floats:
        """Minimise ∫|∇φ − Y|² without constraint, by solving ``C φ = b`` (Eq. 13)."""
        return self.solve_many([divergence], [source])[0]

    def solve_many(self, divergences: Iterable[Floats], sources: Sequence[SourceTerm]) -> list[Floats]:
        """Return the result of `solve` for each of several sources, computed together."""
        solved = self.factor.solve(np.stack(list(divergences)).T)
        return [self._centered(values, source) for values, source in zip(solved.T, sources, strict=True)]

    def fit_exactly(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Solve with levels imposed exactly at every sample, up to one constant for each group (Eq. 14)."""
        rows, values = source.interpolation, levels.values
        if levels.groups is None:
            fitted, _ = self._interpolate(rows, divergence[:, None], values[:, None])
            refuse_contradictions(rows, values, fitted[:, 0], 1e-4 * (np.abs(values).max() + np.ptp(fitted)))
            return self._reached(fitted[:, 0], rows)
        group = levels.groups
        bound = np.flatnonzero(np.bincount(group)[group] > 1)  # a group of one sample constrains nothing
        rows, values, group = rows[bound], values[bound], np.unique(group[bound], return_inverse=True)[1]
        # one group of each component keeps its level; constants of the others are such that their multipliers sum to 0
        fixed = group[np.unique(self._component_of(rows), return_index=True)[1]]
        free = np.setdiff1d(group, fixed)
        held = np.flatnonzero(np.isin(group, free))
        entries = np.ones(len(held)), (held, np.searchsorted(free, group[held]))
        loads = sparse.csr_matrix(entries, shape=(len(group), len(free)))
        _, pull = self._interpolate(rows, divergence[:, None], values[:, None])
        capacitance = np.empty((len(free), len(free)))
        for begin in range(0, len(free), COLUMNS_AT_ONCE):
            batch = slice(begin, begin + COLUMNS_AT_ONCE)
            lifted = loads[:, batch].toarray()
            _, multipliers = self._interpolate(rows, np.zeros((len(divergence), lifted.shape[1])), lifted)
            capacitance[:, batch] = loads.T @ multipliers
        constants = np.linalg.lstsq(capacitance, -(loads.T @ pull[:, 0]), rcond=None)[0]
        fitted, _ = self._interpolate(rows, divergence[:, None], (values + loads @ constants)[:, None])
        return self._centered(fitted[:, 0], source)

    def penalize(self, divergence: Floats, source: SourceTerm, strength: float) -> Floats:
        """Solve ``(C + λ Aᵀ W A) φ = b``, W the line or area elements of samples (Sec. 7.1, Fig. 11).

        The strength λ may be arbitrarily small or large.
        """
        rows, stiffest = source.interpolation, float(self.stiffness.diagonal().max())
        if strength * float(source.weights.sum()) < stiffest / STIFFEST_SPRING:
            return self.solve(divergence, source)
        strength = min(strength, STIFFEST_SPRING * stiffest / float(source.weights.max()))
        return self._reached(self._pulled_factor(rows, strength * source.weights).solve(divergence), rows)

    def anchored(self, source: SourceTerm) -> Factor:
        """Return the factor of C with springs that hold φ at zero along the source."""
        return self._pulled_factor(source.interpolation, self.springs(source))

    def springs(self, source: SourceTerm) -> Floats:
        """Return (s,) stiffnesses of the springs that hold φ at the samples."""
        return np.full(len(source.weights), self.spring * self.stiffness.diagonal().max())

    def _interpolate(self, rows: sparse.csr_matrix, forces: Floats, levels: Floats) -> tuple[Floats, Floats]:
        """Minimise ``½ φᵀ C φ − fᵀ φ`` under the constraints ``A φ = l`` (Eq. 14), for k columns at once.

        A are the `rows`, (s, n), f the `forces`, (n, k), and l the `levels`, (s, k). Returns φ and the multipliers μ of
        ``C φ + Aᵀ μ = f``. ``C + ρ Aᵀ A`` is definite even if rows of A are dependent, and two or three rounds from the
        true residuals suffice. If rows are nearly dependent, conjugate gradients are used in addition.
        """
        stiffness = whole(self.stiffness)
        spring = self.spring * self.stiffness.diagonal().max()
        factor = self._pulled_factor(rows, np.full(rows.shape[0], spring))

        def pull(displacements: Floats) -> Floats:
            return factor.solve(spring * (rows.T @ displacements))

        # each round steps to the minimum of the augmented Lagrangian, and `gap` is what the constraints are missed by
        values, multipliers = np.zeros_like(forces), np.zeros_like(levels)
        gap, worst, slow = levels, np.inf, False
        for _ in range(12):
            displacements = gap
            if slow:  # a rough solution is enough, as the next round corrects it
                displacements = conjugate_gradients(lambda d: rows @ pull(d), gap, tolerance=1e-3, limit=30)
            step = factor.solve(forces - stiffness @ values - rows.T @ multipliers) + pull(displacements)
            if worst < np.inf and np.abs(step).max() > 10.0 * np.abs(values).max():  # the rows contradict each other
                break
            values += step
            multipliers -= spring * (displacements - rows @ step)
            gap = levels - rows @ values
            previous, worst = worst, np.abs(gap).max(initial=0.0)
            if worst <= 1e-13 * np.abs(values).max():
                break
            slow = slow or worst > 0.1 * previous
        return values, multipliers

    def _pulled_factor(self, rows: sparse.csr_matrix, springs: Floats) -> Factor:
        """Return the factor of ``C + Aᵀ S A``, A the rows and S = diag(springs); the last factor is cached."""
        key = fingerprint(rows.indptr, rows.indices, rows.data, springs)
        return self._pulled(key, lambda: self._factorize_pulled(rows, springs))

    def _factorize_pulled(self, rows: sparse.csr_matrix, springs: Floats) -> Factor:
        """Compute the factor of ``C + Aᵀ S A``, with A the `rows`, (s, n), and S = diag(`springs`), (s,) stiffnesses.

        On connected components without springs, where that is singular, one diagonal entry is doubled. The factor is
        stored in the memory of an earlier one of the same pattern if possible.
        """
        matrix = upper_triangle(self.stiffness + upper_triangle(rows.T @ sparse.diags_array(springs) @ rows))
        unreached = np.isin(self.components[self._first_vertices], self._component_of(rows[springs > 0]), invert=True)
        matrix = _grounded(matrix, self._first_vertices[unreached])
        before: list[Factor] = self._of_this_pattern(fingerprint(matrix.indptr, matrix.indices), list)
        factor = self.factorize(matrix, like=before[0]) if before else self.factorize(matrix)
        before[:] = [factor] if isinstance(factor, PardisoFactor) else []  # others have nothing to share
        return factor

    @cached_property
    def _first_vertices(self) -> Ints:
        """Least unknown of each connected component, (p,) int."""
        return np.unique(self.components, return_index=True)[1]

    def _component_of(self, rows: sparse.csr_matrix) -> Ints:
        """Return (s,) the connected component of the domain in which the sample of each row of A lies."""
        return self.components[rows.indices[rows.indptr[:-1]]]

    def _reached(self, values: Floats, rows: sparse.csr_matrix) -> Floats:
        """Replace (n,) values by NaN on connected components without samples; samples are the rows of A."""
        return np.where(np.isin(self.components, self._component_of(rows)), values, np.nan)

    def _centered(self, values: Floats, source: SourceTerm) -> Floats:
        """Shift φ, (n,), to a weighted mean of 0 over the samples of each connected component, NaN without samples."""
        rows = source.interpolation
        part, n_parts = self._component_of(rows), len(self._first_vertices)
        weight = np.bincount(part, source.weights, n_parts)
        mean = np.full(n_parts, np.nan)
        at_samples = source.weights * self._at_samples(values, source)
        np.divide(np.bincount(part, at_samples, n_parts), weight, out=mean, where=weight > 0)
        return values - mean[self.components]

    def _at_samples(self, values: Floats, source: SourceTerm) -> Floats:
        """Return (s,) values of φ, (n,), interpolated at the samples of the source."""
        return source.interpolation @ values


def _grounded(matrix: sparse.csr_matrix, vertices: Ints) -> sparse.csr_matrix:
    """Make an upper triangle definite by doubling the diagonal entries of some unknowns, one of each component.

    The solution is zero at these unknowns if the right-hand side sums to zero on each component.
    """
    data = matrix.data.copy()
    diagonal = matrix.indptr[vertices]
    data[diagonal] += np.where(data[diagonal] > 0, data[diagonal], 1.0)
    return sparse.csr_matrix((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def refuse_contradictions(rows: sparse.csr_matrix, levels: Floats, values: Floats, allowed: float) -> None:
    """Raise `ConstraintError` if φ misses a level at some sample by more than `allowed`, unless all levels are equal.

    `rows` interpolate φ at samples, (s, n), `levels` are (s,), and `values` are φ, (n,).
    """
    gap = np.abs(levels - rows @ values)
    worst = int(gap.argmax())
    if np.ptp(levels) > 0 and gap[worst] > allowed:
        vertex = f"vertex {rows.indices[rows.indptr[worst]]}"
        raise ConstraintError(
            f"the levels contradict each other near {vertex}: sources that meet or cross need the same level",
            element=vertex,
        )


@dataclass(frozen=True, eq=False)
class SpringIntegration(DirectIntegration):
    """`DirectIntegration` with a `fit` by springs; exact levels inside cells would make φ constant near the source."""

    strength: float = 0.0  # strength of the springs, in 1/length

    @property
    def soft_weight(self) -> float:
        """Default weight λ of the constraint `Soft`, in 1/length."""
        return self.strength

    def fit(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Minimise ``½ φᵀ C φ − bᵀ φ + ½ (Aφ − l)ᵀ S (Aφ − l)``, S the `springs`, and also over constants of groups.

        b is the `divergence`, (n,). A interpolates φ at averages of the samples, and l are the levels there. Returns φ,
        (n,), NaN on connected components without samples. With groups, its mean over the samples of each component is
        0.
        """
        averages, springs = self.held(source)
        rows, levels = sparse.csr_matrix(averages @ source.interpolation), levels.at(averages)
        if levels.groups is not None:
            springs = np.where(np.bincount(levels.groups)[levels.groups] > 1, springs, 0.0)
        factor = self._pulled_factor(rows, springs)
        pull = sparse.csr_matrix(rows.T @ sparse.diags_array(springs))
        values, fitted = self.corrected(levels.values, lambda at: factor.solve(divergence + pull @ at), source)
        if levels.groups is None:
            return self._reached(fitted, rows)
        held = springs > 0
        groups, parts = levels.groups[held], self._component_of(rows[held])
        # one group of each part keeps its level; constants of the others are such that their forces sum to 0
        first = groups[np.unique(parts, return_index=True)[1]]
        free = np.setdiff1d(groups, first)
        if len(free):
            chosen = np.flatnonzero(np.isin(levels.groups, free))
            entries = np.ones(len(chosen)), (chosen, np.searchsorted(free, levels.groups[chosen]))
            members = sparse.csr_matrix(entries, shape=(len(springs), len(free)))
            forces = sparse.csr_matrix(members.T @ sparse.diags_array(springs))
            balance = np.empty((len(free), len(free)))
            for begin in range(0, len(free), COLUMNS_AT_ONCE):
                lifted = members[:, begin : begin + COLUMNS_AT_ONCE].toarray()
                balance[:, begin : begin + COLUMNS_AT_ONCE] = forces @ (lifted - rows @ factor.solve(pull @ lifted))
            constants = np.linalg.lstsq(balance, forces @ (rows @ fitted - values), rcond=None)[0]
            fitted = fitted + factor.solve(pull @ (members @ constants))
        return self._centered(fitted, source)

    def anchored(self, source: SourceTerm) -> Factor:
        """Return the factor of C with springs that hold φ at zero along the source.

        Their total stiffness is at least `LEAST_STIFFNESS`, however small a part of the source lies in the domain.
        """
        springs, least = self.springs(source), LEAST_STIFFNESS * float(self.stiffness.diagonal().max())
        return self._pulled_factor(source.interpolation, springs * max(1.0, least / float(springs.sum())))

    def held(self, source: SourceTerm) -> tuple[sparse.csr_matrix, Floats]:
        """Return an (r, s) matrix that averages samples to the points at which `fit` has springs, and stiffnesses."""
        return sparse.eye_array(len(source.weights), format="csr"), self.springs(source)

    def springs(self, source: SourceTerm) -> Floats:
        """Return (s,) stiffnesses of springs at samples, which are large at vertices and smaller inside cells."""
        at_vertex = np.diff(source.interpolation.indptr) == 1
        return np.where(at_vertex, PIN_STIFFNESS * self.stiffness.diagonal().max(), self.strength * source.weights)

    def corrected(self, levels: Floats, solve: Callable[[Floats], Floats], source: SourceTerm) -> tuple[Floats, Floats]:
        """Return the levels to impose on the linear interpolant of φ, and φ, ``solve(levels)``, for them."""
        return levels, solve(levels)
