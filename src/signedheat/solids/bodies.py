"""The boundary of a solid as closed triangles, proven equal to the solid of its chain.

The winding numbers of a closed chain say what is inside. Triangles bound the same solid if they are closed, and if on
both sides of all triangles of both their own winding number is 1 inside and 0 outside. Where the cut of a chain fails
that proof, other ways to unite its bodies are tried. Bodies are the parts of the mesh that are closed as given, or what
remains connected of the chain where the surfaces that meet along its edges are separated. If none passes through
itself, manifold3d unites them: its result is closed however flat the angles are at which faces cross, and however close
they lie. Otherwise the cut is cut again, and what is left open, which is thinner than what it merges, is closed by
cones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from ..mesh.arrangement import SAME_POINT, arranged
from ..mesh.edges import edge_table, has_three_corners, orient_faces
from ..mesh.pinches import separated
from ..mesh.self_intersections import overlap, overlapping_faces
from ..mesh.triangles import area_vectors, face_areas, halved, heights, part_volumes
from ..mesh.unit_vectors import unit
from ..mesh.welding import ONE_PLACE, coincident_faces, distinct_rows, indexed, same_positions, tolerances
from ..packages import lazy_module
from ..search.winding_tree import WindingTree
from ..surfaces.triangle_mesh import TriangleMesh
from .closing import fan
from .regions import TOLERANCES, cut_and_sided
from .winding import INSIDE_WINDING, Windings

manifold3d: Any = lazy_module("manifold3d", "unions of bodies")

ROUNDING = ONE_PLACE * 2.0**-24
"""Distance by which rounding of files in single precision may move points, relative to the size of their part."""
PROOF_SAMPLES = 20_000
"""Largest number of places whose sides are compared, evenly spread over all faces; few faces have up to four each."""
WRONG_VOLUME = 1e-6
"""Triangles count as the boundary of a solid if they may differ from it by at most this share of its volume."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Closed surfaces in which each edge has two faces, counter-clockwise as seen from outside; cavities clockwise."""

    points: Floats  # (n, 3)
    faces: Ints  # (m, 3)
    labels: Ints  # (m,) body of each face
    volumes: Floats  # (b,) volume of each body, negative for cavities

    @classmethod
    def of_chain(cls, windings: Windings) -> Bodies | None:
        """Separate the bodies of a chain; None if edges cannot be paired, or if a body passes through itself."""
        points, faces = indexed(windings.triangles)
        points, faces = separated(points, faces[has_three_corners(faces)], overlapping=True)
        return cls(points, faces, *part_volumes(points, faces))._clean

    @classmethod
    def of_mesh(cls, mesh: TriangleMesh, windings: Windings) -> Bodies | None:
        """Return the parts of a mesh, oriented as its chain is; None unless all are closed and orientable."""
        faces = mesh.faces[has_three_corners(mesh.faces)]
        areas = face_areas(mesh.vertices[faces])
        oriented = orient_faces(faces, areas, mesh.n_vertices)
        if not oriented.orientable.all():
            return None
        faces = np.where(oriented.turned[:, None], faces[:, ::-1], faces)
        points, faces = separated(mesh.vertices, faces)
        labels, volumes = part_volumes(points, faces)
        faces = np.where((volumes < 0)[labels][:, None], faces[:, ::-1], faces)
        # the inside ends in front of the faces of bodies, and behind those of cavities
        rows, points_beside = _beside(points[faces], tolerances(points, faces, SAME_POINT))
        behind, ahead = windings.inside(points_beside).reshape(2, -1).astype(np.int64)
        inner = np.bincount(labels[rows], (behind - ahead) * face_areas(points[faces])[rows], len(volumes)) < 0
        faces = np.where(inner[labels][:, None], faces[:, ::-1], faces)
        return cls(points, faces, labels, np.where(inner, -1.0, 1.0) * np.abs(volumes))._clean

    @property
    def _clean(self) -> Bodies | None:
        """These bodies; None if an edge does not have two faces, or if a body passes through itself."""
        table = edge_table(self.faces)
        if (table.face_counts != 2).any() or (table.balance != 0).any():  # manifold3d may crash on such meshes
            return None
        crossing = self.labels[crossing_faces(self.points, self.faces, tolerances(self.points, self.faces, ROUNDING))]
        return None if (crossing[:, 0] == crossing[:, 1]).any() else self

    @property
    def united(self) -> Floats | None:
        """(k, 3, 3) triangles that bound the union, without cavities that lie in a single body; None if it fails."""
        widths = tolerances(self.points, self.faces, ROUNDING)
        flat = np.abs(self.volumes) <= np.bincount(self.labels, widths * face_areas(self.points[self.faces]))
        manifolds: dict[int, Any] = {}
        for body in np.flatnonzero(~flat).tolist():
            used, faces = np.unique(self.faces[self.labels == body], return_inverse=True)
            faces = faces.reshape(-1, 3)[:, :: 1 if self.volumes[body] > 0 else -1]
            manifolds[body] = manifold3d.Manifold(manifold3d.Mesh64(self.points[used], faces.astype(np.uint64)))
            if manifolds[body].status() != manifold3d.Error.NoError or manifolds[body].is_empty():
                return None
        outer = [body for body in manifolds if self.volumes[body] > 0]
        for cavity in (body for body in manifolds if self.volumes[body] < 0):
            point = self.points[self.faces[np.argmax(self.labels == cavity)]].mean(axis=0)[None]
            bodies_around = [body for body in outer if self._windings(body).numbers_once(point)[0] > 0.5]
            if not bodies_around:
                return None
            if len(bodies_around) == 1:
                manifolds[bodies_around[0]] -= manifolds[cavity]
        if not outer:
            return None
        whole = manifold3d.Manifold.batch_boolean([manifolds[body] for body in outer], manifold3d.OpType.Add)
        mesh = whole.to_mesh64()
        return np.array(mesh.vert_properties)[:, :3][np.array(mesh.tri_verts).astype(np.int64)]

    def _windings(self, body: int) -> Windings:
        """Winding numbers of a single body, given by its label."""
        return Windings(self.points[self.faces[self.labels == body]])


