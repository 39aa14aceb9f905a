"""The method of conjugate gradients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Floats

Operator = Callable[[Floats], Floats]
"""A linear map of (n,) or (n, k) vectors to such vectors."""


def conjugate_gradients(
    operator: Operator,
    rhs: Floats,
    precondition: Operator | None = None,
    start: Floats | None = None,
    tolerance: float = 1e-6,
    limit: int = 500,
    converged: Callable[[Floats, Floats], bool] | None = None,
) -> Floats:
    """Solve ``A x = b`` for each column of b, (n,) or (n, k), by preconditioned conjugate gradients.

    `operator` applies A, which is symmetric positive definite, or semidefinite with b in its range. `precondition`
    applies P, an approximation of A⁻¹. A column ends at residual r once ``rᵀ P r ≤ tolerance² · max(r₀ᵀ P r₀, bᵀ P
    b)``, or if ``pᵀ A p ≤ 0`` for its direction p. All end after `limit` steps, or once ``converged(x, r)`` is true
    (Hestenes & Stiefel 1952).
    """
    # the usual letters: residual r, z = P r, direction p, q = A p
    apply_p = precondition or np.copy
    x = np.zeros_like(rhs) if start is None else start.copy()
    r = rhs.copy() if start is None else rhs - operator(x)
    z = apply_p(r)
    p, product = z.copy(), _products(r, z)
    goal = tolerance**2 * (product if start is None else np.maximum(product, _products(rhs, apply_p(rhs))))
    for _ in range(limit):
        active = product > goal
        if not active.any():
            break
        q = operator(p)
        curvature = _products(p, q)
        active &= curvature > 0
        if not active.any():
            break
        step = np.divide(product, curvature, out=np.zeros_like(product), where=active)
        x += step * p
        r -= step * q
        if converged is not None and converged(x, r):
            break
        z = apply_p(r)
        product, previous = _products(r, z), product
        p *= np.divide(product, previous, out=np.zeros_like(product), where=previous > 0)
        p += z
    return x


def _products(a: Floats, b: Floats) -> Floats:
    """Return (k,) inner products of the columns of two (n, k) arrays, or a number for two vectors."""
    # not by BLAS, whose threads wait busily for more work
    return np.asarray(np.einsum("i...,i...->...", a, b))
