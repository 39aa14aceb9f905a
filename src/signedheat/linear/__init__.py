"""Sparse linear solvers: a module for each back end of factorisation, the choice between them, and Krylov methods."""

from __future__ import annotations

import os
import platform
import sys
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import SignedHeatError
from ..jobs import Announcement
from . import pardiso
from .ordering import elimination_order, upper_triangle, whole
from .pardiso import PardisoFactor
from .superlu import SuperLUFactor

__all__ = ["PardisoFactor", "elimination_order", "upper_triangle", "whole"]


MKL_UNKNOWNS = 300_000
"""Number of unknowns above which MKL is recommended. A surface has three for each vertex: with 160,000 of these SuperLU
takes 1.2 times as long on one processor, and MKL uses two of them well; with 650,000 it takes twice as long."""
HAS_MKL = platform.machine() in ("x86_64", "AMD64") and sys.platform != "darwin"
"""Whether MKL exists for this machine."""
advise: Announcement = Announcement("pip install mkl makes large surfaces and tets twice to three times as fast")


class Factor(Protocol):
    """A factor that solves systems with a Hermitian positive definite matrix."""

    @property
    def n(self) -> int: ...  # number of unknowns
    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]: ...  # solutions for one (n,) or several (n, k) right-hand sides


def available_backends() -> list[str]:
    """Return the names of the back ends available on this machine, fastest first."""
    return ["pardiso"] * pardiso.is_available() + ["superlu"]


def chosen_backend(backend: str | None = None) -> str:
    """Return the name of the back end that `factorize` uses; raise an error if it is not available.

    It is the argument, else that of the environment variable ``SIGNEDHEAT_BACKEND``, else the fastest.
    """
    available = available_backends()
    name = backend or os.environ.get("SIGNEDHEAT_BACKEND") or available[0]
    if name not in available:
        raise SignedHeatError(
            f"the solver {name!r} is not available here", remedy=f"choose one of {', '.join(available)}"
        )
    return name


def factorize(
    matrix: Any,
    backend: str | None = None,
    order: NDArray[np.integer] | None = None,
    reused: bool = False,
    like: Factor | None = None,
) -> Factor:
    """Factorise a sparse Hermitian positive definite matrix, float64 or complex128; only its upper triangle is read.

    The back end is chosen as by `chosen_backend`. Unknown ``order[k]`` is eliminated k-th. If many systems will be
    solved, set `reused`, so that PARDISO chooses an order with which it uses all cores. If `like` is the factor of a
    matrix with the same sparsity pattern, PARDISO takes half the time, and both factors share the memory of one.
    """
    name = chosen_backend(backend)
    upper = upper_triangle(matrix)
    if isinstance(like, PardisoFactor) and name == "pardiso" and (again := like.like_this(upper)):
        return again
    if name == "pardiso":
        return PardisoFactor(upper, None if reused else order)
    if upper.shape[0] >= MKL_UNKNOWNS and backend is None and HAS_MKL:
        advise()
    return SuperLUFactor(upper, order)
