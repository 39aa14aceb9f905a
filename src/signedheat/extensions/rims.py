"""How a shape goes on beyond its rims: along its faces, or flat across a hole in them.

At a rim each face points on, out of its boundary edge. Around a hole in a flat face these directions cancel, around one
in a curved face they add up to a little, and at the end of half a body they all agree. Over a spherical cap their sum,
over the rim's length, is the sine of half the cap's angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.components import connected_components, same_positions
from ..geometry.edges import edge_table

APART = 0.5
"""Share of the length of all rims that may go around single faces: where it is more, rims tell nothing."""


@dataclass(frozen=True, eq=False)
class Rims:
    """Places on boundary edges, at most a cell apart, and how far faces go on there.

    Attributes
    ----------
    places : (s, 3) float
        In units of length, from the first node of a grid.
    going_on : (s,) float
        From 0, where a hole is in a flat face, to 1, where half a body ends.
    """

    places: NDArray[np.float64]
    going_on: NDArray[np.float64]

    @cached_property
    def _tree(self) -> scipy.spatial.cKDTree:
        return scipy.spatial.cKDTree(self.places)

    def going_on_at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) the same at the rim nearest to each of (n, 3) places."""
        found: NDArray[np.float64] = self.going_on[self._tree.query(places, workers=-1)[1]]
        return found


def rims_of(mesh: TriangleMesh, grid: Grid) -> Rims | None:
    """The rims of a mesh; None if it has none, or if most are those of single faces."""
    faces = same_positions(mesh.vertices)[mesh.faces]
    table = edge_table(faces)
    open_edge = table.face_counts == 1
    if not open_edge.any():
        return None
    owners = np.empty(len(open_edge), dtype=np.int64)
    owners[table.face_edges] = np.arange(len(faces))[:, None]
    edges, owners = table.vertices[open_edge], owners[open_edge]
    vertices = mesh.vertices - grid.origin
    tails, heads = vertices[edges[:, 0]], vertices[edges[:, 1]]
    along = heads - tails
    lengths = np.linalg.norm(along, axis=1)
    alone = open_edge[table.face_edges].all(axis=1)[owners]
    if lengths[alone].sum() > APART * lengths.sum():
        return None
    normals = mesh.face_area_vectors[owners]
    sizes = np.linalg.norm(normals, axis=1, keepdims=True)
    ahead = np.cross(along, normals / np.where(sizes > 0, sizes, 1.0))
    rim = connected_components(len(vertices), edges[:, 0], edges[:, 1])[edges[:, 0]]
    _, rim = np.unique(rim, return_inverse=True)
    sums = _sums(rim, ahead)
    agreed = np.linalg.norm(sums, axis=1)
    axes = sums / np.where(agreed > 0, agreed, 1.0)[:, None]
    rises = np.einsum("ij,ij->i", along, axes[rim])  # what is jagged goes up and down along the sum
    around = np.bincount(rim, np.sqrt(np.maximum(lengths**2 - rises**2, 0.0)))
    going_on = np.clip(agreed / np.where(around > 0, around, 1.0), 0.0, 1.0)
    counts = np.maximum(1, np.ceil(lengths / float(grid.spacing.min()))).astype(np.int64)
    of_edge = np.repeat(np.arange(len(edges)), counts)
    order = np.arange(len(of_edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (order + 0.5) / counts[of_edge]
    return Rims(tails[of_edge] + share[:, None] * along[of_edge], going_on[rim[of_edge]])


def _sums(groups: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(g, 3) sums of (n, 3) values by group."""
    return np.stack([np.bincount(groups, column) for column in values.T], axis=1)
