"""Kernels: functions of the diffused vectors at each node. None depends on a common factor of a node's components."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .node_sources import STRETCH
from .sweeps import TINY


@compiled
def unit_vectors(vectors, inside, out, axis, start, stop):
    """The vectors scaled to length one; where they have underflowed, `out` keeps the values of a coarser level."""
    dimension, n0, n1, n2, n = out.shape
    stretches = inside.shape[3]
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = vectors[i, j, k]
                for s in range(stretches):
                    if not inside[i, j, k, s]:
                        continue
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        square = np.float32(0)
                        largest = max(max(abs(line[m, 0]), abs(line[m, 1])), max(abs(line[m, 2]), abs(line[m, 3])))
                        if largest < TINY:
                            continue
                        factor = np.float32(1) / largest
                        for d in range(dimension):
                            square += (factor * line[m, d]) ** 2
                        factor /= np.sqrt(square)
                        for d in range(dimension):
                            out[d, i, j, k, m] = factor * line[m, d]


@compiled
def quotients(vectors, inside, out, axis, start, stop):
    """The second component divided by the first; `out` keeps its values where the first has underflowed."""
    _, n0, n1, n2, n = out.shape
    for i in range(start if axis == 0 else 0, stop if axis == 0 else n0):
        for j in range(start if axis == 1 else 0, stop if axis == 1 else n1):
            for k in range(n2):
                line = vectors[i, j, k]
                for s in range(inside.shape[3]):
                    if not inside[i, j, k, s]:
                        continue
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        if line[m, 0] > TINY:
                            out[0, i, j, k, m] = line[m, 1] / line[m, 0]
