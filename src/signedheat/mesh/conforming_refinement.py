"""Conforming refinement of intrinsic meshes, which cuts triangles so that curves run along edges.

Each triangle that is cut gets a constrained triangulation, with points inside it as vertices and segments as edges.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from ..arrays import Bools, Complexes, Floats, Ints, mask_of
from ..errors import SourceError
from .curve_segments import CurveSegments, MergedSources
from .edges import EdgeTable
from .gluing import flip_all, glue, lay_out
from .intrinsic_mesh import IntrinsicMesh
from .planar_triangulation import triangulate_crossing
from .surface_points import EDGE, FACE, VERTEX, ZERO_COORDINATE, LocatedPoints, barycentric_on_edges, points_at_vertices

Point = tuple[float, float]
"""A point of a face, in coordinates in which the corners are `CORNERS`."""
Edge = tuple[int, int]
"""The indices of both ends of an edge among the points of a face."""

CORNERS: tuple[Point, Point, Point] = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)
"""Corners of a face in the coordinates in which it is triangulated."""


def refine_to_conform(
    triangles: IntrinsicMesh, groups: Sequence[Sequence[CurveSegments]]
) -> tuple[IntrinsicMesh, list[list[CurveSegments]]]:
    """Cut the faces that unoriented curves cross, along these; return the mesh, and groups of sources on it.

    Points of all sources that lie in these faces become vertices.
    """
    parts = [part for group in groups for part in group]
    if all(part.is_conforming for part in parts):
        return triangles, [list(group) for group in groups]
    finer, moved, is_new, _ = cut_along(triangles, parts, [not part.is_conforming for part in parts])
    finer, moved = flip_new_faces(finer, moved, is_new)
    pieces = iter(moved.parts([part.oriented for part in parts]))
    return finer, [[next(pieces) for _ in group] for group in groups]


def cut_along(
    triangles: IntrinsicMesh,
    parts: Sequence[CurveSegments],
    unfit: Sequence[bool] | None = None,
    begin: Ints | None = None,
) -> tuple[IntrinsicMesh, MergedSources, Bools, Ints]:
    """Cut faces so that sources run along edges.

    Returns the mesh, the sources on it, (m,) whether each of its faces is new, and (m,) the face of which each is a
    part. Faces are cut along the sources for which `unfit` is true, by default all, and then along all others in them.
    The triangulation of face f begins at its corner ``begin[f]``.
    """
    merged = MergedSources.of(parts)
    faces, edges = affected_elements(triangles, merged, [True] * len(parts) if unfit is None else unfit)
    if not len(faces) and not len(edges):
        return triangles, merged, np.zeros(triangles.n_faces, dtype=bool), np.arange(triangles.n_faces)
    begin = np.zeros(triangles.n_faces, dtype=np.int64) if begin is None else begin
    return FaceCutter(triangles, merged, faces, edges, begin).assemble()


def affected_elements(triangles: IntrinsicMesh, merged: MergedSources, unfit: Sequence[bool]) -> tuple[Ints, Ints]:
    """Return the faces to cut and the edges to split for sources that are `unfit`.

    A face with a split edge is cut, too. A cut face splits the edges on which segments in it end.
    """
    # a graph of the faces, 0 to m − 1, and the edges, from m on: arcs lead from what is cut to what must then be cut,
    # and from one more node, the last, to what is cut at first
    nodes, inside, m = merged.nodes, merged.edges < 0, triangles.n_faces
    last = m + triangles.n_edges
    face, end = np.repeat(merged.faces[inside], 2), merged.ends[inside].ravel()
    on_edge = nodes.kinds[end] == EDGE
    with_points = mask_of(triangles.n_edges, nodes.elements[nodes.kinds == EDGE])
    faces_at, side = np.nonzero(with_points[triangles.edges.face_edges])
    wanted = nodes[np.unique(np.concatenate([s for s, bad in zip(merged.samples, unfit, strict=True) if bad]))]
    begin = [
        merged.faces[inside & np.asarray(unfit)[merged.owners]],
        wanted.elements[wanted.kinds == FACE],
        m + wanted.elements[wanted.kinds == EDGE],
    ]
    heads = np.concatenate([m + nodes.elements[end[on_edge]], faces_at, *begin])
    given = np.concatenate([face[on_edge], m + triangles.edges.face_edges[faces_at, side]])
    tails = np.concatenate([given, np.full(len(heads) - len(given), last)])
    graph = csr_matrix((np.ones(len(heads)), (tails, heads)), shape=(last + 1, last + 1))
    reached = np.sort(breadth_first_order(graph, last, return_predecessors=False))[:-1]
    return reached[reached < m], reached[reached >= m] - m


class FaceCutter:
    """An intrinsic mesh while some of its `faces`, ids, are cut along segments, and the ids `edges` divided at nodes.

    The triangulation of a face begins at its corner ``begin[face]``. Making a cutter does all the work; `assemble`
    makes a mesh of the results, which are numbered in lists and dictionaries until then.
    """

    def __init__(self, triangles: IntrinsicMesh, merged: MergedSources, faces: Ints, edges: Ints, begin: Ints) -> None:
        self.triangles, self.merged, self.begin = triangles, merged, begin
        self.n_vertices, self.n_edges = triangles.n_vertices, triangles.n_edges
        self.faces: list[NewFace] = []
        self.pieces: list[NewSegment] = []
        self.cut_faces = faces.tolist()
        # the vertex at each node of the sources, or −1, and the node at each vertex that has one
        nodes = merged.nodes
        self.vertex_of = np.where(nodes.kinds == VERTEX, nodes.elements, -1).tolist()
        self.node_at = {v: i for i, v in enumerate(self.vertex_of) if v >= 0}
        # nodes on each edge that is divided, in order, and in each face that is cut; they become vertices
        self.on_edge: dict[int, list[int]] = {e: [] for e in edges.tolist()}
        self.in_face: dict[int, list[int]] = {f: [] for f in self.cut_faces}
        for i, (kind, element) in enumerate(zip(nodes.kinds.tolist(), nodes.elements.tolist(), strict=True)):
            home = self.on_edge if kind == EDGE else self.in_face if kind == FACE else {}
            if element in home:
                home[element].append(i)
                self.vertex_of[i] = self.new_vertex()
                self.node_at[self.vertex_of[i]] = i
        for members in self.on_edge.values():
            members.sort(key=lambda i: nodes.along[i])
        self.sub_edges = {e: [self.new_edge() for _ in range(len(m) + 1)] for e, m in self.on_edge.items()}

        self.chains: dict[int, tuple[list[int], list[float], dict[int, int]]] = {}  # results of `along_edge`
        inside = defaultdict(list)
        rows = zip(merged.ends.tolist(), merged.faces.tolist(), merged.edges.tolist(), strict=True)
        for p, ((tail, head), face, edge) in enumerate(rows):
            if edge in self.on_edge:
                self.cut_along(p, edge)
            elif edge < 0 and face in self.in_face:
                inside[face].append(p)
            else:
                self.pieces.append(NewSegment(tail, head, face, edge, merged.vectors[p], merged.owners[p]))
        for face in self.cut_faces:
            self.cut_face(face, inside[face])

    def new_vertex(self) -> int:
        """Return the id of a new vertex."""
        self.n_vertices += 1
        return self.n_vertices - 1

    def new_edge(self) -> int:
        """Return the id of a new edge."""
        self.n_edges += 1
        return self.n_edges - 1

    def node(self, vertex: int) -> int:
        """Return the node of the sources at a vertex; a new one if there is none."""
        if vertex not in self.node_at:
            self.node_at[vertex] = len(self.vertex_of)
            self.vertex_of.append(vertex)
        return self.node_at[vertex]

    def cut_along(self, p: int, edge: int) -> None:
        """Replace segment p, which runs along a split edge, by segments between successive vertices on the edge."""
        merged, (vertices, fractions, index) = self.merged, self.along_edge(edge)
        a, b = (index[self.vertex_of[i]] for i in merged.ends[p].tolist())
        step = 1 if a < b else -1
        for k in range(a, b, step):
            vector = merged.vectors[p] * (abs(fractions[k + step] - fractions[k]) / abs(fractions[b] - fractions[a]))
            ends = self.node(vertices[k]), self.node(vertices[k + step])
            sub = self.sub_edges[edge][min(k, k + step)]
            self.pieces.append(NewSegment(*ends, -1, sub, vector, merged.owners[p]))

    def along_edge(self, edge: int) -> tuple[list[int], list[float], dict[int, int]]:
        """Return the vertices along a split edge, the fraction of the edge at each, and their positions in this order.

        The positions are by vertex id.
        """
        if edge not in self.chains:
            chain = self.on_edge[edge]
            tail, head = self.triangles.edges.vertices[edge].tolist()
            vertices = [tail, *(self.vertex_of[i] for i in chain), head]
            fractions = [0.0, *self.merged.nodes.along[chain].tolist(), 1.0]
            self.chains[edge] = vertices, fractions, {v: k for k, v in reversed(list(enumerate(vertices)))}
        return self.chains[edge]

    def cut_face(self, face: int, inside: list[int]) -> None:
        """Cut a face along the segments inside it, whose numbers are given."""
        around = ((self.begin[face] + np.arange(3)) % 3).tolist()  # its corners; points are (u, v) in the last two
        outline = self.outline(face, around)
        points, vertices = outline.points, outline.vertices
        for i in self.in_face[face]:
            u, v = self.merged.nodes.barycentric[i, around[1:]].tolist()
            points.append((u, v))
            vertices.append(self.vertex_of[i])

        point_at = {v: k for k, v in reversed(list(enumerate(vertices)))}
        ends = [[point_at[self.vertex_of[i]] for i in self.merged.ends[p].tolist()] for p in inside]
        segments, corners = np.array(ends, dtype=np.int64).reshape(-1, 2), np.array(outline.corners)
        cut, divided, triangles, _, chains, starts = triangulate_crossing(
            np.array(points), corners, segments, ZERO_COORDINATE
        )
        ways = np.split(chains, starts[1:-1]) if inside else []
        if any(way[-1] != end for way, (_, end) in zip(ways, ends, strict=True)):
            raise SourceError(
                f"the curves cross face {face}, which is as thin as rounding",
                remedy="merge the vertices that nearly coincide",
                element=f"face {face}",
            )
        middles = {(u, v): len(points) + k for k, edge in enumerate(divided.tolist()) for u, v in (edge, edge[::-1])}
        vertices += [self.new_vertex() for _ in divided]  # where segments cross
        (x, y), (a, b, c) = cut.T, self.triangles.corner_positions[face, around]
        positions = a + x * (b - a) + y * (c - a)
        self.add_faces(face, triangles, outline, positions)
        for p, way in zip(inside, ways, strict=True):
            self.add_pieces(p, with_middles(way.tolist(), middles), outline, positions)

    def outline(self, face: int, around: list[int]) -> Outline:
        """Return the points, vertices and edges along the boundary of a face, with the nodes that divide its sides.

        `around` are its corners 0, 1 and 2 in cyclic order, from the one on that is at (0, 0).
        """
        triangles, along = self.triangles, self.merged.nodes.along
        result = Outline()
        for k, side in enumerate(around):
            edge, forward = int(triangles.edges.face_edges[face, side]), bool(triangles.edges.forward[face, side])
            order = 1 if forward else -1
            # the points of the side, without its end, and then the edges between them
            (x, y), (u, v), begin = CORNERS[k], CORNERS[(k + 1) % 3], len(result.points)
            result.points.append((x, y))
            result.vertices.append(int(triangles.corner_vertices[face, side]))
            for i in self.on_edge.get(edge, [])[::order]:
                t = float(along[i] if forward else 1 - along[i])
                result.points.append((x + t * (u - x), y + t * (v - y)))
                result.vertices.append(self.vertex_of[i])
            end = len(result.points)
            result.corners.append(end)
            reflected, parts = bool(triangles.reflected[face, side]), self.sub_edges.get(edge, [edge])[::order]
            for (a, b), part in zip(pairwise([*range(begin, end), end if k < 2 else 0]), parts, strict=True):
                result.edge_of[a, b] = part, forward
                result.frames[part] = (a, b, reflected) if forward else (b, a, reflected)
        return result

    def add_faces(self, face: int, triangles: Ints, outline: Outline, positions: Complexes) -> None:
        """Add the triangles of a face, (k, 3) indices of points of its outline, and the new edges between them."""
        for corners in triangles.tolist():
            sides = list(pairwise([*corners, corners[0]]))
            for u, v in sides:
                if (u, v) not in outline.edge_of:
                    edge = self.new_edge()
                    outline.edge_of[u, v], outline.edge_of[v, u] = (edge, True), (edge, False)
                    outline.frames[edge] = u, v, False
            edges, ahead = zip(*(outline.edge_of[side] for side in sides), strict=True)
            vertices = [outline.vertices[i] for i in corners]
            self.faces.append(NewFace(face, vertices, edges, ahead, positions[corners]))

    def add_pieces(self, p: int, chain: list[int], outline: Outline, positions: Complexes) -> None:
        """Add the parts of segment p between successive points of a chain, with normals in the frames of the edges."""
        whole = abs(positions[chain[-1]] - positions[chain[0]])
        for u, v in pairwise(chain):
            edge, _ = outline.edge_of.get((u, v)) or outline.edge_of[v, u]
            tail, head, reflected = outline.frames[edge]
            step = np.conj(positions[head] - positions[tail])
            vector = self.merged.vectors[p] * step / whole if whole > 0 else 0j  # its ends are nearer than rounding
            vector = np.conj(vector) if reflected else vector
            ends = self.node(outline.vertices[u]), self.node(outline.vertices[v])
            self.pieces.append(NewSegment(*ends, -1, edge, vector, self.merged.owners[p]))

    def assemble(self) -> tuple[IntrinsicMesh, MergedSources, Bools, Ints]:
        """Return the cut mesh, its sources, (m,) whether each face is new, and (m,) the face that each is part of."""
        triangles, merged = self.triangles, self.merged
        kept = np.setdiff1d(np.arange(triangles.n_faces), self.cut_faces)
        parents = np.concatenate([kept, [f.parent for f in self.faces]]).astype(np.int64)
        order = np.argsort(parents, kind="stable")  # the first face of an edge, or a part of it, stays the first

        def with_new(old: NDArray[Any], name: str) -> NDArray[Any]:
            return np.concatenate([old[kept], [getattr(f, name) for f in self.faces]])[order]

        face_edges = with_new(triangles.edges.face_edges, "edges")
        forward = with_new(triangles.edges.forward, "ahead")
        corners = with_new(triangles.corner_vertices, "corners")
        # the mesh, with edges numbered without gaps
        used, first, flat = np.unique(face_edges, return_index=True, return_inverse=True)
        vertices = np.stack([corners.ravel()[first], np.roll(corners, -1, axis=1).ravel()[first]], axis=1)
        table = EdgeTable(vertices, flat.reshape(-1, 3), forward)
        finer = IntrinsicMesh(corners, with_new(triangles.corner_positions, "positions"), table, self.n_vertices)

        new_face = np.full(triangles.n_faces, -1)
        is_new = order >= len(kept)
        new_face[parents[order][~is_new]] = np.flatnonzero(~is_new)
        new_edge = np.full(self.n_edges, -1)
        new_edge[used] = np.arange(len(used))

        # the nodes and segments of the sources, on elements of this mesh
        at_vertex = np.array(self.vertex_of)
        fill = np.zeros(len(at_vertex) - len(merged.nodes))
        kinds = np.where(at_vertex >= 0, VERTEX, np.concatenate([merged.nodes.kinds, fill]).astype(np.int64))
        elements = np.concatenate([merged.nodes.elements, fill]).astype(np.int64)
        elements[kinds == VERTEX] = at_vertex[kinds == VERTEX]
        elements[kinds == EDGE] = new_edge[elements[kinds == EDGE]]
        elements[kinds == FACE] = new_face[elements[kinds == FACE]]
        weights = np.concatenate([merged.nodes.barycentric, np.zeros((len(fill), 3))])
        nodes = points_on_elements(finer, kinds, elements, np.concatenate([merged.nodes.along, fill]), weights)

        ends = np.array([(p.start, p.end) for p in self.pieces], dtype=np.int64).reshape(-1, 2)
        edges = np.array([p.edge for p in self.pieces], dtype=np.int64)
        faces = np.array([p.face for p in self.pieces], dtype=np.int64)
        on_edge = edges >= 0
        edges[on_edge] = new_edge[edges[on_edge]]
        faces[~on_edge] = new_face[faces[~on_edge]]
        faces[on_edge] = finer.first_halfedges[edges[on_edge]] // 3
        vectors = np.array([p.vector for p in self.pieces], dtype=np.complex128)
        owners = np.array([p.owner for p in self.pieces], dtype=np.int64)
        moved = MergedSources(nodes, ends, faces, edges, vectors, owners, merged.samples)
        return finer, moved, is_new, parents[order]


@dataclass(frozen=True, eq=False)
class Outline:
    """A face and the nodes on its sides, in coordinates in which its corners are (0, 0), (1, 0) and (0, 1)."""

    points: list[Point] = field(default_factory=list)  # points on the sides, in order from the first corner on
    vertices: list[int] = field(default_factory=list)  # the vertex at each point
    corners: list[int] = field(default_factory=list)  # indices of the second and the third corner; number of points
    # by two points, the edge between them, and whether it runs from the first to the second
    edge_of: dict[Edge, tuple[int, bool]] = field(default_factory=dict)
    # by edge, the points at its tail and head, and whether its frame is a reflection
    frames: dict[int, tuple[int, int, bool]] = field(default_factory=dict)


class NewFace(NamedTuple):
    """A triangle that is part of a face that was cut."""

    parent: int  # the face of which it is a part
    corners: Sequence[int]  # three vertices
    edges: Sequence[int]  # three edges, number k from corner k to corner k + 1
    ahead: Sequence[bool]  # whether corner k is the tail of edge k
    positions: Complexes  # (3,) corners in the layout of the parent


class NewSegment(NamedTuple):
    """A segment of a source, or a part of one. If it runs along an edge, `face` has no meaning."""

    # nodes at its ends
    start: int
    end: int
    face: int  # the face that contains it
    edge: int  # −1 inside a face
    vector: complex  # normal times length, as in `CurveSegments`
    owner: int  # its source


def with_middles(way: Sequence[int], middles: dict[Edge, int]) -> list[int]:
    """Return the points along a path, with the midpoints of those of its edges that were divided."""
    points = [way[0]]
    for u, v in pairwise(way):
        points += with_middles([u, middles[u, v], v], middles)[1:] if (u, v) in middles else [v]
    return points


def points_on_elements(
    triangles: IntrinsicMesh, kinds: Ints, elements: Ints, along: Floats, barycentric: Floats
) -> LocatedPoints:
    """Return points at vertices, on edges and in faces, given by the kind and id of their elements.

    A point on an edge is given by the fraction `along` it, and one in a face by its `barycentric` weights.
    """
    faces, weights = elements.copy(), barycentric.copy()
    at_vertex, on_edge = kinds == VERTEX, np.flatnonzero(kinds == EDGE)
    vertices = points_at_vertices(triangles, elements[at_vertex])
    faces[at_vertex], weights[at_vertex] = vertices.faces, vertices.barycentric
    faces[on_edge], side = np.divmod(triangles.first_halfedges[elements[on_edge]], 3)
    weights[on_edge] = barycentric_on_edges(triangles.edges, faces[on_edge], side, along[on_edge])
    return LocatedPoints(faces, weights, kinds, elements, np.where(kinds == EDGE, along, 0.0))


def flip_new_faces(
    triangles: IntrinsicMesh, merged: MergedSources, is_new: Bools
) -> tuple[IntrinsicMesh, MergedSources]:
    """Flip edges of new faces so that they are Delaunay; return the mesh, and the sources on it.

    Edges with a segment or a point of a source, and edges of faces with one inside, are not flipped.
    """
    if not triangles.agree_on_lengths:
        return triangles, merged
    on_edge, nodes = merged.edges >= 0, merged.nodes
    fixed = np.ones(triangles.n_edges, dtype=bool)
    fixed[triangles.edges.face_edges[is_new]] = False
    fixed[merged.edges[on_edge]] = True
    fixed[triangles.edges.face_edges[merged.faces[~on_edge]]] = True
    fixed[triangles.edges.face_edges[nodes.elements[nodes.kinds == FACE]]] = True
    fixed[nodes.elements[nodes.kinds == EDGE]] = True
    better = lay_out(flip_all(glue(triangles, fixed)))
    same = (better.edges.face_edges == triangles.edges.face_edges).all(axis=1)
    positions = np.where(same[:, None], triangles.corner_positions, better.corner_positions)
    better = replace(better, corner_positions=positions)  # faces of which no edge was flipped keep their layout
    faces = merged.faces.copy()
    faces[on_edge] = better.first_halfedges[merged.edges[on_edge]] // 3
    located = points_on_elements(better, nodes.kinds, nodes.elements, nodes.along, nodes.barycentric)
    return better, replace(merged, nodes=located, faces=faces)
