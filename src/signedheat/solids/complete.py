"""Complete a broken shape, once: what bounds it, and what closes it where it is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..constraints import Constraint
from ..diagnostics import Diagnostics, FacesRestored, Note, OrientedPoints
from ..domains.foreign import SurfaceShape
from ..domains.joining import joined_shape
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..domains.validation import flag
from ..errors import SignedHeatError, SourceError
from ..geometry.directions import axes_across
from ..geometry.face_tree import FaceTree
from ..geometry.meshes import face_areas
from ..geometry.welding import welded_vertices
from ..memory import refuse_beyond_memory
from ..operators.grid.fitted_points import mean_gap
from ..orientations.meshes import orientation
from ..orientations.points import orient_points
from ..progress import Progress, Stopwatch
from . import parts
from .closing import closed_by, small_lids, strips
from .heat import Heat, heat_surface
from .loose import are_copies, bound_together, fragments, scatter_of
from .rims import open_edges
from .solid import Solid
from .unite import Surface, united

STEPS = 2
"""Steps that are timed."""
BYTES_PER_FACE = 1300
"""Measured peak for each face of meshes of 330,000, closed or open; points take less."""
BYTES_IF_LOOSE, BYTES_OF_HEAT = 3400, 150_000_000
"""The same for loose triangles; and of the grid that they and points are completed on."""
CELLS = 2.0
"""Cells between neighbouring points of a cloud."""
SEAM = 0.75
"""Cells from faces within which the zero set of φ is taken for those faces."""


def complete(
    shape: ShapeLike | Sequence[ShapeLike],
    *,
    completion: Literal["lids", "heat"] = "lids",
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    progress: Progress | None = None,
) -> Solid:
    """The solid that a shape is, or is a broken picture of.

    Faces are turned to agree and to face outwards. Parts that bound something are closed by lids: thin plates that go
    on over their rims where the surface bends towards them, and are flat elsewhere. Points, and loose triangles that
    scatter around a surface, are completed by the signed heat method. Bodies that overlap are united. Sheets bound
    nothing: distance to them is positive on both sides. None of this depends on where distance is wanted, nor on
    rotation, position and scale.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh; or several meshes
        Broken or not; points with normals or without. Objects of trimesh, PyVista, meshio and Open3D and pairs
        (vertices, faces) are taken wherever a shape is. A `Solid` is returned as it is.
    completion : {"lids", "heat"}
        What closes meshes: lids, or the zero set of φ where no face is, as in the paper (Feng & Crane 2024).
    as_oriented : bool
        Take faces and normals as they are, whichever way they face.
    keep_overlaps : bool
        Count what lies inside other bodies as surface.
    constraint, diffusion : Constraint, float
        Of the signed heat method, where that completes.
    progress : callable, optional
        Called as ``progress(fraction, step)``, ten times a second; what it raises cancels.

    Returns
    -------
    Solid
        Its ``diagnostics.notes`` say what was turned, left out and completed.

    Raises
    ------
    SourceError
        If no face has an area, or points have no normals and none are to be fitted.
    MemoryLimitError
        If it cannot fit in memory; nothing has been allocated then.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.without_patches(samples.sphere(3), 3, 0.4)
    >>> solid = complete(ball)
    >>> solid.distance([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]).round(1).tolist()
    [-1.0, 1.0]
    """
    if isinstance(shape, Solid):
        return shape
    if completion not in ("lids", "heat"):
        raise SignedHeatError(f'completion must be "lids" or "heat", not {completion!r}', element="completion")
    as_oriented, keep_overlaps = flag(as_oriented, "as_oriented"), flag(keep_overlaps, "keep_overlaps")
    joined = joined_shape(shape)
    count = joined.n_points if isinstance(joined, PointCloud) else joined.triangulation.n_faces
    refuse_beyond_memory(
        f"completing a shape of {count} faces",
        count,
        lambda n: bytes_to_complete(joined, n),
        lambda n: f"simplify it to {n} faces, or free memory",
    )
    method = Heat(constraint, diffusion)
    stopwatch = Stopwatch(progress, STEPS)
    with stopwatch("orient") as run:
        found = run(lambda: orientation(joined)) if not (as_oriented or isinstance(joined, PointCloud)) else None
        turned = found.shape if found else joined
        notes: tuple[Note, ...] = (found.note,) if found else ()
        if isinstance(joined, PointCloud) and not as_oriented:
            turned, notes = run(partial(oriented, joined))
    with stopwatch("complete") as run:
        if isinstance(turned, PointCloud):
            solid = run(partial(_from_points, turned, method))
        else:
            inner = found.inner[_owners(turned)] if found else None
            solid = run(partial(completed, turned.triangulation, completion, keep_overlaps, method, inner))
    origins = solid.origins
    if isinstance(turned, TriangleMesh | PolygonMesh):  # as the shape that was given numbers its faces
        names = _owners(turned) if found is None else found.faces[_owners(turned)]
        origins = np.where(origins >= 0, names[origins], -1)
    source = joined if isinstance(joined, TriangleMesh) else None
    diagnostics = Diagnostics(timings=dict(stopwatch.seconds), notes=(*notes, *solid.diagnostics.notes))
    return replace(solid, origins=origins, source=source, diagnostics=diagnostics)


def bytes_to_complete(shape: SurfaceShape, count: int) -> float:
    """Peak memory of completing a shape that is like this one but has so many faces."""
    if isinstance(shape, PointCloud):
        return BYTES_OF_HEAT + BYTES_PER_FACE * count
    mesh = shape.triangulation
    if mesh.n_vertices == 3 * mesh.n_faces and mesh.n_faces > 1:
        return BYTES_OF_HEAT + BYTES_IF_LOOSE * count
    return BYTES_PER_FACE * count


def oriented(shape: SurfaceShape) -> tuple[SurfaceShape, tuple[Note, ...]]:
    """A shape whose faces or normals point outwards, and what was done for it."""
    if isinstance(shape, PointCloud):
        points = orient_points(shape)
        return points.cloud, (OrientedPoints(points.n_fitted, points.n_turned),)
    found = orientation(shape)
    return found.shape, (found.note,)


def _owners(shape: TriangleMesh | PolygonMesh) -> NDArray[np.int64]:
    """(m,) face that each triangle of a mesh is part of."""
    return shape.refinement.face_polygons if isinstance(shape, PolygonMesh) else np.arange(shape.n_faces)


def completed(
    mesh: TriangleMesh,
    completion: Literal["lids", "heat"],
    keep_overlaps: bool,
    method: Heat,
    inner: NDArray[np.bool_] | None = None,
) -> Solid:
    """The solid that oriented triangles are, of which inner ones bound nothing; its origins are theirs."""
    vertices = mesh.vertices
    ids = welded_vertices(vertices, mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel())[mesh.faces]
    a, b, c = ids.T
    proper = np.flatnonzero((a != b) & (b != c) & (c != a))
    every = Surface(vertices[mesh.faces[proper]], ids[proper], proper, True)
    bounding = np.ones(len(proper), dtype=bool) if inner is None else ~inner[proper]
    given, walls = every.select(bounding, True), [every.select(~bounding, False)]
    if not face_areas(given.triangles).any():
        raise SourceError("no face of the shape has an area", element="shape")
    if completion == "heat":
        return united(_by_heat(given, method) + walls, keep_overlaps)
    lost = small_lids(vertices, given.ids)
    added = np.concatenate([lost, strips(vertices, np.concatenate([given.ids, lost]))])
    surfaces, copies = _by_lids(given, added, vertices, method)
    restored = float(face_areas(vertices[lost]).sum() / face_areas(given.triangles).sum())
    notes = [FacesRestored(len(lost), restored / (1 + restored))] if len(lost) else []
    return united(surfaces + walls, keep_overlaps, notes, copies=copies)


def _by_lids(
    given: Surface, added: NDArray[np.int64], vertices: NDArray[np.float64], method: Heat
) -> tuple[list[Surface], int]:
    """Bodies, with the faces added between their vertices, and their lids; sheets; what loose pieces are.

    Also how many faces are left out as copies of others.
    """
    whole = Surface(
        np.concatenate([given.triangles, vertices[added]]),
        np.concatenate([given.ids, added]),
        np.concatenate([given.origins, np.full(len(added), -1)]),
        True,
    )
    labels, is_body = parts.bodies(whole.triangles, whole.ids)
    copies = ~is_body[labels]
    if copies.any():
        copies[copies] = are_copies(whole.triangles[copies], labels[copies], whole.triangles[~copies])
    whole, labels = whole.select(~copies, True), labels[~copies]
    surfaces, lidded = [], is_body[labels]
    opened = np.isin(np.arange(len(is_body)), open_edges(whole.ids, labels)[1])
    for chosen in fragments(whole.triangles, labels, ~is_body, is_body & opened):
        pieces, loose = whole.select(chosen, False), ~is_body[labels[chosen]]
        if bound_together(pieces.triangles, labels[chosen], loose):
            surfaces += _scattered(pieces, labels[chosen], method)
            lidded[chosen] = False
        else:
            surfaces.append(pieces.select(loose, False))
    bodies = whole.select(lidded, True)
    positions, added = closed_by(vertices, bodies.ids)
    lids = Surface(positions[added], added, np.full(len(added), -1), True)
    return [bodies, lids, *surfaces], int(copies.sum())


def _scattered(pieces: Surface, labels: NDArray[np.int64], method: Heat) -> list[Surface]:
    """The surface that pieces scatter around; or they and what closes them."""
    if scatter := scatter_of(pieces.triangles, labels):
        made = _heat_of(pieces, method, scatter)
        return [pieces] if made is None else [made]
    return _by_heat(pieces, method)


def _by_heat(given: Surface, method: Heat) -> list[Surface]:
    """Triangles, and the zero set of φ where they are not."""
    made = _heat_of(given, method)
    if made is None:
        return [replace(given, closing=False)]
    tree = FaceTree.of_triangles(given.triangles)
    cell = float(np.median(np.linalg.norm(made.triangles[:, 1] - made.triangles[:, 0], axis=1)))
    away = tree.distances(made.triangles.mean(axis=1)) > SEAM * cell
    return [replace(given, closing=True), made.select(away, True)]


def _heat_of(pieces: Surface, method: Heat, cell: float = 0.0) -> Surface | None:
    names, faces = np.unique(pieces.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    made = heat_surface(TriangleMesh(names, faces.reshape(-1, 3)), method, cell)
    return None if made is None else Surface.made(made[0][made[1]])


def _from_points(cloud: PointCloud, method: Heat) -> Solid:
    """The solid that oriented points are samples of; where they bound nothing, each is a small triangle."""
    if cloud.normals is None:
        raise SourceError("the point cloud has no normals, which say what is inside", remedy="give it normals")
    gap = mean_gap(np.asarray(cloud.points))
    made = heat_surface(cloud, method, gap / CELLS)
    if made is not None:
        return united([Surface.made(made[0][made[1]])], True, points=cloud.points)
    first, second = axes_across(cloud.normals)
    turns = np.stack([np.cos(2 * np.pi * np.arange(3) / 3), np.sin(2 * np.pi * np.arange(3) / 3)], axis=1)
    ways = turns[:, :1] * first[:, None] + turns[:, 1:] * second[:, None]
    return united([Surface.made(cloud.points[:, None] + 0.25 * gap * ways, False)], True, points=cloud.points)
