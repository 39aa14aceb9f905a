"""Kernel: faces that lie on others which face the other way, where bodies touch and walls are doubled.

Beside them the nearest face tells no side: another one is as near, and tells the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF

ALIGNED = 1e-6
"""What the scalar product of their normals may differ from −1."""


@compiled(nogil=True, error_model="numpy")
def touching_faces(
    corners: NDArray[np.float64],
    normals: NDArray[np.float64],
    bounds: NDArray[np.float64],
    items: NDArray[np.int64],
    gap: float,
) -> NDArray[np.bool_]:
    """(m,) faces in whose plane, up to a gap, others lie that face the other way, and whose boxes meet.

    Parameters
    ----------
    corners, normals : (m, 9), (m, 3) float
        Of the faces.
    bounds, items : arrays
        Of a `BoxTree` over their boxes.
    gap : float
        Distance between planes up to which faces touch.

    Examples
    --------
    >>> from .box_tree import BoxTree
    >>> face = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> faces = np.stack([face, face[::-1] * 0.5, face + [0, 0, 1]])
    >>> tree, up = BoxTree.of(faces.min(axis=1), faces.max(axis=1)), np.array([0.0, 0, 1])
    >>> touching_faces(faces.reshape(3, 9), np.stack([up, -up, up]), tree.bounds, tree.items, 1e-6)
    array([ True,  True, False])
    """
    m, leaves = len(corners), len(bounds) // 2
    result = np.zeros(m, dtype=np.bool_)
    stack = np.empty(64, dtype=np.int64)
    box = np.empty(6)
    for f in range(m):
        for k in range(3):
            box[k] = min(corners[f, k], corners[f, 3 + k], corners[f, 6 + k]) - gap
            box[3 + k] = max(corners[f, k], corners[f, 3 + k], corners[f, 6 + k]) + gap
        stack[0], depth = 1, 1
        while depth > 0 and not result[f]:
            depth -= 1
            node = stack[depth]
            apart = False
            for k in range(3):
                apart |= bounds[node, k] > box[3 + k] or bounds[node, 3 + k] < box[k]
            if apart:
                continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
                continue
            for at in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                g = items[at]
                if g < 0 or g == f:
                    continue
                cosine, height, meets = 0.0, 0.0, True
                for k in range(3):
                    cosine += normals[f, k] * normals[g, k]
                    height += normals[f, k] * (corners[g, k] - corners[f, k])
                    meets &= min(corners[g, k], corners[g, 3 + k], corners[g, 6 + k]) <= box[3 + k]
                    meets &= max(corners[g, k], corners[g, 3 + k], corners[g, 6 + k]) >= box[k]
                if meets and cosine < ALIGNED - 1.0 and abs(height) <= gap:
                    result[f] = True
    return result
