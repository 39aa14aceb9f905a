"""Intel MKL PARDISO, called through ctypes in the shared library of the ``mkl`` wheel."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.metadata
import sys
import threading
import weakref
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from threadpoolctl import threadpool_info

from ..compiled import SHORT
from ..errors import FactorizationError, UnsupportedTypeError
from ..jobs import interruptible

_ANALYZE, _FACTORIZE, _SOLVE, _RELEASE = 11, 22, 33, -1
"""Phases of PARDISO."""
_POSITIVE_DEFINITE = {np.dtype(np.float64): 2, np.dtype(np.complex128): 4}
"""Matrix types of PARDISO for positive definite matrices."""
LONGEST_WAIT = 1
"""Milliseconds for which MKL's threads wait busily for more work before they sleep. MKL's default of 200 keeps other
threads from computing."""
_CAUSES = {
    -1: "inconsistent input",
    -2: "not enough memory",
    -3: "reordering failed",
    -4: "the matrix is not positive definite",
    -8: "32-bit integer overflow",
}


class PardisoFactor:
    """Cholesky factor of a Hermitian positive definite matrix, given by its upper triangle.

    Unknown ``order[k]`` is eliminated k-th; without an order, METIS finds one.
    """

    backend = "pardiso"

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None = None) -> None:
        self._take(_Analysis(upper, order), upper)

    def _take(self, analysis: _Analysis, upper: sparse.csr_matrix) -> None:
        """Initialise this factor for a matrix, in the memory of an analysis of its pattern."""
        self.n: int = upper.shape[0]
        self.dtype: np.dtype[Any] = upper.dtype
        self._analysis, self._values = analysis, upper.data
        with analysis.lock:
            analysis.factorize(self._values)

    def like_this(self, upper: sparse.csr_matrix) -> PardisoFactor | None:
        """Return the factor of a matrix in the memory of this one.

        Returns None if the matrix has another sparsity pattern, or if this version of MKL cannot.
        """
        return self._again(upper) if self._analysis.fits(upper) and _makes_factors_anew() else None

    def _again(self, upper: sparse.csr_matrix) -> PardisoFactor:
        """Return the factor of a matrix of the same pattern, in the memory of this one."""
        factor = object.__new__(PardisoFactor)
        factor._take(self._analysis, upper)
        return factor

    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]:
        """Return the solutions for one right-hand side, (n,), or several, (n, k)."""
        columns = np.asfortranarray(rhs, dtype=self.dtype)
        solution = np.empty_like(columns, order="F")
        with self._analysis.lock:
            self._analysis.factorize(self._values)
            self._analysis.call(_SOLVE, columns, solution)
        return solution

    @property
    def nonzeros(self) -> int:
        """Number of entries stored in the factor."""
        return int(self._analysis.call.parameters[17])

    def __reduce__(self) -> NoReturn:
        raise UnsupportedTypeError(
            "a factor is memory of the MKL library, which is released with it: it cannot be copied or pickled",
            remedy="factorise the matrix again",
        )


class _Analysis:
    """The order and the memory of a factor, which matrices of the same sparsity pattern share."""

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None) -> None:
        self.call = _Call(upper, order)
        self.lock = threading.Lock()
        self._made: NDArray[Any] | None = None
        self._finalizer = weakref.finalize(self, self.call, _RELEASE)
        self.call(_ANALYZE)

    def factorize(self, values: NDArray[Any]) -> None:
        """Factorise the matrix with these entries, unless its factor is in memory already."""
        if self._made is values:
            return
        self._made, self.call.values = None, values
        self.call(_FACTORIZE)
        self._made = values

    def fits(self, upper: sparse.csr_matrix) -> bool:
        """Return whether a matrix has the same type and sparsity pattern."""
        call = self.call
        same = upper.dtype == call.values.dtype and len(upper.data) == len(call.values)
        return bool(same and np.array_equal(upper.indptr, call.indptr) and np.array_equal(upper.indices, call.indices))


class _Call:
    """A callable with the arguments that all PARDISO calls for one factorisation share."""

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None) -> None:
        wide = upper.nnz >= 2**31
        index = np.int64 if wide else np.int32
        self._function = _library().pardiso_64 if wide else _library().pardiso
        self._handle = np.zeros(64, dtype=np.int64)
        self._lock, self._is_released = threading.Lock(), False
        self.values = upper.data
        self.indptr, self.indices = upper.indptr.astype(index, copy=False), upper.indices.astype(index, copy=False)
        # settings are entries of the array `iparm` of PARDISO's manual
        self._integer = ctypes.c_longlong if wide else ctypes.c_int
        self._kind, self._n = _POSITIVE_DEFINITE[upper.dtype], upper.shape[0]
        self._order = np.zeros(1, dtype=index) if order is None else np.ascontiguousarray(order, dtype=index)
        self.parameters = np.zeros(64, dtype=index)
        self.parameters[0] = 1  # take no parameter from the defaults
        self.parameters[1] = 3  # nested dissection in parallel
        self.parameters[4] = 0 if order is None else 1
        self.parameters[17] = -1  # report the number of nonzeros of the factor
        self.parameters[23] = 1 if order is None else 0  # two levels solve in parallel, to the same bits every time
        self.parameters[34] = 1  # indices count from zero
        self._threads = _library().MKL_Get_Max_Threads()

    def __call__(self, phase: int, rhs: NDArray[Any] | None = None, solution: NDArray[Any] | None = None) -> None:
        """Call PARDISO for one of its phases.

        After Ctrl-C, a call continues on its thread. If its memory is to be released meanwhile, that happens at its
        end.
        """
        if phase == _RELEASE:
            self._is_released = True
            self._release()
        elif self._n <= SHORT:
            self._alone(phase, rhs, solution)
        else:
            interruptible(self._alone, phase, rhs, solution)

    def _alone(self, phase: int, rhs: NDArray[Any] | None, solution: NDArray[Any] | None) -> None:
        """Call PARDISO while no other call for this factorisation runs."""
        with self._lock:
            self._run(phase, rhs, solution)
        if self._is_released:
            self._release()

    def _release(self) -> None:
        """Release the memory, unless a call is running, which will do so at its end."""
        if self._lock.acquire(blocking=False):
            try:
                self._run(_RELEASE)
            finally:
                self._lock.release()

    def _run(self, phase: int, rhs: NDArray[Any] | None = None, solution: NDArray[Any] | None = None) -> None:
        """Call PARDISO for a phase of its manual, such as 33 to solve; raise `FactorizationError` if it fails.

        The `solution` for right-hand sides `rhs`, (n,) or (n, k), is written.
        """
        integer, values = self._integer, self.values  # which are others once nobody waits for this call
        status = integer(0)
        n_columns = integer(1 if rhs is None or rhs.ndim == 1 else rhs.shape[1])
        empty = np.zeros(1, dtype=values.dtype)
        waits = _wait_at_most(LONGEST_WAIT)
        # a two-level factor made on several threads gives wrong solutions on one, without an error, and vice versa
        threads_before = _library().MKL_Set_Num_Threads_Local(self._threads)
        self._function(
            _address(self._handle),
            ctypes.byref(integer(1)),  # number of factors in memory
            ctypes.byref(integer(1)),  # the factor to use
            ctypes.byref(integer(self._kind)),
            ctypes.byref(integer(phase)),
            ctypes.byref(integer(self._n)),
            *(_address(array) for array in (values, self.indptr, self.indices)),
            _address(self._order),
            ctypes.byref(n_columns),
            _address(self.parameters),
            ctypes.byref(integer(0)),
            _address(empty if rhs is None else rhs),
            _address(empty if solution is None else solution),
            ctypes.byref(status),
        )
        _library().MKL_Set_Num_Threads_Local(threads_before)
        _wait_at_most(waits)
        if status.value != 0:
            cause = _CAUSES.get(status.value, "see the PARDISO manual")
            raise FactorizationError(
                f"PARDISO failed with error {status.value} on {self._n} unknowns: {cause}", element="matrix"
            )


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of an array's data."""
    return ctypes.c_void_p(array.ctypes.data)