def crossing_faces(points: Floats, faces: Ints, depths: Floats) -> Ints:
    """Return (k, 2) pairs of faces that reach through each other by more than the (m,) depth of both."""
    ids = same_positions(points)[faces]
    pairs = overlapping_faces(points, ids, -depths)
    shared = (ids[pairs[:, 0]][:, :, None] == ids[pairs[:, 1]][:, None]).sum(axis=(1, 2))
    pairs = pairs[shared < 2]  # faces with a common edge may be folded, but not pass through each other
    return pairs[_are_deep(points[faces].reshape(-1, 9), pairs, depths)]


@compiled
def _are_deep(corners: Floats, pairs: Ints, depths: Floats) -> Bools:
    """(k,) whether (k, 2) pairs of triangles overlap by more than the smaller of their (m,) depths.

    Corners are (m, 9). Pairs with a common vertex are tested as all others.
    """
    result, directions = np.empty(len(pairs), dtype=np.bool_), np.empty((10, 3))
    for k in range(len(pairs)):
        f, g = pairs[k]
        depth = min(depths[f], depths[g])
        result[k] = overlap(corners[f], corners[g], -depth, depth, directions)
    return result


def whole_boundary(triangles: Floats, windings: Windings, mesh: TriangleMesh | None = None) -> Floats | None:
    """Find (k, 3, 3) triangles that are proven to bound the solid of a chain; None if no way to unite its bodies works.

    `triangles`, (m, 3, 3), are an attempt that is not proven. `mesh` is the mesh that the chain was made of, if known.
    """
    return next((made for made in _candidates(triangles, windings, mesh) if same_solid(made, windings)), None)


def _candidates(triangles: Floats, windings: Windings, mesh: TriangleMesh | None) -> Iterator[Floats]:
    """Yield (k, 3, 3) triangles that may bound the solid, made in different ways, the most promising one first.

    First the bodies of the mesh that the chain was made of, if it is known, are united, then those of the chain, whose
    winding numbers are given. Finally the (m, 3, 3) `triangles`, which are an attempt, and those of the chain are cut
    again where they meet, and closed by cones.
    """
    for given in (mesh, None) if mesh is not None else (None,):
        bodies = Bodies.of_chain(windings) if given is None else Bodies.of_mesh(given, windings)
        united = None if bodies is None else bodies.united
        if united is not None:
            yield _without_slits(united)
            yield united
    for chain in (triangles, windings.triangles):
        if len(chain):
            yield _coned(*_cut_again(chain, windings))


def _without_slits(triangles: Floats) -> Floats:
    """Drop pairs of faces that lie on each other and face opposite ways, as manifold3d may leave where bodies touch."""
    pieces = arranged(*indexed(triangles))
    return _coned(pieces.points, without_doubles(pieces.faces))


def _cut_again(triangles: Floats, windings: Windings) -> tuple[Floats, Ints]:
    """Divide (m, 3, 3) triangles where they meet; return points and faces of those that bound the inside."""
    points, faces = indexed(triangles)
    slacks, every = tolerances(points, faces, SAME_POINT), np.ones(len(faces), dtype=bool)
    pieces, regions = cut_and_sided(partial(arranged, points, faces, None), slacks, every, windings)
    return pieces.points, without_doubles(pieces.faces[regions.bounds])


def without_doubles(faces: Ints) -> Ints:
    """Drop pairs of faces on the same vertices that face opposite ways, and faces on fewer than three vertices."""
    first, reverse = coincident_faces(faces.ravel(), np.arange(0, faces.size + 1, 3))
    proper = first >= 0
    forth, back = (np.bincount(first[proper & (reverse == way)], minlength=len(faces)) for way in (False, True))
    return faces[proper & ~((forth == 1) & (back == 1))[first]]


