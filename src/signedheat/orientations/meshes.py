"""Orientation of meshes: faces agree with their neighbours, and parts point outwards."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import ShapeOriented
from ..domains.foreign import ForeignShape, converted
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..frozen import Frozen
from ..geometry.part_levels import own_levels
from ..reprs import ShortRepr
from .inner_walls import inner_walls
from .mesh_faces import Mesh, MeshFaces
from .parts import LEAST_CLOSED, PartOrientation, Parts, clear, orient_parts
from .soups import agreement, disagreeing_with_neighbors, odds_at_corners, orient_triangles
from .stabbing_lines import LineCrossings, aimed_lines, joined, stabbing_lines
from .surface_parts import SurfaceParts
from .votes import imbalance, votes

N_LINES = 30_000
"""Lines laid through a shape to see which way its parts face."""
MANY = 500_000
"""Triangles from which on lines have 8 directions only, not 16: each costs a look at all of them."""
N_AIMED = 8
"""Closed parts that fewer of them cross get lines of their own."""
N_CLEAR = 64
"""Open parts that fewer of them cross face out of themselves by their own winding number, if that is clear. Half or
twice as many change none of 125 shapes and of 200 boxes on a sheet."""
FEW = 0.75
"""Logarithm of the odds from which parts turn that have but a hint: that all other parts must turn."""
NEARLY_CLOSED = 0.8
"""Share of votes (see `LEAST_VOTE`) from which a doubled part is a solid drawn from both sides, no wall."""
SMALL = 0.03
"""Share of the area up to which a part that lines do not decide follows its neighbours."""
SOUP = 0.1
"""Share of the area of small loose parts from which a shape is a soup, in part."""
UNEVEN = 0.04
"""Imbalance of the lines through a soup from which on it is oriented from scratch."""
MENDED = 0.9
"""Share of that imbalance below which it must come by it; or it must not grow, and pieces must agree so much more:"""
AGREEING = 1.8
"""Ratio of the length of sums of area vectors of neighbours, after to before."""
MOST = 200_000
"""Loose parts up to which a soup is oriented from scratch: it takes half a minute."""


@dataclass(frozen=True, eq=False, repr=False)
class Orientation(Frozen, ShortRepr):
    """How a mesh was oriented, and what was found on the way.

    Attributes
    ----------
    shape : TriangleMesh or PolygonMesh
        The oriented mesh, on the same vertices.
    faces : (k,) int
        Which faces of the mesh that was given are still there, in order.
    turned : (k,) bool
        Which of them were turned.
    parts : (k,) int
        Which of them hang together across edges of two faces; −1 for faces on fewer than three places, and inner walls.
    walls : (k,) bool
        Faces of doubled walls.
    undecided : (k,) bool
        Faces of sheets and other parts for which no side is outside: they agree with their neighbours, and most of each
        part's area is as it was given.
    inner : (k,) bool
        Walls between closed cells (see `inner_walls`), which bound nothing: left as they are.
    n_parts, closed_parts : int
        Parts, and those of which every edge has two faces.
    turned_parts, turned_faces, turned_area : int, int, float
        Parts given facing inwards; faces turned, and their share of the area.
    inconsistent_edges : int
        Edges across which two faces disagreed.
    nonmanifold_edges : int
        Edges of three or more faces, across which orientation is not carried on.
    nonorientable_parts : int
        Parts whose faces cannot agree, such as Möbius bands: left as they are.
    undecided_parts, undecided_area : int, float
        Parts without outside, doubled walls left out, and their share of the area.
    merged_faces : int
        Duplicates left out.
    doubled_walls, wall_area : int, float
        Parts there twice, once facing each way; share of the area, both sides counted.
    nested_bodies, cavities : int
        Parts hidden in others: those that are bodies as well, and those that are walls of cavities.

    Examples
    --------
    >>> from signedheat import samples
    >>> found = orientation(samples.with_flipped_faces(samples.sphere(2), 0.1))
    >>> found.turned_faces, found.inconsistent_edges, found.n_parts
    (33, 89, 1)
    """

    shape: Mesh
    faces: NDArray[np.int64]
    turned: NDArray[np.bool_]
    parts: NDArray[np.int64]
    walls: NDArray[np.bool_]
    undecided: NDArray[np.bool_]
    inner: NDArray[np.bool_]
    n_parts: int
    closed_parts: int
    turned_parts: int
    turned_faces: int
    turned_area: float
    inconsistent_edges: int
    nonmanifold_edges: int
    nonorientable_parts: int
    undecided_parts: int
    undecided_area: float
    merged_faces: int
    doubled_walls: int
    wall_area: float
    nested_bodies: int
    cavities: int

    @property
    def summary(self) -> dict[str, int | float]:
        """The counts and shares by name."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, (int, float))}

    @property
    def note(self) -> ShapeOriented:
        """The note about it in diagnostics."""
        return ShapeOriented(**{entry.name: getattr(self, entry.name) for entry in fields(ShapeOriented)})


