"""Conforming refinement: cut triangles so that curves run along edges and points lie at vertices.

Each triangle gets a constrained triangulation of its own, with the points inside it and the segments as edges.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
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
from .surface_points import EDGE, FACE, VERTEX, ZERO_COORDINATE, LocatedPoints, barycentric_on_edges, points_at_vertices

Point = tuple[float, float]
Edge = tuple[int, int]

FLAT_AREA = 1e-14
"""Twice the area of a triangle up to which it is flat; flips that would make such a triangle are not done."""


def turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def edges_of(triangle: Sequence[int]) -> tuple[Edge, Edge, Edge]:
    """Return the directed edges of a triangle."""
    u, v, w = triangle
    return (u, v), (v, w), (w, u)


@dataclass(frozen=True)
class _Line:
    """A segment, and the fraction of it, from its start, along which there are edges already."""

    start: Point
    end: Point
    done: float = 0.0

    def share(self, x: Point) -> float:
        """Return the fraction of the segment at which its point nearest to x lies."""
        (px, py), (qx, qy) = self.start, self.end
        return ((x[0] - px) * (qx - px) + (x[1] - py) * (qy - py)) / ((qx - px) ** 2 + (qy - py) ** 2)

    def meets(self, x: Point) -> bool:
        """Return whether a point lies on the part of the segment that is not yet done."""
        length = ((self.end[0] - self.start[0]) ** 2 + (self.end[1] - self.start[1]) ** 2) ** 0.5
        return abs(turn(self.start, self.end, x)) <= ZERO_COORDINATE * length and self.done < self.share(x) <= 1


@dataclass(frozen=True, eq=False)
class Triangulation:
    """A triangulation of points in a triangle, whose corners are the first three points, counter-clockwise."""

    points: list[Point]  # positions
    # the corner opposite each directed edge, in the triangle that runs along it
    apex: dict[Edge, int] = field(default_factory=dict)
    leaving: dict[int, int] = field(default_factory=dict)  # the end of one of the directed edges that leave each point
    # for each edge that is part of a segment, the points along it after the first: several if other segments cross it
    parts: dict[Edge, list[int]] = field(default_factory=dict)

    @classmethod
    def of(cls, points: Sequence[Point], sides: Sequence[Sequence[int]]) -> Triangulation:
        """Make one triangle with points on its sides, listed for each side from tail to head, without corners."""
        triangulation = cls(list(points))
        triangulation.add(0, 1, 2)
        for k, side in enumerate(sides):
            tail = k
            for i in side:
                triangulation.split(tail, (k + 1) % 3, i)
                tail = i
        return triangulation

    @property
    def triangles(self) -> list[tuple[int, int, int]]:
        """All triangles, counter-clockwise, the least corner first, in order."""
        return sorted((u, v, w) for (u, v), w in self.apex.items() if u < v and u < w)

    def add(self, u: int, v: int, w: int) -> None:
        """Add a triangle."""
        self.apex.update({(u, v): w, (v, w): u, (w, u): v})
        self.leaving.update({u: v, v: w, w: u})

    def split(self, u: int, v: int, i: int) -> None:
        """Put a point on an edge, in the triangles on both of its sides."""
        for a, b in ((u, v), (v, u)):
            if (a, b) in self.apex:
                w = self.apex.pop((a, b))
                self.add(a, i, w)
                self.add(i, b, w)

    def insert(self, x: Point) -> int:
        """Put a point into the triangle that contains it, or on its edge; return the number of the point."""
        triangle = self.locate(x)
        i = len(self.points)
        self.points.append(x)
        for a, b in edges_of(triangle):
            p, q = self.points[a], self.points[b]
            length = ((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) ** 0.5
            if (b, a) in self.apex and turn(p, q, x) <= ZERO_COORDINATE * length:
                self.split(a, b, i)
                return i
        for a, b in edges_of(triangle):
            self.add(a, b, i)
        return i

    def locate(self, x: Point) -> Sequence[int]:
        """Find the triangle that contains a point by a walk across edges that it lies beyond, or else by a search."""
        points, apex = self.points, self.apex
        last = next(reversed(apex))
        triangle: Sequence[int] = (*last, apex[last])
        for _ in range(len(apex)):
            depth, a, b = min((turn(points[a], points[b], x), a, b) for a, b in edges_of(triangle))
            if depth >= 0 or (b, a) not in apex:
                break
            triangle = (b, a, apex[b, a])
        if depth >= 0:
            return triangle
        return max(self.triangles, key=lambda corners: min(turn(points[a], points[b], x) for a, b in edges_of(corners)))

    def around(self, a: int) -> Iterator[Edge]:
        """Yield the directed edges opposite a point in the triangles around it, counter-clockwise from one of them."""
        apex, first = self.apex, self.leaving[a]
        u = first
        while (a, u) in apex:
            yield u, apex[a, u]
            u = apex[a, u]
            if u == first:
                return
        u = first
        while (u, a) in apex:
            yield apex[u, a], u
            u = apex[u, a]

    def connect(self, a: int, b: int) -> list[int]:
        """Make edges along a segment; return the points on it, with new ones where it crosses other segments.

        They end before b if rounding keeps edges from being made for too long.
        """
        way, line = [a], _Line(self.points[a], self.points[b])
        for _ in range(100 + len(self.apex)):
            tail = way[-1]
            if tail == b:
                break
            head, crossed = self.aim(tail, b, line)
            if crossed is not None:
                head = self.clear(tail, b, crossed, line)
            if head >= 0:  # else `clear` has made a point, and the next round finds it
                self.parts.setdefault((tail, head), [head])
                self.parts.setdefault((head, tail), [tail])
                way.append(head)
                line = replace(line, done=max(line.done, line.share(self.points[head])))
        return way

    def along(self, way: Sequence[int]) -> list[int]:
        """Return the points along a path, including those that were put on its edges later."""
        points = [way[0]]
        for edge in pairwise(way):
            parts = self.parts[edge]
            points += parts if len(parts) == 1 else self.along([edge[0], *parts])[1:]
        return points

    def aim(self, a: int, b: int, line: _Line) -> tuple[int, Edge | None]:
        """Return the neighbour of a that a segment to b meets first; or −1, and the edge that the segment crosses."""
        p, q = self.points[a], line.end
        met, nearest, crossed, most = -1, 2.0, None, -float("inf")
        for u, w in self.around(a):
            if b in (u, w):
                return b, None
            for i in (u, w):
                if line.meets(self.points[i]) and line.share(self.points[i]) < nearest:
                    met, nearest = i, line.share(self.points[i])
            inside = min(turn(p, self.points[u], q), turn(p, q, self.points[w]))
            if inside > most:
                crossed, most = (u, w), inside
        return met, None if met >= 0 else crossed

    def clear(self, a: int, b: int, edge: Edge, line: _Line) -> int:
        """Flip the edges that the segment from a to b crosses (Sloan 1993); return the point that it meets first.

        If rounding prevents flips, that is a point near the segment; at another segment, which gets a new point, −1.
        """
        points, apex = self.points, self.apex
        p, q = points[a], line.end
        (u, w), goal, waiting = edge, -1, []
        while goal < 0 and (w, u) in apex:
            if (u, w) in self.parts:
                self._cross(p, q, u, w)
                return -1
            waiting.append((u, w))
            z = apex[w, u]
            goal = z if z == b or line.meets(points[z]) else -1
            u, w = (u, z) if turn(p, q, points[z]) > 0 else (z, w)
        moved = goal >= 0
        while moved and (a, goal) not in apex and (goal, a) not in apex:
            moved, left = False, []
            for u, v in reversed(waiting):  # back and forth: flips at one end make room for the next
                w, x = apex[u, v], apex[v, u]
                if min(turn(points[x], points[v], points[w]), turn(points[w], points[u], points[x])) <= FLAT_AREA:
                    left.append((u, v))
                    continue
                del apex[u, v], apex[v, u]
                self.add(w, x, v)
                self.add(x, w, u)
                moved = True
                if self._crosses(a, goal, w, x):
                    left.append((w, x))
            waiting = left
        if moved:
            return goal
        met, crossed = self.aim(a, b, line)
        return met if crossed is None else min(crossed, key=lambda i: abs(turn(p, q, points[i])))

    def _cross(self, p: Point, q: Point, u: int, w: int) -> None:
        """Put a point where the segment from p to q crosses edge uw, which is part of another segment."""
        r, s = self.points[u], self.points[w]
        right, left = turn(p, q, r), turn(p, q, s)
        t = right / (right - left)
        i = len(self.points)
        self.points.append((r[0] + t * (s[0] - r[0]), r[1] + t * (s[1] - r[1])))
        self.split(u, w, i)
        self.parts[u, w], self.parts[w, u] = [i, w], [i, u]
        self.parts.update({(u, i): [i], (i, w): [w], (w, i): [i], (i, u): [u]})

    def _crosses(self, a: int, b: int, u: int, v: int) -> bool:
        """Return whether two segments cross, away from their ends."""
        if a in (u, v) or b in (u, v):
            return False
        p, q, r, s = (self.points[i] for i in (a, b, u, v))
        return turn(p, q, r) * turn(p, q, s) < 0 and turn(r, s, p) * turn(r, s, q) < 0


def refine_to_conform(
    triangles: IntrinsicMesh, groups: Sequence[Sequence[CurveSegments]]
) -> tuple[IntrinsicMesh, list[list[CurveSegments]]]:
    """Cut faces that unoriented curves cross; points in cut faces become vertices. Return mesh and sources."""
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
    """Cut faces so that sources run along edges; return triangles, sources, which faces are new, and their parents.

    Only `unfit` sources (by default all) must; others do in faces that are cut. Face f begins at corner `begin[f]`.
    """
    merged = MergedSources.of(parts)
    faces, edges = affected_elements(triangles, merged, [True] * len(parts) if unfit is None else unfit)
    if not len(faces) and not len(edges):
        return triangles, merged, np.zeros(triangles.n_faces, dtype=bool), np.arange(triangles.n_faces)
    begin = np.zeros(triangles.n_faces, dtype=np.int64) if begin is None else begin
    return FaceCutter(triangles, merged, faces, edges, begin).assemble()


def affected_elements(triangles: IntrinsicMesh, merged: MergedSources, unfit: Sequence[bool]) -> tuple[Ints, Ints]:
    """Return the faces to cut and the edges to split: those of `unfit` sources, and all that must then follow."""
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
    """An intrinsic mesh while some of its faces are cut along segments."""

    def __init__(self, triangles: IntrinsicMesh, merged: MergedSources, faces: Ints, edges: Ints, begin: Ints) -> None:
        self.triangles, self.merged, self.begin = triangles, merged, begin
        self.n_vertices, self.n_edges = triangles.n_vertices, triangles.n_edges
        self.faces: list[NewFace] = []
        self.pieces: list[NewSegment] = []
        self.cut_faces = faces.tolist()
        nodes = merged.nodes
        self.vertex_of = np.where(nodes.kinds == VERTEX, nodes.elements, -1).tolist()
        self.node_at = {v: i for i, v in enumerate(self.vertex_of) if v >= 0}
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

        self.chains: dict[int, tuple[list[int], list[float], dict[int, int]]] = {}
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
        """Return the node at a vertex, a new one if it had none."""
        if vertex not in self.node_at:
            self.node_at[vertex] = len(self.vertex_of)
            self.vertex_of.append(vertex)
        return self.node_at[vertex]

    def cut_along(self, p: int, edge: int) -> None:
        """Replace segment p, which runs along a split edge, by a segment between each two successive vertices."""
        merged, (vertices, fractions, place) = self.merged, self.along_edge(edge)
        a, b = (place[self.vertex_of[i]] for i in merged.ends[p].tolist())
        step = 1 if a < b else -1
        for k in range(a, b, step):
            vector = merged.vectors[p] * (abs(fractions[k + step] - fractions[k]) / abs(fractions[b] - fractions[a]))
            ends = self.node(vertices[k]), self.node(vertices[k + step])
            sub = self.sub_edges[edge][min(k, k + step)]
            self.pieces.append(NewSegment(*ends, -1, sub, vector, merged.owners[p]))

    def along_edge(self, edge: int) -> tuple[list[int], list[float], dict[int, int]]:
        """Return the vertices along a split edge, the fraction of it at each, and the index of each in this list."""
        if edge not in self.chains:
            chain = self.on_edge[edge]
            tail, head = self.triangles.edges.vertices[edge].tolist()
            vertices = [tail, *(self.vertex_of[i] for i in chain), head]
            fractions = [0.0, *self.merged.nodes.along[chain].tolist(), 1.0]
            self.chains[edge] = vertices, fractions, {v: k for k, v in reversed(list(enumerate(vertices)))}
        return self.chains[edge]

    def cut_face(self, face: int, inside: list[int]) -> None:
        """Cut one face along the segments inside it."""
        around = ((self.begin[face] + np.arange(3)) % 3).tolist()
        outline = self.outline(face, around)
        cut, vertices = Triangulation.of(outline.points, outline.sides), outline.vertices
        for i in self.in_face[face]:
            u, v = self.merged.nodes.barycentric[i, around[1:]].tolist()
            cut.insert((u, v))
            vertices.append(self.vertex_of[i])

        point_at = {v: k for k, v in reversed(list(enumerate(vertices)))}
        ends = [[point_at[self.vertex_of[i]] for i in self.merged.ends[p].tolist()] for p in inside]
        ways = [cut.connect(*pair) for pair in ends]
        if any(way[-1] != end for way, (_, end) in zip(ways, ends, strict=True)):
            raise SourceError(
                f"the curves cross face {face}, which is as thin as rounding",
                remedy="merge the vertices that nearly coincide",
                element=f"face {face}",
            )
        vertices += [self.new_vertex() for _ in range(len(cut.points) - len(vertices))]  # where segments cross
        (x, y), (a, b, c) = np.array(cut.points).T, self.triangles.corner_positions[face, around]
        positions = a + x * (b - a) + y * (c - a)
        self.add_faces(face, cut, outline, positions)
        for p, way in zip(inside, ways, strict=True):
            self.add_pieces(p, cut.along(way), outline, positions)

    def outline(self, face: int, around: list[int]) -> Outline:
        """Return a face with the nodes on its sides; `around` lists its corners from the first on."""
        triangles, along = self.triangles, self.merged.nodes.along
        result = Outline([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], triangles.corner_vertices[face, around].tolist())
        for k, side in enumerate(around):
            edge, forward = int(triangles.edges.face_edges[face, side]), bool(triangles.edges.forward[face, side])
            order = 1 if forward else -1
            (x, y), (u, v), chain = result.points[k], result.points[(k + 1) % 3], [k]
            for i in self.on_edge.get(edge, [])[::order]:
                t = float(along[i] if forward else 1 - along[i])
                chain.append(len(result.points))
                result.points.append((x + t * (u - x), y + t * (v - y)))
                result.vertices.append(self.vertex_of[i])
            result.sides.append(chain[1:])
            reflected, parts = bool(triangles.reflected[face, side]), self.sub_edges.get(edge, [edge])[::order]
            for (a, b), part in zip(pairwise([*chain, (k + 1) % 3]), parts, strict=True):
                result.edge_of[a, b] = part, forward
                result.frames[part] = (a, b, reflected) if forward else (b, a, reflected)
        return result

    def add_faces(self, face: int, cut: Triangulation, outline: Outline, positions: Complexes) -> None:
        """Add the triangles of a face, and the edges within it, which are numbered as they appear."""
        for corners in cut.triangles:
            for u, v in edges_of(corners):
                if (u, v) not in outline.edge_of:
                    edge = self.new_edge()
                    outline.edge_of[u, v], outline.edge_of[v, u] = (edge, True), (edge, False)
                    outline.frames[edge] = u, v, False
            edges, ahead = zip(*(outline.edge_of[side] for side in edges_of(corners)), strict=True)
            vertices = [outline.vertices[i] for i in corners]
            self.faces.append(NewFace(face, vertices, edges, ahead, positions[list(corners)]))

    def add_pieces(self, p: int, chain: list[int], outline: Outline, positions: Complexes) -> None:
        """Add the parts of segment p, between the points of a chain, with its normal in the frames of their edges."""
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
        """Put the cut mesh and its sources together; see `cut_along` for what is returned."""
        triangles, merged = self.triangles, self.merged
        kept = np.setdiff1d(np.arange(triangles.n_faces), self.cut_faces)
        parents = np.concatenate([kept, [f.parent for f in self.faces]]).astype(np.int64)
        order = np.argsort(parents, kind="stable")  # the first face of an edge, or a part of it, stays the first

        def with_new(old: NDArray[Any], name: str) -> NDArray[Any]:
            return np.concatenate([old[kept], [getattr(f, name) for f in self.faces]])[order]

        face_edges = with_new(triangles.edges.face_edges, "edges")
        forward = with_new(triangles.edges.forward, "ahead")
        corners = with_new(triangles.corner_vertices, "corners")
        used, first, flat = np.unique(face_edges, return_index=True, return_inverse=True)
        vertices = np.stack([corners.ravel()[first], np.roll(corners, -1, axis=1).ravel()[first]], axis=1)
        table = EdgeTable(vertices, flat.reshape(-1, 3), forward)
        finer = IntrinsicMesh(corners, with_new(triangles.corner_positions, "positions"), table, self.n_vertices)

        new_face = np.full(triangles.n_faces, -1)
        is_new = order >= len(kept)
        new_face[parents[order][~is_new]] = np.flatnonzero(~is_new)
        new_edge = np.full(self.n_edges, -1)
        new_edge[used] = np.arange(len(used))

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

    points: list[Point]
    vertices: list[int]  # the vertex at each point
    sides: list[list[int]] = field(default_factory=list)  # the points along each side, without corners
    # the edge between two points, and whether it runs from the first to the second
    edge_of: dict[Edge, tuple[int, bool]] = field(default_factory=dict)
    # the points at tail and head of each edge, and whether its frame is a reflection
    frames: dict[int, tuple[int, int, bool]] = field(default_factory=dict)


class NewFace(NamedTuple):
    """A part of a face that was cut."""

    parent: int  # the face that it is a part of
    corners: Sequence[int]  # three vertices
    edges: Sequence[int]  # three edges, from corner k to corner k + 1
    ahead: Sequence[bool]  # whether it runs along each edge from tail to head
    positions: Complexes  # (3,) corners in the layout of the parent


class NewSegment(NamedTuple):
    """A segment, or part of one; `face` has no meaning where it runs along an edge."""

    start: int  # nodes at its ends
    end: int
    face: int
    edge: int  # −1 inside a face
    vector: complex  # normal times length, as in `CurveSegments`
    owner: int  # its source


def points_on_elements(
    triangles: IntrinsicMesh, kinds: Ints, elements: Ints, along: Floats, barycentric: Floats
) -> LocatedPoints:
    """Locate points given by their elements: by the fraction `along` an edge, or by `barycentric` coordinates."""
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
    """Flip edges of new faces to Delaunay, except edges with a segment or point, and of faces with one inside."""
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
