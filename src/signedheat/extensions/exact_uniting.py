"""What lies inside other bodies, told at the faces themselves: overlaps between the nodes of a coarse grid count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.components import same_positions
from ..geometry.edges import edge_table
from ..geometry.refining import split_at_edges
from ..geometry.winding_tree import WindingTree
from .uniting import BURIED, COVERED, Merged, Union, what_is_left, without_covered

FINEST = 64
"""Parts along the sides of the largest faces at whose centres is looked."""
ROUNDS = 40
"""How often faces are halved at most."""
MANY = 2_000_000
"""Faces beyond which none are cut further."""
INNER = np.array([[1.0, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]]) / np.array([[3.0], [10], [10], [10]])
"""Places of a piece that are looked at: barycentric coordinates."""


@dataclass(frozen=True, eq=False)
class _Depths:
    """Winding numbers beside a mesh's faces: the mean of both sides; the same on both beside doubled walls."""

    mesh: TriangleMesh
    walls: NDArray[np.bool_]
    tree: WindingTree

    @classmethod
    def of(cls, merged: Merged) -> _Depths:
        """Of a shape with faces."""
        assert not isinstance(merged.shape, PointCloud)
        mesh = merged.shape.triangulation
        return cls(mesh, merged.walls_among_triangles(), WindingTree.of(mesh.vertices[mesh.faces]))

    def covered(self, faces: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether places on faces lie inside other bodies."""
        behind = self.tree.behind(faces, places)
        result: NDArray[np.bool_] = np.where(self.walls[faces], behind > BURIED, behind - 0.5 > COVERED)
        return result


def exactly_without_covered(merged: Merged, apart: float, finest: float) -> Union:
    """Leave out what lies inside other bodies, and cut faces that are partly inside.

    Parameters
    ----------
    merged : Merged
        The shape.
    apart : float
        Distance of the places of large faces that are looked at.
    finest : float
        Length of the edges of the pieces at the cut, at most.
    """
    depths = _Depths.of(merged)
    mesh = depths.mesh
    some, every = _on_whole_faces(depths, apart)
    faces = same_positions(mesh.vertices)[mesh.faces]
    if not some.any():
        return what_is_left(merged, mesh, depths.walls, mesh.vertices, faces, np.arange(len(faces)), some)
    return what_is_left(merged, mesh, depths.walls, *_cut(depths, faces, some, every, finest))


def union_for(merged: Merged, winding: NDArray[np.float64], grid: Grid, finest: float | None) -> Union:
    """What lies inside other bodies left out: as the nodes of a grid tell, or exactly, for a band of that spacing."""
    if finest is None or isinstance(merged.shape, PointCloud):
        return without_covered(merged, winding, grid)
    return exactly_without_covered(merged, float(grid.spacing.min()), finest)


def overlap_between_nodes(merged: Merged, grid: Grid, finest: float | None) -> bool:
    """Whether bodies overlap where a grid that is coarse for a band has no nodes."""
    return finest is not None and bool(_on_whole_faces(_Depths.of(merged), float(grid.spacing.min()))[0].any())


def _on_whole_faces(depths: _Depths, apart: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(m,) whether some, and whether all of the places of each face are covered."""
    triangles = depths.tree.triangles
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / apart), 1, FINEST).astype(np.int64)
    some, every = np.zeros(len(triangles), dtype=bool), np.ones(len(triangles), dtype=bool)
    for n in np.unique(parts):
        chosen = np.flatnonzero(parts == n)
        i, j = (np.argwhere(np.add.outer(np.arange(n), np.arange(n)) < n).T + 1 / 3) / n
        weights = np.stack([1 - i - j, i, j], axis=1)
        places = np.einsum("pc,fcd->fpd", weights, triangles[chosen]).reshape(-1, 3)
        covered = depths.covered(np.repeat(chosen, len(weights)), places).reshape(len(chosen), -1)
        some[chosen], every[chosen] = covered.any(axis=1), covered.all(axis=1)
    return some, every


def _cut(
    depths: _Depths, faces: NDArray[np.int64], some: NDArray[np.bool_], every: NDArray[np.bool_], finest: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Vertices, faces, the face of the mesh that each is part of, and whether it is covered."""
    vertices, origins = depths.mesh.vertices, np.arange(len(faces))
    partly = (some & ~every) | _beside_others(faces, some, every, len(vertices))
    covered = every
    for _ in range(ROUNDS):
        table = edge_table(faces)
        ends = vertices[table.vertices]
        split = np.zeros(len(ends), dtype=bool)
        split[table.face_edges[partly]] = True
        split &= np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > finest
        if not split.any() or len(faces) > MANY:
            break
        vertices, faces, parents = split_at_edges(vertices, faces, split, np.full(len(split), 0.5))
        origins, covered, partly = origins[parents], covered[parents], partly[parents]
        at = np.flatnonzero(partly)
        places = np.einsum("pc,fcd->fpd", INNER, vertices[faces[at]]).reshape(-1, 3)
        inside = depths.covered(np.repeat(origins[at], len(INNER)), places).reshape(len(at), -1)
        covered[at] = inside.sum(axis=1) > inside.shape[1] / 2
        some, every = covered.copy(), covered.copy()
        some[at], every[at] = inside.any(axis=1), inside.all(axis=1)
        partly &= (some & ~every) | _beside_others(faces, some, every, len(vertices))
    return vertices, faces, origins, covered


def _beside_others(
    faces: NDArray[np.int64], some: NDArray[np.bool_], every: NDArray[np.bool_], n_vertices: int
) -> NDArray[np.bool_]:
    """(m,) faces that share a vertex with faces that are covered where they are not, or the other way round."""
    has_covered, has_free = np.zeros(n_vertices, dtype=bool), np.zeros(n_vertices, dtype=bool)
    has_covered[faces[some]], has_free[faces[~every]] = True, True
    return np.asarray((has_covered & has_free)[faces].any(axis=1))