def orientation(shape: Mesh | ForeignShape) -> Orientation:
    """Orient a mesh, and say what was turned, merged and left.

    Vertices at one place, to roundoff, count as one. Faces on the same corners count as one. Walls between closed cells
    are left out (`inner_walls`). Across edges of two faces orientation is carried on, and each part so found takes that
    of the most of its area. Lines through the whole shape then decide which way each part faces (`orient_parts`).
    Small pieces that touch other parts at corners face as they do; of those that touch nothing, each turns only if its
    neighbours clearly disagree with it. Where they are a tenth of the shape or more, and lines do not leave it as often
    as they enter it, points on them decide which way they face, all together (`orient_triangles`): that is taken if
    lines then find fewer contradictions.

    A part that is there twice, once facing each way, is a doubled wall: both its sides stay. If it is closed, or holes
    make up less than a ninth of its area, it is a solid drawn from both sides, and one side goes.

    Takes O(n) time, and O(k log k) for k pieces that touch nothing.

    Parameters
    ----------
    shape : TriangleMesh or PolygonMesh
        Any mesh, however broken.

    Raises
    ------
    GeometryError
        If the shape is no mesh.

    Examples
    --------
    >>> from signedheat import samples
    >>> outer, cavity = samples.sphere(3), samples.sphere(3, radius=0.5)
    >>> inside_out = TriangleMesh(cavity.vertices, cavity.faces[:, ::-1])
    >>> found = orientation(samples.union(outer, inside_out))
    >>> found.turned_parts, found.cavities, found.nested_bodies
    (0, 1, 0)
    >>> orientation(samples.union(outer, cavity)).nested_bodies
    1
    """
    shape = converted(shape)
    if not isinstance(shape, TriangleMesh | PolygonMesh):
        kind = type(shape).__name__
        raise GeometryError(
            f"faces are oriented here, and a {kind} has none",
            remedy="pass a TriangleMesh or PolygonMesh",
        )
    faces = MeshFaces.of(shape)
    n_nonmanifold = int((faces.surface.pairs.counts > 2).sum())
    if n_nonmanifold:
        faces = _without_inner_walls(faces)
    lines = _lines(faces)
    faces = _bodies_apart(faces, lines)
    surface, part_of = faces.surface, faces.surface.orientation.parts
    lines = _with_aimed(faces, lines)
    walls = _doubled_walls(surface, lines)
    parts = _table(faces, walls, lines)
    if walls.any():
        lines = lines.chosen(~walls[part_of[lines.crossed]])
    found = orient_parts(parts, lines, part_of[lines.crossed])
    undecided = surface.is_part & ~found.decided & ~parts.fixed
    few = parts.areas <= SMALL * parts.areas.sum()
    small = surface.is_part & ~parts.closed & ~parts.fixed & (found.nested < 0) & few
    odds, undecided = _ask_neighbors(faces, found.odds, undecided, small)
    wrong = odds < np.where(undecided, -FEW, 0.0)
    turned = surface.orientation.turned != wrong[part_of]
    alone = surface.is_first & (undecided & few)[part_of]
    if alone.any():
        normals = faces.normals(turned) * surface.is_first[:, None]
        turned = turned != disagreeing_with_neighbors(faces.centroids, normals, alone)
    if 0 < small.sum() <= MOST and parts.areas[small].sum() > SOUP * parts.areas.sum():
        together = _turned_together(faces, turned, small, lines)
        if together is not None:
            turned, undecided = together, undecided & ~small
    return _oriented(shape, surface, found, turned, wrong, walls, undecided, n_nonmanifold)