@cache
def _library() -> ctypes.CDLL:
    """Load ``mkl_rt`` from the wheel, the prefix of the environment, or the system."""
    names = {"win32": "mkl_rt*.dll", "darwin": "libmkl_rt*.dylib"}.get(sys.platform, "libmkl_rt.so*")
    try:
        installed = [Path(f.locate()) for f in importlib.metadata.files("mkl") or [] if f.match(names)]
    except importlib.metadata.PackageNotFoundError:
        installed = []
    prefix = Path(sys.prefix) / ("Library/bin" if sys.platform == "win32" else "lib")
    system = ctypes.util.find_library("mkl_rt")
    for path in [*installed, *sorted(prefix.glob(names)), *([system] if system else [])]:
        try:
            return ctypes.CDLL(str(path))
        except OSError:
            continue
    raise ImportError("the library mkl_rt was not found: install the package mkl")


def _wait_at_most(milliseconds: int) -> int:
    """Set how many milliseconds the threads that this one starts wait for more work; return the number before."""
    openmp = _openmp()
    if openmp is None:
        return 0
    before = int(openmp.kmp_get_blocktime())
    openmp.kmp_set_blocktime(milliseconds)
    return before


@cache
def _openmp() -> ctypes.CDLL | None:
    """Return the OpenMP library of Intel that MKL has loaded, or None if its threads are those of another library."""
    paths = [library["filepath"] for library in threadpool_info() if library["prefix"] == "libiomp"]
    return ctypes.CDLL(paths[0]) if paths else None


@cache
def _makes_factors_anew() -> bool:
    """Whether this version of MKL can reuse an analysis for another matrix.

    Before 2026.2, two-level factors silently stay those of the first matrix.
    """
    unit, double = (sparse.csr_matrix(np.array([[diagonal]])) for diagonal in (1.0, 2.0))
    half = PardisoFactor(unit)._again(double).solve(np.ones(1))[0]
    return bool(abs(half - 0.5) < 0.25)  # the result is rounded on some processors


def is_loaded() -> bool:
    """Return whether the MKL library has been loaded."""
    return _library.cache_info().currsize > 0


def is_available() -> bool:
    """Return whether the MKL library can be loaded."""
    try:
        _library()
    except ImportError:
        return False
    return True
