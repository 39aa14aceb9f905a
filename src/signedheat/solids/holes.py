"""Holes of a mesh, closed one by one: the mesh stays as it is, and sheets keep their outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints
from ..errors import GeometryError, SourceError
from ..mesh.components import element_components
from ..mesh.edges import edge_table
from ..mesh.triangles import side_lengths
from ..mesh.welding import same_positions
from ..shapes.foreign import ForeignShape, converted
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import element_ids, positive_number, public_call
from .bounding import Bounding, bounding
from .chain import Chain
from .closing import NO_EDGES, closed_by
from .completion import Completion, Lids
from .rims import boundary, loops

Rims = Sequence[Ints]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Filled:
    """Attributes of the meshes that `fill_holes` returns.

    Attributes
    ----------
    origins : (m,) int
        Number of each face in the given mesh, −1 for new ones: ``values[origins]`` carries values of faces over.
    filled : sequence of (k,) int
        Vertices around each hole that was closed.
    left : sequence of (k,) int
        Vertices around each boundary loop that is still open: larger holes, and outlines of sheets.
    """

    origins: Ints
    filled: Rims
    left: Rims

    def _set_origins(self, origins: Ints, filled: Rims, left: Rims) -> None:
        """Set the three attributes of a new mesh."""
        vars(self).update(origins=origins, filled=filled, left=left)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class FilledMesh(Filled, TriangleMesh):
    """Triangles whose holes were closed by `fill_holes`: those that were given, then new ones.

    It is a `TriangleMesh` with the attributes ``origins``, ``filled`` and ``left``, which `fill_holes` describes.

    See Also
    --------
    fill_holes : Close holes, and leave the rest of a mesh as it is.
    """


@dataclass(frozen=True, eq=False, repr=False, init=False)
class FilledPolygonMesh(Filled, PolygonMesh):
    """Polygons whose holes were closed by `fill_holes`: those that were given, then triangles.

    It is a `PolygonMesh` with the attributes ``origins``, ``filled`` and ``left``, which `fill_holes` describes.

    See Also
    --------
    fill_holes : Close holes, and leave the rest of a mesh as it is.
    """


@overload
def fill_holes(
    mesh: PolygonMesh, *, largest: float | None = None, rims: ArrayLike | None = None, lids: Lids = "bent"
) -> FilledPolygonMesh: ...
@overload
def fill_holes(
    mesh: TriangleMesh | ForeignShape,
    *,
    largest: float | None = None,
    rims: ArrayLike | None = None,
    lids: Lids = "bent",
) -> FilledMesh: ...
@public_call
def fill_holes(
    mesh: TriangleMesh | PolygonMesh | ForeignShape,
    *,
    largest: float | None = None,
    rims: ArrayLike | None = None,
    lids: Lids = "bent",
) -> FilledMesh | FilledPolygonMesh:
    """Close holes of a mesh, and leave everything else as it is.

    Vertices and faces of the mesh are kept as they are, in their order. New ones follow, and are oriented as their
    neighbours are. Every boundary loop of a part that bounds something is a hole. Sheets stay sheets: the longest
    boundary loop of each is its outline, which stays open. To make a solid of a broken shape, use `complete`.

    Parameters
    ----------
    mesh : TriangleMesh or PolygonMesh
        Any mesh.
    largest : float, optional
        Boundary loops longer than this stay open, in the units of the mesh. By default all holes are closed.
    rims : int or sequence of int, optional
        Close only the boundary loops through these vertices, even if they are outlines of sheets. By default all holes
        are closed.
    lids : {"bent", "flat"}
        Whether patches continue the curvature of the surface, or are flat, as in `complete`.

    Returns
    -------
    FilledMesh or FilledPolygonMesh
        A `TriangleMesh`, or a `PolygonMesh` of a mesh of polygons, with three more attributes. ``origins``, (m,) int,
        is the number of each face in the given mesh, −1 for new ones. ``filled`` is a sequence
        of arrays, (k,) int, with the vertices of each boundary loop that was closed, and ``left`` one of those of each
        that is still open.

    Raises
    ------
    GeometryError
        If the shape is no mesh.
    SourceError
        If no boundary loop passes through one of the vertices.

    See Also
    --------
    complete : Make a solid of a broken shape.
    orient : Flip faces or curves so that they agree.
    results.FilledMesh : A mesh whose holes are closed.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.without_patches(samples.sphere(4), 3, 0.3)
    >>> whole = fill_holes(ball)
    >>> len(whole.filled), len(whole.left), bool((whole.faces[: ball.n_faces] == ball.faces).all())
    (3, 0, True)
    >>> areas = ball.face_areas[whole.origins]  # a value for each face
    >>> areas[whole.origins < 0] = 0.0  # new faces have none
    """
    given = converted(mesh)
    if not isinstance(given, TriangleMesh | PolygonMesh):
        raise GeometryError(f"a {type(given).__name__} has no holes that can be closed by faces", remedy="pass a mesh")
    options = Completion(lids=lids)
    most = np.inf if largest is None else positive_number(largest, "largest")
    triangles = given.triangulation
    vertices, chain = triangles.vertices, Chain.of(triangles)
    decided = bounding(chain)
    used = np.flatnonzero(decided.orientable[decided.pieces] & ~decided.inner & ~decided.closed)
    turned = decided.turned[used]
    faces = np.where(turned[:, None], chain.faces[used][:, ::-1], chain.faces[used])
    around = loops(vertices, faces, boundary(faces))
    lengths = np.array([float(side_lengths(vertices[loop]).sum()) for loop in around])
    if rims is None:
        chosen = _holes(around, lengths, faces, decided, used)
    else:
        chosen = _through(around, vertices, element_ids(np.reshape(rims, (-1, 1)), "rims", 1, given.n_vertices)[:, 0])
    chosen &= lengths <= most
    filled, left = ([loop for loop, yes in zip(around, chosen, strict=True) if yes == kind] for kind in (True, False))
    outlines = [np.stack([loop, np.roll(loop, -1)], axis=1) for loop in left]
    points, added = closed_by(
        vertices, faces, bent=options.lids == "bent", outlines=np.concatenate([NO_EDGES, *outlines])
    )
    virtual = len(vertices) - given.n_vertices  # vertices added within polygons, which no lid touches
    added = _as_neighbours(faces, turned, added)
    added = np.where(added < given.n_vertices, added, added - virtual)
    points = np.concatenate([given.vertices, points[len(vertices) :]])
    n = given.n_polygons if isinstance(given, PolygonMesh) else given.n_faces
    filled_mesh: FilledMesh | FilledPolygonMesh
    if isinstance(given, PolygonMesh):
        filled_mesh = FilledPolygonMesh(points, [*given.polygons, *added])
    else:
        filled_mesh = FilledMesh(points, np.concatenate([given.faces, added]))
    filled_mesh._set_origins(np.append(np.arange(n), np.full(len(added), -1)), filled, left)
    return filled_mesh


def _holes(around: Rims, lengths: Floats, faces: Ints, decided: Bounding, used: Ints) -> Bools:
    """(l,) whether loops are holes: those along bounding faces, and all loops of a sheet but the longest.

    `around` are the vertices of l loops with (l,) lengths, along (m, 3) `faces`, which are triangles `used` of the
    chain that was decided about.
    """
    keys = (faces << 32 | np.roll(faces, -1, axis=1)).ravel()  # of halfedges, tail and head in one number
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    bounds, scraps = decided.counts != 0, decided.loose >= 0
    longest: dict[int, int] = {}  # the longest loop of each piece
    of_body, of_one_piece = np.zeros(len(around), dtype=bool), np.zeros(len(around), dtype=bool)
    for k, loop in enumerate(around):
        # a loop runs against the halfedges of the faces behind it
        behind = used[order[np.searchsorted(keys, np.roll(loop, -1) << 32 | loop)] // 3]
        pieces = np.unique(decided.pieces[behind]).tolist()
        of_body[k] = bounds[behind].all() and not scraps[behind].all()
        of_one_piece[k] = len(pieces) == 1
        for piece in pieces:
            if piece not in longest or lengths[k] > lengths[longest[piece]]:
                longest[piece] = k
    outlines = np.isin(np.arange(len(around)), list(longest.values()))
    return of_body | (of_one_piece & ~outlines)


def _through(around: Rims, vertices: Floats, named: Ints) -> Bools:
    """(l,) whether loops pass through a `named` vertex, or one at its position; raise if a named one is on no loop."""
    first = same_positions(vertices)
    hits_by_loop = [np.isin(first[named], first[loop]) for loop in around]
    missed = ~np.any(np.array(hits_by_loop, dtype=bool).reshape(-1, len(named)), axis=0)
    if missed.any():
        vertex = f"vertex {named[np.argmax(missed)]}"
        raise SourceError(
            f"no boundary loop passes through {vertex}", element=vertex, remedy="name vertices of open edges"
        )
    return np.array([hits.any() for hits in hits_by_loop], dtype=bool)


def _as_neighbours(faces: Ints, turned: Bools, added: Ints) -> Ints:
    """Flip each connected part of the (k, 3) added faces if most given faces along its edges had been flipped.

    `turned` tells which of the (m, 3) given `faces` had been flipped.
    """
    if not len(added):
        return added
    table = edge_table(np.concatenate([faces, added]))
    signs = np.where(turned, -1, 1)
    votes = np.bincount(table.face_edges[: len(faces)].ravel(), np.repeat(signs, 3), len(table.vertices))
    added_edges = table.face_edges[len(faces) :]
    parts = element_components(added_edges)
    flipped = np.bincount(np.repeat(parts, 3), votes[added_edges.ravel()])[parts] < 0
    return np.where(flipped[:, None], added[:, ::-1], added)