def _without_inner_walls(faces: MeshFaces) -> MeshFaces:
    """The faces without those that have a closed cell on both sides."""
    surface = faces.surface
    normals = faces.normals(np.zeros(surface.n_faces, dtype=bool))
    inner = inner_walls(
        faces.positions, surface.pairs, surface.tails, surface.heads, surface.owners, normals, *faces.measures
    )
    return replace(faces, inner=inner) if inner.any() else faces


def _bodies_apart(faces: MeshFaces, lines: LineCrossings) -> MeshFaces:
    """Faces in parts. Where a body that bounds something as given would have to turn, such bodies are parts.

    Two that touch along an edge, where each lacks a side, look like neighbours that disagree; if they are made to
    agree, what one of them bounds the other undoes.
    """
    surface = faces.surface
    if not surface.orientation.disagreeing:
        return faces
    pieces, part = surface.given.parts, surface.orientation.parts
    found = votes(lines.starts, pieces[lines.crossed], lines.entering, len(surface.given.orientable))
    bodies = clear(found.own_votes, found.own, LEAST_CLOSED)
    facing = np.where(surface.orientation.turned, -1, 1) * np.sign(found.own_votes)[pieces] * bodies[pieces]
    areas = surface.areas * surface.is_first
    sides = [np.bincount(part, areas * (facing == side), surface.n_parts) for side in (-1, 1)]
    against = facing == np.where(sides[1] >= sides[0], -1, 1)[part]
    apart = against & (facing != 0) & surface.is_first
    return replace(faces, apart=apart) if apart.any() else faces


def _lines(faces: MeshFaces) -> LineCrossings:
    """Lines through first faces as they were given."""
    drawn = _drawn(faces)
    count = 16 if len(drawn) < MANY else 8
    lines = stabbing_lines(faces.positions, faces.triangles[drawn], faces.bounds, N_LINES, count)
    return replace(lines, crossed=faces.triangle_faces[drawn][lines.crossed])


def _drawn(faces: MeshFaces) -> NDArray[np.int64]:
    """Triangles of first faces."""
    return np.flatnonzero(faces.surface.is_first[faces.triangle_faces])


def _with_aimed(faces: MeshFaces, lines: LineCrossings) -> LineCrossings:
    """Lines through first faces as they agree with their neighbours, and more through closed parts that few cross."""
    surface = faces.surface
    counts = np.bincount(surface.orientation.parts[lines.crossed], minlength=surface.n_parts)
    missed = np.flatnonzero(surface.orientation.closed & surface.is_part & (counts < N_AIMED))
    if len(missed):
        aims = _middles_of_largest(faces, missed)
        drawn = _drawn(faces)
        aimed = aimed_lines(faces.positions, faces.triangles[drawn], faces.bounds, aims)
        lines = joined(lines, replace(aimed, crossed=faces.triangle_faces[drawn][aimed.crossed]))
    return replace(lines, entering=lines.entering != surface.orientation.turned[lines.crossed])


