"""Level sets on tets as closed surfaces: marching tetrahedra, with lids along the boundary."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError, OutsideError
from ..mesh.edges import CLEARANCE
from ..mesh.pinches import separated
from ..mesh.tet_shapes import TetShapes, face_table

# By a bit mask of the corners below the level: an even permutation that puts these corners first, and their number.
BELOW_FIRST = np.zeros((16, 4), dtype=np.int64)
N_BELOW = np.array([bin(mask).count("1") for mask in range(16)])
EVEN_PAIRS = {(0, 1): (2, 3), (0, 2): (3, 1), (0, 3): (1, 2), (1, 2): (0, 3), (1, 3): (2, 0), (2, 3): (0, 1)}
for _k, _order in enumerate([(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]):
    BELOW_FIRST[1 << _k] = BELOW_FIRST[15 - (1 << _k)] = _order
for (_i, _j), _rest in EVEN_PAIRS.items():
    BELOW_FIRST[(1 << _i) | (1 << _j)] = (_i, _j, *_rest)

# By the number of corners below the level: triangles between crossings, each crossing given by two corners of its edge.
TET_CUTS = {
    1: [[(0, 1), (0, 2), (0, 3)]],
    2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    3: [[(0, 1), (0, 3), (0, 2)]],
}
# In the same way, triangles of the part of a boundary face below the level; (k, k) is corner k itself.
FACE_LIDS = {
    1: [[(0, 0), (0, 1), (0, 2)]],
    2: [[(0, 0), (1, 1), (1, 2)], [(0, 0), (1, 2), (2, 0)]],
    3: [[(0, 0), (1, 1), (2, 2)]],
}


def closed_level_set(mesh: TetShapes, values: Floats, gradients: Floats, level: float) -> tuple[Floats, Ints]:
    """Extract the surface around the mesh vertices below a level: (k, 3) vertices and (t, 3) triangles.

    It faces greater values, and is closed along the boundary of the mesh. Its vertices lie on edges, where φ equals the
    level by its (n,) values and (n, 3) gradients at their ends. Tets with NaN are left out.
    """
    tets = mesh.tets[~np.isnan(values[mesh.tets]).any(axis=1)]
    if not len(tets):
        raise GeometryError("no tet has values at its corners", remedy="compute the field anew", element="values")
    below = values < level
    used = below[tets]
    if not used.any() or used.all():
        low, high = np.nanmin(values), np.nanmax(values)
        raise OutsideError(
            f"level {level:g} is outside the values of the tet mesh, {low:g} to {high:g}",
            remedy="choose another level or a larger mesh",
            element=f"level {level:g}",
        )
    keys, _ = _triangles(tets, used, len(mesh.vertices), TET_CUTS)
    faces = face_table(tets)
    walls = faces.vertices[faces.tet_counts == 1]
    if below[walls].any() and not below[walls].all():
        keys = np.concatenate([keys, _triangles(walls, below[walls], len(mesh.vertices), FACE_LIDS)[0]])
    return separated(*_crossings(mesh.vertices, values, gradients, level, keys, CLEARANCE))


def level_triangles(vertices: Floats, tets: Ints, values: Floats, level: float) -> tuple[Floats, Ints, Ints]:
    """Extract the level set of (n,) values, linear in tets: (k, 3) positions, (t, 3) triangles, and their (t,) tets.

    It is open at the boundary of the mesh. Tets with NaN are left out.
    """
    finite = np.flatnonzero(~np.isnan(values[tets]).any(axis=1))
    keys, owners = _triangles(tets[finite], (values < level)[tets[finite]], len(vertices), TET_CUTS)
    return *_crossings(vertices, values, np.zeros_like(vertices), level, keys, 0.0), finite[owners]


def _crossings(
    vertices: Floats, values: Floats, gradients: Floats, level: float, keys: Ints, clearance: float
) -> tuple[Floats, Ints]:
    """Find the points where φ equals a level, on edges with (t, 3) keys ``smaller · n + larger`` of their vertex ids.

    Return (k, 3) positions, one for each distinct key, and (t, 3) their indices. At the fraction s of the edge e from a
    to b, φ is ``(1 − s) φ_a + s φ_b + ½ s (1 − s) (∇φ_a − ∇φ_b)·e``. Points are at least `clearance` of the length of
    the edge away from its ends.
    """
    crossings, triangles = np.unique(keys, return_inverse=True)
    low, high = crossings // len(vertices), crossings % len(vertices)
    edges, below, rise = vertices[high] - vertices[low], level - values[low], values[high] - values[low]
    bend = np.einsum("ei,ei->e", gradients[low] - gradients[high], edges) / 2
    slope = rise + bend
    divisor = slope + np.copysign(np.sqrt(np.maximum(slope**2 - 4 * bend * below, 0)), rise)
    along = np.clip(2 * below / np.where(divisor != 0, divisor, 1), clearance, 1 - clearance)
    return vertices[low] + along[:, None] * edges, triangles.reshape(-1, 3)


def _triangles(
    elements: Ints, below: Bools, n: int, table: dict[int, list[list[tuple[int, int]]]]
) -> tuple[Ints, Ints]:
    """Cut tets, (m, 4), or triangles, (m, 3), by a table such as `TET_CUTS`.

    Return triangles, as (t, 3) keys of the edges on which their corners lie (see `_crossings`), and (t,) the elements
    that they are in. `below` tells which corners are below the level.
    """
    corners = elements.shape[1]
    masks = below @ (1 << np.arange(corners))
    if corners == 4:
        orders, counts = BELOW_FIRST, N_BELOW
    else:
        orders = np.array([[0, 1, 2], [0, 1, 2], [1, 2, 0], [0, 1, 2], [2, 0, 1], [2, 0, 1], [1, 2, 0], [0, 1, 2]])
        counts = N_BELOW[:8]
    keys, owners = [], []
    for count, triangles in table.items():
        chosen = np.flatnonzero(counts[masks] == count)
        ordered = np.take_along_axis(elements[chosen], orders[masks[chosen]], axis=1)
        for triangle in triangles:
            ends = [(ordered[:, a], ordered[:, b]) for a, b in triangle]
            keys.append(np.stack([np.minimum(a, b) * n + np.maximum(a, b) for a, b in ends], axis=1))
            owners.append(chosen)
    return np.concatenate(keys), np.concatenate(owners)
