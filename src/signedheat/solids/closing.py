"""Close the boundary of a chain of triangles by lids."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from ..arrays import Floats, Ints
from ..frozen import Frozen
from ..mesh.box_tree import BoxTree
from ..mesh.components import element_components
from ..mesh.edges import edge_keys, edge_table
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.unit_vectors import unit
from . import bending, creases, lids, lost_faces, walls
from .rims import boundary, corners_of, loops, open_edges
from .spanning import Frame, frame_of

NONE = np.empty((0, 2), dtype=np.int64)
"""No edges."""


def closed_by(vertices: Floats, faces: Ints, *, bent: bool = True, outlines: Ints = NONE) -> tuple[Floats, Ints]:
    """Close the boundary of a chain of directed triangles, whatever the parts that they belong to.

    Small holes are closed by the triangles between their corners that bend least, where these continue the surface;
    rims that run along each other by strips; and each loop that is left by a lid: a thin plate that continues how the
    surface bends, flat faces that meet in creases, or a film.

    Parameters
    ----------
    vertices : (n, 3) float
        Positions, no two of which are the same place.
    faces : (m, 3) int
        Chain of triangles; those that are there several times count several times.
    bent : bool
        Whether lids bend as the surface does towards their rims. The less the surface there bends as it must to come
        round, the flatter they are.
    outlines : (k, 2) int
        Edges of the boundary, in whole loops, that stay open.

    Returns
    -------
    vertices : (n + k, 3) float
        The positions, followed by new ones.
    added : (p, 3) int
        Triangles such that with them each edge has as many triangles in one direction as in the other. Where lids have
        more points along an edge than faces have, triangles without area lie between.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.sphere(2)
    >>> _, added = closed_by(ball.vertices, ball.faces[1:])
    >>> sorted(added[0]) == sorted(ball.faces[0])
    True
    """
    faces = np.asarray(faces, dtype=np.int64)
    if len(boundary(faces)) == len(outlines):
        return vertices, np.empty((0, 3), dtype=np.int64)
    centre = vertices[np.unique(faces)].mean(axis=0)
    positions = vertices - centre
    chain = np.concatenate([faces, small_lids(positions, faces, outlines)])
    chain = np.concatenate([chain, strips(positions, chain, outlines)])
    surface = _Surface(positions, chain, outlines)
    with threadpool_limits(1, "blas"):  # systems of a few hundred unknowns: threads would only wait
        new, count = [vertices], len(vertices)
        triangles = [chain]
        for loop in surface.loops:
            points, lid = _lid(surface, loop, bent)
            names = np.concatenate([loop, count + np.arange(len(points))])
            triangles.append(names[lid])
            new.append(points + centre)
            count += len(points)
    closed = np.concatenate(triangles)
    assert len(boundary(closed)) == len(outlines), "lids balance each directed edge"
    return np.concatenate(new), closed[len(faces) :]


@dataclass(frozen=True, eq=False)
class _Surface(Frozen):
    """A chain of triangles, and what is asked of it where it ends."""

    vertices: Floats
    faces: Ints
    outlines: Ints = field(default_factory=lambda: NONE)

    @cached_property
    def loops(self) -> list[Ints]:
        """Closed loops around the gaps that are to be closed."""
        edges, n = boundary(self.faces), len(self.vertices)
        keys, left = edges @ [n, 1], np.sort(self.outlines @ [n, 1])
        order, copies = np.argsort(keys, kind="stable"), np.arange(len(left)) - np.searchsorted(left, left)
        edges = np.delete(edges, order[np.searchsorted(keys[order], left) + copies], axis=0)
        return loops(self.vertices, self.faces, edges)

    @cached_property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners."""
        return self.vertices[self.faces]

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas."""
        return face_areas(self.triangles)

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) unit normals."""
        return unit(area_vectors(self.triangles))

    @cached_property
    def parts(self) -> Ints:
        """(m,) faces that share edges hang together."""
        return element_components(edge_table(self.faces).face_edges)

    @cached_property
    def patches(self) -> Ints:
        """(m,) faces that hang together across edges that are not sharp."""
        return bending.smooth_patches(self.triangles, self.faces)

    @cached_property
    def tree(self) -> BoxTree:
        """Their boxes."""
        return BoxTree.of(self.triangles.min(axis=1), self.triangles.max(axis=1))

    @cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        """Sorted keys of the directed sides of faces, and the sides: of several, that which `behind` takes first."""
        keys = (self.faces * len(self.vertices) + np.roll(self.faces, -1, axis=1)).ravel()
        table = edge_table(self.faces)
        alone = len(table.vertices) + np.arange(self.faces.size).reshape(-1, 3)
        pieces = element_components(np.where(table.face_counts[table.face_edges] == 2, table.face_edges, alone))
        closed = ~np.isin(pieces, open_edges(self.faces, pieces)[1])
        order = np.lexsort((-np.repeat(self.areas, 3), np.repeat(closed, 3), keys))
        return keys[order], order

    def behind(self, loop: Ints) -> tuple[Ints, Ints]:
        """(n,) the face behind each edge of a loop, and its third vertex.

        Of several it is one of a piece that does not close by itself, and of these the largest.
        """
        keys, order = self._sides
        face, side = np.divmod(order[np.searchsorted(keys, np.roll(loop, -1) * len(self.vertices) + loop)], 3)
        return face, self.faces[face, (side + 2) % 3]