def _middles_of_largest(faces: MeshFaces, parts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Middles of the largest triangle of each of some parts."""
    areas = np.where(faces.surface.is_first, faces.surface.areas, -1.0)
    of_part = faces.surface.orientation.parts
    order = np.argsort(areas, kind="stable")
    largest = np.zeros(faces.surface.n_parts, dtype=np.int64)
    largest[of_part[order]] = order  # the last written
    of_face = np.zeros(len(areas), dtype=np.int64)
    of_face[faces.triangle_faces[::-1]] = np.arange(len(faces.triangles))[::-1]
    return faces.positions[faces.triangles[of_face[largest[parts]]]].mean(axis=1)


def _doubled_walls(surface: SurfaceParts, lines: LineCrossings) -> NDArray[np.bool_]:
    """(n_parts,) parts that are there twice, once facing each way, and are far from closed."""
    alike, opposite = surface.copies
    doubled = (alike > 0) & (opposite > 0)
    if not doubled.any():
        return np.zeros(surface.n_parts, dtype=bool)
    mostly = surface.part_sums(surface.areas * doubled) > 0.5 * surface.part_sums(surface.areas)
    found = votes(lines.starts, surface.orientation.parts[lines.crossed], lines.entering, surface.n_parts)
    encloses = surface.orientation.closed | (np.abs(found.own_votes) > NEARLY_CLOSED * np.maximum(found.own, 1))
    return mostly & ~encloses


def _table(faces: MeshFaces, walls: NDArray[np.bool_], lines: LineCrossings) -> Parts:
    """What is known of parts without lines; levels of the open ones that few lines cross."""
    surface, (areas, volumes) = faces.surface, faces.measures
    turned = surface.orientation.turned
    alike, opposite = surface.copies
    totals = surface.part_sums(areas * (alike + opposite))
    as_given = surface.part_sums(areas * np.where(turned, opposite, alike))
    counts = np.bincount(surface.orientation.parts[lines.crossed], minlength=surface.n_parts)
    scarce = surface.is_part & ~surface.orientation.closed & (counts < N_CLEAR)
    return Parts(
        areas=surface.part_sums(areas),
        volumes=surface.part_sums(np.where(turned, -volumes, volumes)),
        closed=surface.orientation.closed & surface.is_part,
        levels=_levels(faces, scarce),
        agreement=as_given / np.where(totals > 0, totals, 1),
        fixed=walls | ~surface.orientation.orientable | ~surface.is_part,
    )


def _levels(faces: MeshFaces, chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n_parts,) levels of some parts, and 0."""
    surface, levels = faces.surface, np.zeros(faces.surface.n_parts)
    owners = surface.orientation.parts[faces.triangle_faces]
    some = np.flatnonzero(chosen[owners] & surface.is_first[faces.triangle_faces])
    if len(some):
        names, labels = np.unique(owners[some], return_inverse=True)
        levels[names] = own_levels(_agreeing(faces, some), labels)
    return levels


def _agreeing(faces: MeshFaces, triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(k, 3, 3) corners of some triangles, whose faces agree with their neighbours."""
    corners: NDArray[np.float64] = faces.positions[faces.triangles[triangles]]
    backwards = faces.surface.orientation.turned[faces.triangle_faces[triangles]]
    corners[backwards] = corners[backwards, ::-1]
    return corners


def _ask_neighbors(
    faces: MeshFaces, odds: NDArray[np.float64], undecided: NDArray[np.bool_], small: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Odds of small parts with what they touch at corners, and the parts of which still nothing is known."""
    surface = faces.surface
    if not small.any():
        return odds, undecided
    normals = faces.normals(surface.orientation.turned)[surface.owners]
    found = odds_at_corners(surface.tails, surface.orientation.parts[surface.owners], normals, odds, small)
    return found, undecided & (np.abs(found - odds) < 1.0)


def _turned_together(
    faces: MeshFaces, turned: NDArray[np.bool_], loose: NDArray[np.bool_], lines: LineCrossings
) -> NDArray[np.bool_] | None:
    """Turn loose parts all together, by points on them; None if lines then find no fewer contradictions."""
    surface, agreeing = faces.surface, faces.surface.orientation.turned

    def unevenness(turned: NDArray[np.bool_]) -> float:
        return imbalance(lines.starts, lines.entering != (turned != agreeing)[lines.crossed])

    before = unevenness(turned)
    if before < UNEVEN:
        return None
    of_triangle = surface.orientation.parts[faces.triangle_faces]
    chosen = np.flatnonzero(loose[of_triangle] & surface.is_first[faces.triangle_faces])
    flipped = np.zeros(surface.n_parts, dtype=bool)
    flipped[of_triangle[chosen]] = orient_triangles(_agreeing(faces, chosen), of_triangle[chosen]) < 0
    together = np.where(loose[surface.orientation.parts], agreeing != flipped[surface.orientation.parts], turned)
    after = unevenness(together)
    if MENDED * before <= after <= before:
        vectors = faces.normals(turned) * (surface.areas * surface.is_first)[:, None]
        backwards = np.where(turned != together, -1.0, 1.0)[:, None]
        gain = agreement(faces.centroids, vectors * backwards) / agreement(faces.centroids, vectors)
        return together if gain > AGREEING else None
    return together if after < before else None


def _oriented(
    shape: Mesh,
    surface: SurfaceParts,
    found: PartOrientation,
    turned: NDArray[np.bool_],
    wrong: NDArray[np.bool_],
    walls: NDArray[np.bool_],
    undecided: NDArray[np.bool_],
    n_nonmanifold: int,
) -> Orientation:
    """Keep one of the copies of each face, in doubled walls one facing each way; and count what was done."""
    first = np.where(surface.first >= 0, surface.first, np.arange(surface.n_faces))
    inner = np.zeros(surface.n_faces, dtype=bool) if surface.inner is None else surface.inner[first]
    parts = np.where((surface.first >= 0) & ~inner, surface.orientation.parts[first], -1)
    flipped = turned[first] != surface.reversed  # a copy that runs the other way must turn where the first must not
    if surface.is_first.all():
        kept = np.arange(surface.n_faces)
        two_sided = np.zeros(surface.n_faces, dtype=bool)
    else:
        kept, two_sided = _kept(surface, first, flipped, walls[parts] & (parts >= 0))
    flipped = (flipped & ~two_sided)[kept]
    two_sided, parts = two_sided[kept], parts[kept]
    areas = surface.areas[kept]
    total = max(float(areas.sum()), np.finfo(float).tiny)
    sheet = undecided[parts] & (parts >= 0)
    return Orientation(
        shape=_turned_mesh(shape, kept, flipped),
        faces=kept,
        turned=flipped,
        parts=parts,
        walls=two_sided,
        undecided=sheet,
        inner=inner[kept],
        n_parts=int(surface.is_part.sum()),
        closed_parts=int((surface.is_part & surface.orientation.closed).sum()),
        turned_parts=int(wrong.sum()),
        turned_faces=int(flipped.sum()),
        turned_area=float(areas[flipped].sum()) / total,
        inconsistent_edges=int(surface.orientation.disagreeing),
        nonmanifold_edges=n_nonmanifold,
        nonorientable_parts=int((surface.is_part & ~surface.orientation.orientable).sum()),
        undecided_parts=int(undecided.sum()),
        undecided_area=float(areas[sheet].sum()) / total,
        merged_faces=surface.n_faces - len(kept),
        doubled_walls=int(walls.sum()),
        wall_area=float(areas[two_sided].sum()) / total,
        nested_bodies=int(((found.nested >= 0) & ~found.cavity).sum()),
        cavities=int(found.cavity.sum()),
    )


def _kept(
    surface: SurfaceParts, first: NDArray[np.int64], flipped: NDArray[np.bool_], in_wall: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Faces to keep: of the copies on the same corners one that need not turn, if any, and in walls one of each way."""
    alike, opposite = surface.copies
    two_sided = in_wall & (alike[first] > 0) & (opposite[first] > 0)
    group = 2 * first + (two_sided & surface.reversed)
    order = np.lexsort((flipped, group))
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = group[order[1:]] != group[order[:-1]]
    return np.sort(order[begins]), two_sided


def _turned_mesh(shape: Mesh, kept: NDArray[np.int64], flipped: NDArray[np.bool_]) -> Mesh:
    """Some faces of a mesh, some of them turned; the mesh itself where nothing changes."""
    if not flipped.any() and len(kept) == (shape.n_faces if isinstance(shape, TriangleMesh) else shape.n_polygons):
        return shape
    if isinstance(shape, TriangleMesh):
        faces = shape.faces[kept] if len(kept) < shape.n_faces else shape.faces.copy()
        faces[flipped] = faces[flipped][:, ::-1]
        return TriangleMesh(shape.vertices, faces)
    polygons = shape.polygons
    return PolygonMesh(
        shape.vertices,
        [polygons[k][::-1] if turn else polygons[k] for k, turn in zip(kept.tolist(), flipped.tolist(), strict=True)],
    )
