"""Curves and points as a set of triangles sees them: straight pieces in faces and along edges, and their ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from ..domains.curves import Curve, SurfacePoints
from ..errors import SourceError
from .geodesics.paths import join
from .intrinsic_mesh import LaidOutTriangles
from .surface_points import EDGE, VERTEX, Places, barycentric_in, distinct, locate, shared_faces, star


@dataclass(frozen=True, eq=False)
class Pieces:
    """One source in pieces.

    Attributes
    ----------
    nodes : Places
        (s,) distinct points of the source, in order of first appearance.
    ends : (k, 2) int
        The nodes that each piece joins; none for isolated points.
    faces : (k,) int
        A face that has the piece.
    edges : (k,) int
        The edge that the piece runs along, or −1 for a piece inside its face.
    vectors : (k,) complex
        Direction in which φ grows, times length; in the layout of the face, or in the frame of the edge.
    oriented : bool
        Whether the two sides differ.
    """

    nodes: Places
    ends: NDArray[np.int64]
    faces: NDArray[np.int64]
    edges: NDArray[np.int64]
    vectors: NDArray[np.complex128]
    oriented: bool

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """(k,) length of each piece."""
        return np.abs(self.vectors)

    @property
    def fits(self) -> bool:
        """Whether the triangles can hold it: all but unoriented curves that leave the edges."""
        return self.oriented or bool((self.nodes.kinds[self.ends] == VERTEX).all() and (self.edges >= 0).all())


@singledispatch
def pieces(
    source: Any, triangles: LaidOutTriangles, positions: NDArray[np.float64] | None = None, number: int = 0
) -> Pieces:
    """Cut a source into pieces.

    Parameters
    ----------
    source : Curve, SurfacePoints or Pieces
        Face ids refer to `triangles`. Points of a curve that share no face are joined by a shortest line.
    triangles : LaidOutTriangles
        The surface.
    positions : (n_vertices, 3) or (m, 3, 3) float, optional
        Vertices in space, or the corners of each face where faces lie in planes of their own, for curves whose normals
        are given.
    number : int
        Which of the sources this is, for messages.

    Raises
    ------
    SourceError
        If the source does not fit the surface.
    """
    raise SourceError(
        f"source {number} is a {type(source).__name__}: on a surface, distance is measured to a Curve or SurfacePoints "
        "(see the domain's path, polyline, level_set and points_at)"
    )


def in_pieces(
    sources: Sequence[Any], triangles: LaidOutTriangles, positions: NDArray[np.float64] | None = None
) -> list[list[Pieces]]:
    """Each of several sources in pieces; a sequence of curves and points counts as one source."""
    return [
        [pieces(item, triangles, positions, number) for item in (source if isinstance(source, Sequence) else [source])]
        for number, source in enumerate(sources)
    ]


@pieces.register
def _(source: Pieces, triangles: LaidOutTriangles, positions: Any = None, number: int = 0) -> Pieces:
    return source


@pieces.register
def _(source: SurfacePoints, triangles: LaidOutTriangles, positions: Any = None, number: int = 0) -> Pieces:
    places = locate(triangles, source.faces, source.barycentric, f"source {number}: point")
    none = np.empty(0, dtype=np.int64)
    return Pieces(places[distinct(places)[0]], np.empty((0, 2), np.int64), none, none, np.empty(0, complex), False)


@pieces.register
def _(source: Curve, triangles: LaidOutTriangles, positions: Any = None, number: int = 0) -> Pieces:
    name = f"curve {number}"
    places = locate(triangles, source.faces, source.barycentric, f"{name}: point")
    start = np.arange(source.n_segments)
    places, start, end, segment = join(triangles, places, start, (start + 1) % source.n_points, name)
    faces = shared_faces(triangles, places[start], places[end])
    first, who = distinct(places)
    ends = np.stack([who[start], who[end]], axis=1)
    at_start = barycentric_in(triangles, faces, places[start])
    at_end = barycentric_in(triangles, faces, places[end])
    corners = triangles.corner_positions[faces]
    steps = ((at_end - at_start) * corners).sum(axis=1)
    keep = (ends[:, 0] != ends[:, 1]) & (np.abs(steps) > 0)
    if not keep.any():
        raise SourceError(f"{name} has no length: all its points coincide; use SurfacePoints for isolated points")

    empty = (at_start == 0) & (at_end == 0)
    sides = (empty.argmax(axis=1) + 1) % 3
    along = empty.any(axis=1)
    edges = np.where(along, triangles.edges.of_faces[faces, sides], -1)
    faces, edges, sides, steps, along, ends, segment = (
        a[keep] for a in (faces, edges, sides, steps, along, ends, segment)
    )
    vectors = 1j * steps
    forward = np.where(triangles.edges.forward[faces, sides], 1, -1)
    of_edge = triangles.edge_vectors[faces, sides]
    ahead = np.sign((np.conj(of_edge) * steps).real) * forward
    vectors = np.where(along, 1j * ahead * np.abs(steps), vectors)
    if source.normals is not None and source.oriented:
        if positions is None:
            raise SourceError(f"{name} has normals in space, but this surface has no positions: leave the normals out")
        vectors = np.abs(steps) * given_directions(triangles, positions, faces, edges, source.normals[segment], name)
    return Pieces(places[first], ends, faces, edges, vectors, source.oriented)


def given_directions(
    triangles: LaidOutTriangles,
    positions: NDArray[np.float64],
    faces: NDArray[np.int64],
    edges: NDArray[np.int64],
    normals: NDArray[np.float64],
    name: str,
) -> NDArray[np.complex128]:
    """(k,) unit vectors along given normals: in the layout of the face, or in the frame of the edge.

    On an edge, each of its faces sees the normal in its own plane; their mean in the edge's frame counts.
    """
    inside = np.flatnonzero(edges < 0)
    directions = np.zeros(len(faces), dtype=np.complex128)
    directions[inside] = in_layout(triangles, positions, faces[inside], normals[inside])

    along = np.flatnonzero(edges >= 0)
    on_edges = Places(faces[along], np.zeros((len(along), 3)), np.full(len(along), EDGE), edges[along], edges[along])
    if len(along):
        which, around = star(triangles, on_edges)
        side = (triangles.edges.of_faces[around] == edges[along][which, None]).argmax(axis=1)
        seen = in_layout(triangles, positions, around, normals[along[which]])
        turned = np.conj(triangles.edge_directions[around, side]) * seen
        turned = np.where(triangles.reflected[around, side], np.conj(turned), turned)
        np.add.at(directions, along[which], turned)
    length = np.abs(directions)
    scale = np.linalg.norm(normals, axis=1)
    flat = np.flatnonzero(length <= 1e-6 * scale)
    if len(flat):
        raise SourceError(
            f"{name}: the normal {normals[flat[0]].tolist()} at face {faces[flat[0]]} does not lie along the surface: "
            "give the direction, tangent to the surface, in which the distance grows"
        )
    return directions / length


def in_layout(
    triangles: LaidOutTriangles,
    positions: NDArray[np.float64],
    faces: NDArray[np.int64],
    vectors: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """(k,) vectors in space as their faces see them, in layout coordinates."""
    of_faces = positions[faces] if positions.ndim == 3 else positions[triangles.corner_vertices[faces]]
    a, b, c = of_faces.transpose(1, 0, 2)
    first = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    normal = np.cross(first, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    second = np.cross(normal, first)
    seen = np.einsum("ij,ij->i", vectors, first) + 1j * np.einsum("ij,ij->i", vectors, second)
    edge = triangles.edge_vectors[faces, 0]
    return seen * edge / np.abs(edge)


def rows_of(triangles: LaidOutTriangles, places: Places) -> csr_matrix:
    """(n, n_vertices) sparse: values at vertices → values at places."""
    weights = places.barycentric
    index = np.repeat(np.arange(len(places)), 3).reshape(-1, 3)
    used = weights > 0
    columns = triangles.corner_vertices[places.faces]
    return csr_matrix((weights[used], (index[used], columns[used])), shape=(len(places), triangles.n_vertices))