def _coned(points: Floats, faces: Ints) -> Floats:
    """Close faces by fans from a vertex of each simple loop of their boundary; return all (k, 3, 3) triangles."""
    table = edge_table(faces)
    ends = np.where((table.balance < 0)[:, None], table.vertices[:, ::-1], table.vertices)
    fans = [fan(loop) for loop in _simple_loops(np.repeat(ends, np.abs(table.balance), axis=0))]
    return points[np.concatenate([faces, *fans])]


def _simple_loops(edges: Ints) -> Iterator[Ints]:
    """Yield the vertices of loops along (k, 2) directed edges, against their direction.

    No loop passes a vertex twice. As many edges must end at each vertex as begin there.
    """
    onward: dict[int, list[int]] = {}
    for tail, head in edges.tolist():
        onward.setdefault(head, []).append(tail)
    for start in onward:
        path, index_on_path = [start], {start: 0}
        while onward[path[-1]]:
            vertex = onward[path[-1]].pop()
            if vertex not in index_on_path:
                index_on_path[vertex] = len(path)
                path.append(vertex)
                continue
            loop = path[index_on_path[vertex] :]
            if len(loop) > 2:
                yield np.array(loop)
            for passed in loop[1:]:
                del index_on_path[passed]
            del path[index_on_path[vertex] + 1 :]


def same_solid(triangles: Floats, windings: Windings) -> bool:
    """Whether (m, 3, 3) triangles are closed and bound the solid that `windings` describe, up to rounding.

    On both sides of the triangles, and of those of the solid, their own winding number must be 1 where the inside of
    the solid is and 0 elsewhere, at one of the distances up to which a cut may merge points. Triangles where this fails
    must be so small that they cannot enclose `WRONG_VOLUME`: a surface of area A encloses at most A^1.5 / (6 √π).
    """
    points, faces = indexed(triangles)
    if not len(faces) or (edge_table(faces).balance != 0).any():
        return False
    added, lost = not_shared(triangles, windings.triangles)
    rest = np.concatenate([added, lost[:, ::-1]])
    further, wrong_area = WindingTree.of(rest) if len(rest) else None, 0.0
    for chain in (triangles, lost):  # what both have is checked once
        chosen = _spread(len(chain))
        checked, widths = chain[chosen], tolerances(*indexed(chain), SAME_POINT)[chosen]
        for _ in range(2):
            if 2 * len(checked) <= PROOF_SAMPLES:
                checked, widths = halved(checked), np.tile(widths, 2)
        wrong = np.arange(len(checked))
        for multiple in TOLERANCES:
            rows, points_beside = _beside(checked[wrong], multiple * widths[wrong])
            numbers = windings.numbers(points_beside)
            own_numbers = numbers + further.numbers(points_beside) if further else numbers
            differ = np.abs(own_numbers - (numbers > INSIDE_WINDING)) > 0.5
            wrong = wrong[rows[differ.reshape(2, -1).any(axis=0)]]
        wrong_area += float(face_areas(checked[wrong]).sum()) * len(chain) / max(len(chosen), 1)
    corners = triangles - points.mean(axis=0)
    volume = float(np.einsum("ij,ij->", corners[:, 0], area_vectors(corners))) / 3.0
    return wrong_area**1.5 / (6.0 * np.sqrt(np.pi)) <= WRONG_VOLUME * volume


def not_shared(triangles: Floats, others: Floats) -> tuple[Floats, Floats]:
    """Return the (k, 3, 3) triangles that others lack, and the others that are none of them, up to the last bit.

    The winding numbers of the first, less those of the second, are the differences between the two.
    """
    both = np.concatenate([triangles, others])
    corners = same_positions(both.reshape(-1, 3)).reshape(-1, 3)
    around = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3  # the corner to begin with does not matter
    numbers, first = distinct_rows(np.take_along_axis(corners, around, axis=1))
    counts = np.bincount(numbers[: len(triangles)], minlength=len(first))
    counts -= np.bincount(numbers[len(triangles) :], minlength=len(first))
    added, lost = (np.repeat(both[first], np.maximum(way * counts, 0), axis=0) for way in (1, -1))
    return added, lost


def _beside(triangles: Floats, steps: Floats) -> tuple[Ints, Floats]:
    """Return points beside (m, 3, 3) triangles at the distances `steps`, (m,), for those wider than two steps.

    The first array has the (k,) rows of these triangles, the second k points behind them and then k in front.
    """
    rows = np.flatnonzero(heights(triangles) > 2.0 * steps)
    centres, away = triangles[rows].mean(axis=1), steps[rows, None] * unit(area_vectors(triangles[rows]))
    return rows, np.concatenate([centres - away, centres + away])


def _spread(count: int) -> Ints:
    """Return at most `PROOF_SAMPLES` row numbers below `count`, evenly spread."""
    return np.linspace(0, count - 1, min(count, PROOF_SAMPLES)).astype(np.int64)
