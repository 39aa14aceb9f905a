"""Fill-reducing elimination orders for sparse matrices on surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .dissection_kernels import dissect
from .matrices import whole

_LEAF = 3  # regions of so many unknowns are not dissected further


def elimination_order(upper: Any) -> NDArray[np.int64]:
    """Nested dissection of a sparse symmetric matrix, from its upper triangle: ``order[k]`` is eliminated k-th.

    On surfaces the fill is that of METIS on even meshes, up to twice as much on very uneven ones, in a fifth of the
    time; the time is n log n times the number of levels of a breadth-first search. For unknowns in a volume METIS,
    which PARDISO runs by itself, is better.

    Examples
    --------
    >>> from scipy import sparse
    >>> path = sparse.diags_array([np.ones(20), np.ones(19)], offsets=[0, 1], format="csr")
    >>> bool(8 <= elimination_order(path)[-1] <= 12)  # the separator of the two halves comes last
    True
    """
    graph = whole(upper)
    return dissect(graph.indptr, graph.indices, _LEAF)