def small_lids(vertices: Floats, faces: Ints, outlines: Ints = NONE) -> Ints:
    """(k, 3) triangles that close the small holes of a surface, and its gaps without area, between their vertices."""
    surface = _Surface(vertices, faces, outlines)
    triangles, chosen, corners = [np.empty((0, 3), dtype=np.int64)], [], []
    for loop in surface.loops:
        places = corners_of(surface.vertices[loop])
        if len(places) < 3:
            triangles.append(_fan(loop))
        elif len(places) <= lost_faces.MOST_SIDES:
            chosen.append(loop)
            corners.append(places)
    if not chosen:
        return np.concatenate(triangles)
    rims = [loop[places] for loop, places in zip(chosen, corners, strict=True)]
    normals = [surface.normals[surface.behind(loop)[0][places]] for loop, places in zip(chosen, corners, strict=True)]
    touching = np.zeros(len(surface.vertices), dtype=bool)
    touching[np.concatenate(rims)] = True
    edges = edge_table(surface.faces).vertices
    edges = edges[touching[edges].all(axis=1)]
    taken = np.sort(edge_keys(edges[:, 0], edges[:, 1]))
    for loop, places, lid in zip(
        chosen,
        corners,
        lost_faces.least_bent(surface.vertices, rims, np.concatenate(normals), taken, lost_faces.BENT),
        strict=True,
    ):
        if len(lid):
            triangles.append(_with_sides(loop, places, lid))
    return np.concatenate(triangles)


def _with_sides(loop: Ints, places: Ints, lid: Ints) -> Ints:
    """Triangles between the corners of a loop, at these places, divided at the points of its straight sides."""
    for begin, end in zip(places, [*places[1:], places[0] + len(loop)], strict=True):
        side = loop[np.arange(begin, end + 1) % len(loop)]
        if len(side) > 2:
            at, corner = np.argwhere((lid == side[0]) & (np.roll(lid, -1, axis=1) == side[-1]))[0]
            apex = np.full(len(side) - 1, lid[at, corner - 1])
            lid = np.concatenate([np.delete(lid, at, axis=0), np.stack([side[:-1], side[1:], apex], axis=1)])
    return lid


def _fan(points: Ints) -> Ints:
    """(k − 2, 3) triangles from the first of some points to the others."""
    return np.stack([np.full(len(points) - 2, points[0]), points[1:-1], points[2:]], axis=1)


def strips(vertices: Floats, faces: Ints, outlines: Ints = NONE) -> Ints:
    """(k, 3) triangles between vertices of rims that run along each other, along stretches or all around."""
    surface = _Surface(vertices, faces, outlines)
    chain = np.concatenate([faces, *walls.seams(_rims(surface))])
    surface = _Surface(vertices, chain, outlines)
    rims = _rims(surface)
    areas = np.bincount(surface.parts, surface.areas).astype(np.float64) if rims else np.zeros(0)
    return np.concatenate([chain, *walls.wall_ends(rims, areas)])[len(faces) :]


def _rims(surface: _Surface) -> list[walls.Rim]:
    """Rims of what is more than a single face."""
    if not surface.loops:
        return []
    counts = np.bincount(surface.parts)
    rims = []
    for loop in surface.loops:
        face, third = surface.behind(loop)
        parts = surface.parts[face]
        if (counts[parts] > 1).all():
            rims.append(walls.Rim.of(loop, surface.vertices[loop], surface.vertices[third], parts))
    return rims


def _lid(surface: _Surface, loop: Ints, bent: bool) -> tuple[Floats, Ints]:
    """Return the lid of a loop: the points that it adds to the loop's, and triangles."""
    corners = surface.vertices[loop]
    if len(loop) == 3:
        return np.empty((0, 3)), np.array([[0, 1, 2]])
    if not bent and creases.is_flat(corners) and (flat := creases.flat_lid(corners)):
        return flat
    for frame in (frame_of(corners), None):
        if lid := _spanned(surface, loop, frame, bent):
            return lid
    raise AssertionError("a disc has room for every loop")


def _spanned(surface: _Surface, loop: Ints, frame: Frame | None, bent: bool) -> tuple[Floats, Ints] | None:
    """Close a loop by a lid, triangulated in a plane or without one in a disc; None if it crosses itself there."""
    corners, behind = surface.vertices[loop], surface.behind(loop)[0]
    rim = lids.SmoothRim.of(corners)
    smooth = lids.pattern(rim, frame)
    if smooth is None:
        return None
    flat = lids.film(smooth)
    plate = None
    if bent:
        width, points = bending.width_of(flat), flat.vertices[: flat.n_rim]
        near = bending.samples_near(
            surface.triangles, surface.tree, surface.patches, scipy.spatial.cKDTree(points), bending.REACH * width
        )
        ends = surface.patches[behind[rim.edges_at(flat.places)]]
        normals, curvatures, held = bending.continuation(flat, near, ends, width)
        plate = lids.plate(flat, normals, curvatures, held, width) if held.any() else None
    if plate is None:
        normals = surface.normals[behind]
        lid = creases.creased(corners, normals)
        if lid is not None:
            return lid
        places = corners_of(corners)
        if len(places) <= lost_faces.MOST_SIDES:
            triangles = lost_faces.least_bent(corners, [places], normals[places], np.empty(0, dtype=np.int64), np.inf)[
                0
            ]
            return np.empty((0, 3)), _with_sides(np.arange(len(loop)), places, triangles)
    return lids.draped(corners, rim.starts, frame, plate or flat)
