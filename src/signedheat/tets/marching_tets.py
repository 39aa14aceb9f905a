"""Level sets in tet meshes, as closed manifold surfaces: marching tetrahedra, closed along the boundary of the mesh."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..errors import OutsideError
from ..mesh.components import connected_components
from ..mesh.tet_shapes import TetShapes, face_table

CLEARANCE = 1e-3
"""Least distance of crossings from the ends of edges, relative to these, so that no two vertices coincide."""

# By the bits of a mask of the corners below the level: an even permutation that puts these first, and their number.
_ORDERS = np.zeros((16, 4), dtype=np.int64)
_COUNTS = np.array([bin(mask).count("1") for mask in range(16)])
_PAIRS = {(0, 1): (2, 3), (0, 2): (3, 1), (0, 3): (1, 2), (1, 2): (0, 3), (1, 3): (2, 0), (2, 3): (0, 1)}
for _k, _order in enumerate([(0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)]):
    _ORDERS[1 << _k] = _ORDERS[15 - (1 << _k)] = _order
for (_i, _j), _rest in _PAIRS.items():
    _ORDERS[(1 << _i) | (1 << _j)] = (_i, _j, *_rest)

# By the number of corners below the level: triangles between crossings, each crossing given by two corners of its edge.
_CUTS = {
    1: [[(0, 1), (0, 2), (0, 3)]],
    2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    3: [[(0, 1), (0, 3), (0, 2)]],
}
# The part of a boundary face below the level, likewise; (k, k) is corner k itself.
_LIDS = {
    1: [[(0, 0), (0, 1), (0, 2)]],
    2: [[(0, 0), (1, 1), (1, 2)], [(0, 0), (1, 2), (2, 0)]],
    3: [[(0, 0), (1, 1), (2, 2)]],
}


def closed_level_set(mesh: TetShapes, values: Floats, gradients: Floats, level: float) -> tuple[Floats, Ints]:
    """Return vertices and triangles of the surface that separates mesh vertices below a level from the others.

    Normals point to the greater values. Vertices of the surface lie where φ takes the level, to second order, by its
    values and gradients at the ends of edges. Where the surface meets the boundary of the mesh it is closed along the
    boundary, on the side below the level. Tets with a NaN corner count as outside the mesh.
    """
    tets = mesh.tets[~np.isnan(values[mesh.tets]).any(axis=1)]
    below = values < level
    used = below[tets]
    if not used.any() or used.all():
        low, high = np.nanmin(values), np.nanmax(values)
        raise OutsideError(
            f"level {level:g} is outside the values of the tet mesh, {low:g} to {high:g}",
            remedy="choose another level or a larger mesh",
            element=f"level {level:g}",
        )
    keys, _ = _triangles(tets, used, len(mesh.vertices), _CUTS)
    faces = face_table(tets)
    walls = faces.vertices[faces.tet_counts == 1]
    if below[walls].any() and not below[walls].all():
        keys = np.concatenate([keys, _triangles(walls, below[walls], len(mesh.vertices), _LIDS)[0]])
    return manifold(*_crossings(mesh.vertices, values, gradients, level, keys, CLEARANCE))


def level_triangles(vertices: Floats, tets: Ints, values: Floats, level: float) -> tuple[Floats, Ints, Ints]:
    """Return the level set of the linear interpolant, open at the boundary: positions, triangles, tet of each."""
    finite = np.flatnonzero(~np.isnan(values[tets]).any(axis=1))
    keys, owners = _triangles(tets[finite], (values < level)[tets[finite]], len(vertices), _CUTS)
    return *_crossings(vertices, values, np.zeros_like(vertices), level, keys, 0.0), finite[owners]


def _crossings(
    vertices: Floats, values: Floats, gradients: Floats, level: float, keys: Ints, clearance: float
) -> tuple[Floats, Ints]:
    """Return the positions at which edges take the level, and the index of the position of each key.

    A key is ``smaller · n + larger`` vertex id of an edge. At the fraction s of an edge e from a to b, φ is
    ``(1 − s) φ_a + s φ_b + ½ s (1 − s) (∇φ_a − ∇φ_b)·e``.
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
    """Return triangles by the keys of their corners (see `_crossings`), and the element of each."""
    corners = elements.shape[1]
    masks = below @ (1 << np.arange(corners))
    if corners == 4:
        orders, counts = _ORDERS, _COUNTS
    else:
        orders = np.array([[0, 1, 2], [0, 1, 2], [1, 2, 0], [0, 1, 2], [2, 0, 1], [2, 0, 1], [1, 2, 0], [0, 1, 2]])
        counts = _COUNTS[:8]
    keys, owners = [], []
    for count, triangles in table.items():
        chosen = np.flatnonzero(counts[masks] == count)
        ordered = np.take_along_axis(elements[chosen], orders[masks[chosen]], axis=1)
        for triangle in triangles:
            ends = [(ordered[:, a], ordered[:, b]) for a, b in triangle]
            keys.append(np.stack([np.minimum(a, b) * n + np.maximum(a, b) for a, b in ends], axis=1))
            owners.append(chosen)
    return np.concatenate(keys), np.concatenate(owners)


def manifold(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Make a closed oriented surface manifold: split vertices and edges at which it touches itself.

    Every halfedge is paired with one that runs in the opposite direction; corners that meet across a pair share a
    vertex.
    """
    m = len(triangles)
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    after = np.roll(np.arange(3 * m).reshape(m, 3), -1, axis=1).ravel()  # corner at the head of each halfedge
    n = len(positions)
    undirected = np.minimum(tails, heads) * n + np.maximum(tails, heads)
    forward = np.flatnonzero(tails < heads)
    backward = np.flatnonzero(tails > heads)
    forward = forward[np.argsort(undirected[forward], kind="stable")]
    backward = backward[np.argsort(undirected[backward], kind="stable")]
    joins = np.concatenate([forward, after[forward]]), np.concatenate([after[backward], backward])
    vertex = connected_components(3 * m, *joins)
    _, first = np.unique(vertex, return_index=True)
    return positions[tails[first]], vertex.reshape(m, 3)
