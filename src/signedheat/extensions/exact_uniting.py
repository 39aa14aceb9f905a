"""What lies inside other bodies, told at the faces themselves: overlaps between the nodes of a coarse grid count."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..domains.grid import Grid
from ..domains.point_cloud import PointCloud
from ..domains.triangle_mesh import TriangleMesh
from ..geometry.components import same_positions
from ..geometry.edges import edge_table
from ..geometry.refining import split_at_edges
from ..geometry.winding_tree import WindingTree
from .uniting import BURIED, COVERED, Merged, Union, what_is_left

FINEST = 64
"""Parts along the sides of the largest faces at whose centres is looked."""
ROUNDS = 40
"""How often faces are halved at most."""
HALVINGS = 6
"""How often the part of an edge in which it enters another body is halved."""
MARGIN = 0.02
"""Share of an edge that a cut keeps from its ends."""
INWARDS = 0.02
"""Share of the way from an edge to the centre of a piece, on which other faces do not meet it."""
MANY = 2_000_000
"""Faces beyond which none are cut further."""


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Winding numbers beside a mesh's faces: the mean of both sides; the same on both beside doubled walls.

    Attributes
    ----------
    merged : Merged
        The shape, with faces.
    apart : float
        Distance of the places of large faces that are looked at.
    finest : float
        Length of the edges of the pieces into which faces are cut, at most.
    """

    merged: Merged
    apart: float
    finest: float

    @cached_property
    def mesh(self) -> TriangleMesh:
        """Its triangles."""
        assert not isinstance(self.merged.shape, PointCloud)
        return self.merged.shape.triangulation

    @cached_property
    def walls(self) -> NDArray[np.bool_]:
        """(m,) those of doubled walls."""
        return self.merged.walls_among_triangles()

    @cached_property
    def tree(self) -> WindingTree:
        """Their winding numbers."""
        return WindingTree.of(self.mesh.vertices[self.mesh.faces])

    @cached_property
    def of_faces(self) -> NDArray[np.float64]:
        """(m,) share of each face that is covered."""
        return self.covered(np.arange(self.mesh.n_faces), self.tree.triangles)

    def covered(self, faces: NDArray[np.int64], pieces: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) share of places on (n, 3, 3) pieces of faces that lie inside other bodies."""
        longest = np.linalg.norm(pieces - np.roll(pieces, 1, axis=1), axis=2).max(axis=1)
        parts = np.clip(np.ceil(longest / self.apart), 1, FINEST).astype(np.int64)
        share = np.empty(len(pieces))
        for n in np.unique(parts):
            chosen = np.flatnonzero(parts == n)
            i, j = (np.argwhere(np.add.outer(np.arange(n), np.arange(n)) < n).T + 1 / 3) / n
            weights = np.stack([1 - i - j, i, j], axis=1)
            places = np.einsum("pc,fcd->fpd", weights, pieces[chosen]).reshape(-1, 3)
            share[chosen] = (
                self.at(np.repeat(faces[chosen], len(weights)), places).reshape(len(chosen), -1).mean(axis=1)
            )
        return share

    def at(self, faces: NDArray[np.int64], places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) whether places in faces, and not on their rims, lie inside other bodies."""
        behind = self.tree.behind(faces, places)
        result: NDArray[np.bool_] = np.where(self.walls[faces], behind > BURIED, behind - 0.5 > COVERED)
        return result


def exactly_without_covered(overlaps: Overlaps) -> Union:
    """Leave out what lies inside other bodies, and cut faces that are partly inside."""
    mesh, share = overlaps.mesh, overlaps.of_faces
    faces = same_positions(mesh.vertices)[mesh.faces]
    parts = mesh.vertices, faces, np.arange(len(faces)), share > 0.5
    return what_is_left(overlaps.merged, mesh, overlaps.walls, *(_cut(overlaps, faces) if share.any() else parts))


def overlaps_of(merged: Merged, grid: Grid, finest: float | None) -> Overlaps | None:
    """Of the bodies of a shape, for a band of some spacing around a coarse grid; None where a grid tells them."""
    if finest is None or isinstance(merged.shape, PointCloud):
        return None
    return Overlaps(merged, float(grid.spacing.min()), finest)


def _cut(
    overlaps: Overlaps, faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Vertices, faces, the face of the mesh that each is part of, and whether it is covered."""
    vertices, origins, share = overlaps.mesh.vertices, np.arange(len(faces)), overlaps.of_faces
    partly = _partly(faces, share, len(vertices))
    for _ in range(ROUNDS):
        table = edge_table(faces)
        ends = vertices[table.vertices]
        split = np.zeros(len(ends), dtype=bool)
        split[table.face_edges[partly]] = True
        split &= np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > overlaps.finest
        if not split.any() or len(faces) > MANY:
            break
        vertices, faces, parents = split_at_edges(vertices, faces, split, np.full(len(split), 0.5))
        origins, share, partly = origins[parents], share[parents], partly[parents]
        at = np.flatnonzero(partly)
        share[at] = overlaps.covered(origins[at], vertices[faces[at]])
        partly &= _partly(faces, share, len(vertices))
    return _cut_at_crossings(overlaps, vertices, faces, origins, share > 0.5, partly)


def _cut_at_crossings(
    overlaps: Overlaps,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    origins: NDArray[np.int64],
    covered: NDArray[np.bool_],
    partly: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """The same, where faces that are partly covered are cut where their edges enter and leave other bodies."""
    table = edge_table(faces)
    owners = np.full(len(table.vertices), -1, dtype=np.int64)
    owners[table.face_edges[partly]] = np.flatnonzero(partly)[:, None]
    edges = np.flatnonzero(owners >= 0)
    owner, ends = owners[edges], vertices[table.vertices[edges]]
    ends += INWARDS * (vertices[faces[owner]].mean(axis=1)[:, None] - ends)
    owner, (start, stop) = origins[owner], ends.transpose(1, 0, 2)
    first = overlaps.at(owner, start)
    crossed = first != overlaps.at(owner, stop)
    edges, owner, start, stop, first = (each[crossed] for each in (edges, owner, start, stop, first))
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        before = overlaps.at(owner, start + middle[:, None] * (stop - start)) == first
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    shares = np.full(len(owners), 0.5)
    shares[edges] = np.clip(0.5 * (low + high), MARGIN, 1 - MARGIN)
    cut = np.zeros(len(owners), dtype=bool)
    cut[edges] = True
    vertices, faces, parents = split_at_edges(vertices, faces, cut, shares)
    origins, covered = origins[parents], covered[parents]
    pieces = np.flatnonzero(np.bincount(parents)[parents] > 1)
    covered[pieces] = overlaps.at(origins[pieces], vertices[faces[pieces]].mean(axis=1))
    return vertices, faces, origins, covered


def _partly(faces: NDArray[np.int64], share: NDArray[np.float64], n_vertices: int) -> NDArray[np.bool_]:
    """(m,) faces that are covered in part, or share a vertex with others that are where they are not."""
    has_covered, has_free = np.zeros(n_vertices, dtype=bool), np.zeros(n_vertices, dtype=bool)
    has_covered[faces[share > 0]], has_free[faces[share < 1]] = True, True
    return np.asarray((has_covered & has_free)[faces].any(axis=1))
