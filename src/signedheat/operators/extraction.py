"""Kernels: what is made of diffused vectors, node by node. A common factor of a node's components does not matter."""

from __future__ import annotations

import numpy as np
from numba import njit

from .sweeps import STRETCH


@njit(cache=True, nogil=True, fastmath={"contract", "nnan", "nsz"})
def unit_vectors(mantissas, inside, out, axis, start, stop):
    """The vectors scaled to length one, or zero where nothing arrived."""
    dimension, n0, n1, n2, n = out.shape
    stretches = inside.shape[3]
    v = np.empty(4, dtype=np.float32)
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = mantissas[i, j, k]
                for s in range(stretches):
                    if not inside[i, j, k, s]:
                        continue
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        largest = np.float32(0)
                        for d in range(4):
                            v[d] = line[m, d]
                            largest = max(largest, abs(v[d]))
                        square = np.float32(0)
                        factor = np.float32(0)
                        if largest > 0:
                            factor = np.float32(1) / largest
                            for d in range(4):
                                square += (factor * v[d]) ** 2
                            factor /= np.sqrt(square)
                        for d in range(dimension):
                            out[d, i, j, k, m] = factor * v[d]


@njit(cache=True, nogil=True)
def quotients(mantissas, inside, out, axis, start, stop):
    """Second component over first."""
    _, n0, n1, n2, n = out.shape
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = mantissas[i, j, k]
                for s in range(inside.shape[3]):
                    if not inside[i, j, k, s]:
                        continue
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        out[0, i, j, k, m] = line[m, 1] / line[m, 0] if line[m, 0] > 0 else np.float32(0)
