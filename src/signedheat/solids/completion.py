"""Complete a broken shape: decide which faces bound it, and close it where it is open.

Seams join the boundary of a part of a level set to the boundary of the faces that it completes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ..arrays import Floats, Ints
from ..constraints import Constraint, EachComponent, LevelValues
from ..diagnostics import CompletedArea, Diagnostics, FacesRestored, Note, ShapeOriented, SmallParts
from ..errors import ConstraintError, InexactWarning, SourceError, warn_user
from ..jobs import Progress, Stopwatch, run_cancellable
from ..linear.threads import one_blas_thread
from ..memory import refuse_beyond_memory
from ..mesh.arrangement import SAME_POINT
from ..mesh.components import numbered
from ..mesh.edges import has_three_corners
from ..mesh.triangles import face_areas
from ..mesh.unit_vectors import axes_across
from ..mesh.welding import indexed, parts_by_place, tolerances
from ..parallel import PointTree
from ..search.face_tree import FaceTree
from ..search.winding_tree import WindingTree
from ..shapes.foreign import SurfaceShape
from ..shapes.kinds import ShapeLike
from ..shapes.transforms import joined_shape
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import chosen, flag, positive_number, public_call
from .bodies import whole_boundary
from .bounding import Bounding, bounding
from .chain import Chain
from .closing import LOST_FACE_SIDES, closed_by, fan, small_lids
from .heat_surfaces import Heat, heat_surface
from .mesh_orientation import oriented_as, owners_of
from .overlaps import Nesting
from .point_orientation import mean_gap, orient_points, without_strays
from .regions import TOLERANCES
from .rims import boundary, divided_at_rims, loops
from .sealing import sealed
from .solid import Solid
from .union import TriangleGroup, solid_as_given, united
from .winding import INSIDE_WINDING, Windings


def seam_triangles(vertices: Floats, faces: Ints, patches: Ints, step: float) -> tuple[Floats, Ints]:
    """Join the boundary of faces, divided by points at most `step` apart, to the boundary of patches.

    Return these (k, 3) points, which are numbered after the vertices, and the (m, 3) triangles of the seams.
    """
    rim, (tails, heads) = boundary(faces), boundary(patches).T
    starts, edge_vectors = vertices[rim[:, 0]], vertices[rim[:, 1]] - vertices[rim[:, 0]]
    counts = np.maximum(np.ceil(np.linalg.norm(edge_vectors, axis=1) / step), 1).astype(np.int64) - 1
    edges, number = numbered(counts)
    shares = (number + 1) / (counts[edges] + 1)
    points = starts[edges] + shares[:, None] * edge_vectors[edges]
    ids = len(vertices) + np.arange(len(points))
    last = np.append(edges[1:] != edges[:-1], True)[: len(edges)]
    onward = np.where(last, rim[edges, 1], ids + 1)
    slivers = np.stack([rim[edges, 0], onward, ids], axis=1)
    all_points = np.concatenate([vertices, points])
    ends, border = np.append(np.unique(rim), ids), np.unique(tails)
    nearest = np.zeros(len(vertices), dtype=np.int64)
    nearest[border] = ends[PointTree(all_points[ends]).query(vertices[border])[1]]
    strip = np.concatenate(
        [np.stack([tails, heads, nearest[heads]], axis=1), np.stack([tails, nearest[heads], nearest[tails]], axis=1)]
    )
    return points, np.concatenate([slivers, strip[has_three_corners(strip)]])


def small_gaps(vertices: Floats, faces: Ints) -> Ints:
    """(k, 3) triangles that fill boundary loops of at most `LOST_FACE_SIDES` vertices, which seams leave."""
    around = [loop for loop in loops(vertices, faces, boundary(faces)) if len(loop) <= LOST_FACE_SIDES]
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *map(fan, around)])


BYTES_PER_COMPLETED_FACE = 1400
"""Peak memory per face, measured on meshes of 330,000 faces; points take less."""
BYTES_PER_LOOSE_FACE, BYTES_OF_HEAT = 3400, 150_000_000
"""Peak memory per loose triangle; and memory of the grid on which loose triangles and points are completed."""
CELLS_PER_POINT_GAP = 2.0
"""Number of grid cells between neighbouring points of a cloud."""
NOISE_REACH = 0.75
"""Largest distance of corners that noise has separated, relative to the square root of their triangle's area. However
little separates them, corners are at one place or are separated."""
CELLS_PER_FACE = 8.0
"""Cells of the zero set of φ are at least as wide as loose faces divided by this. With 16 or 32, volumes of four soups
of 80 to 1280 faces change by 0.02 %, and there are up to four times as many faces; with 4, by 0.16 %."""
TORN_LEVEL = 0.2
"""Loose pieces with a level below this, where a fifth to two fifths of a body are left, are completed by the signed
heat method, others by lids, which keep to the faces. For balls, tori and a cow without 45 % of their triangles, lids
enclose 0.1 % too little and heat 0.3 % too much; without 65 %, lids miss 1 to 12 % and heat 1 %."""
ZERO_SET_FACES = 0.75
"""Triangles of the zero set of φ within this distance of given faces, in cells, are left out, since those are there.
With 0.5 distance to balls, tori and ducks without three tenths of their triangles is 5 to 10 % worse."""

MOSTLY_GIVEN = 0.25
"""If more than this share of the surface is completed, there is a warning."""

CLEAR_WINDING, EVIDENCE_POINTS = 0.9, 1000
"""Winding numbers of faces above the first, or below one minus this, are clear evidence of what is inside. They are
evaluated at as many random points in the box of a solid as the second says."""
MOST_OVERRULED = 0.02
"""If the completion contradicts clear winding numbers at more than this share of those points, there is a warning. Of
570 shapes that were changed a little, the most is 0.01; a bowl that is closed as a hollow ball has 0.04."""

Completing = Literal["lids", "heat", "none"]
Lids = Literal["bent", "flat"]


@dataclass(frozen=True)
class Completion:
    """Options for completing a shape, described at `complete`."""

    completion: Completing = "lids"
    lids: Lids = "bent"
    nested: Nesting = "given"
    as_oriented: bool = False
    keep_overlaps: bool = False
    seal: float | None = None
    smallest: float | None = None

    def __post_init__(self) -> None:
        for name, choices in (("completion", Completing), ("lids", Lids), ("nested", Nesting)):
            chosen(getattr(self, name), choices, name)
        for name in ("as_oriented", "keep_overlaps"):
            flag(getattr(self, name), name)
        for name in ("seal", "smallest"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, positive_number(getattr(self, name), name))


@public_call
def complete(
    shape: ShapeLike | Sequence[ShapeLike],
    *,
    completion: Completing = "lids",
    lids: Lids = "bent",
    as_oriented: bool = False,
    keep_overlaps: bool = False,
    nested: Nesting = "given",
    seal: float | None = None,
    smallest: float | None = None,
    constraint: Constraint | None = None,
    diffusion: float = 1.0,
    progress: Progress | None = None,
) -> Solid:
    """Complete a shape to the solid it represents, broken or not.

    Faces are flipped to be consistent and to face outwards. Parts that enclose a volume are closed by lids, which are
    patches that continue the curvature of the surface around a hole. Points, and loose triangles that scatter around a
    surface, are completed by the signed heat method. Bodies that overlap are united. Open sheets enclose nothing, and
    distance to them is positive on both sides. The result does not depend on where distance is evaluated, nor on
    rotation, position and scale.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh; or several meshes
        A shape, broken or not. Points may lack normals. Like every function that takes shapes, this takes objects of
        trimesh, PyVista, meshio and Open3D and pairs (vertices, faces). A `Solid` is returned unchanged, whatever the
        options.
    completion : {"lids", "heat", "none"}
        Close meshes by lids; or, where there are no faces, by the zero set of φ, the field of the signed heat method
        (Feng & Crane 2024). With "none", nothing is added: all faces are a sheet, and distance is unsigned, as for
        clothes.
    lids : {"bent", "flat"}
        Whether lids continue the curvature of the surface, or are flat, as for half models, ducts and hulls.
    as_oriented : bool
        Whether to keep the orientation of faces and normals. By default they are flipped where needed.
    keep_overlaps : bool
        Whether to keep surfaces that lie inside other bodies. By default they are left out.
    nested : {"given", "cavities", "bodies"}
        Whether closed parts within others are bodies or cavities. With "given", a part is a body if it faces as the
        outermost part around it does, and else a cavity. With "cavities", they are cavities, and parts within these
        are bodies, as in slicers. With "bodies", all are bodies.
    seal : float, optional
        Seal openings of meshes that are narrower than this length, to about a sixth of it, and fill what lies behind
        them. Faces that are not reached from outside through wider openings, such as inner skins, are left out. In the
        units of the shape, as all lengths. By default nothing is sealed.
    smallest : float, optional
        Leave out the connected parts of meshes that fit into a box whose diagonal is shorter than this length. By
        default all parts are used.
    constraint, diffusion : Constraint, float
        Options of the signed heat method, where the shape is completed by it, as for `SignedHeatSolver`. They are the
        constraint on φ at the shape, by default `ZeroSet`, and the factor τ of the diffusion time ``t = τ h²``, by
        default 1, with h the mean distance between unknowns.
    progress : callable, optional
        Called ten times a second as ``progress(fraction, step)`` with the fraction done, from 0 to 1, and the name of
        the step that runs. An exception that it raises cancels.

    Returns
    -------
    Solid
        The completed shape. Its ``diagnostics.notes`` say which faces were flipped, left out and added.

    Raises
    ------
    SourceError
        If no face has an area, all parts are too small, or points have no normals and none are to be fitted.
    ConstraintError
        If the constraint denies that distance is zero on all of the shape.
    MemoryLimitError
        If completing does not fit in memory. Raised before anything is allocated.

    Warns
    -----
    InexactWarning
        If more than a quarter of the surface of a mesh is completed, since it is then a guess. Also if the completion
        contradicts clear winding numbers of the faces.

    See Also
    --------
    Solid : What a shape bounds, closed.
    fill_holes : Close holes, and leave the rest of a mesh as it is.
    orient : Flip faces or curves so that they agree.
    signed_distance : Distance on a grid, on tets or along a surface.

    Examples
    --------
    >>> from signedheat import samples
    >>> ball = samples.without_patches(samples.sphere(3), 3, 0.4)
    >>> solid = complete(ball)
    >>> solid.distance([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]).round(1).tolist()
    [-1.0, 1.0]
    """
    options = Completion(completion, lids, nested, as_oriented, keep_overlaps, seal, smallest)
    return completed(shape, options, Heat(constraint, diffusion))


@one_blas_thread()  # the others would wait busily for long after each of many small products
def completed(shape: ShapeLike | Sequence[ShapeLike], options: Completion, method: Heat) -> Solid:
    """Complete a shape with checked options, see `complete`; return a solid as it is."""
    if isinstance(method.constraint, EachComponent | LevelValues):
        raise ConstraintError(
            f"distance to a shape is zero on all of it, which {method.constraint!r} denies",
            remedy="use SignedHeatSolver.distance",
        )
    if isinstance(shape, Solid):
        return shape
    joined = joined_shape(shape)
    if options.smallest is not None and not isinstance(joined, PointCloud):
        kept = large_parts(joined.triangulation, options.smallest)
        return _completed_instead(joined, *kept, replace(options, smallest=None), method)
    if options.completion == "none":
        return _sheet(joined)
    if options.seal is not None and not isinstance(joined, PointCloud):
        skin = sealed(joined.triangulation, options.seal)
        return _completed_instead(joined, *skin, replace(options, seal=None, as_oriented=True), method)
    count = joined.n_points if isinstance(joined, PointCloud) else joined.triangulation.n_faces
    parts = "points" if isinstance(joined, PointCloud) else "faces"
    refuse_beyond_memory(
        f"completing a shape of {count} {parts}",
        count,
        lambda n: bytes_to_complete(joined, n),
        lambda n: f"simplify it to {n} {parts}, or free memory",
    )
    stopwatch = Stopwatch(2)
    if isinstance(joined, PointCloud):
        with stopwatch("orient"):
            cloud, strays = without_strays(joined)
            notes = list[Note](strays)
            if not options.as_oriented:
                cloud, note = run_cancellable(partial(orient_points, cloud))
                notes.append(note)
        with stopwatch("complete"):
            solid = run_cancellable(partial(_from_points, cloud, method))
    else:
        notes, owners = list[Note](), owners_of(joined)
        as_given: tuple[Solid, ShapeOriented] | None = None
        with stopwatch("orient"):
            if options.completion == "lids":
                as_given = run_cancellable(partial(solid_as_given, joined.triangulation))
            if as_given and as_given[1].cavities and options.nested == "bodies" and not options.as_oriented:
                as_given = None  # the cavities must be flipped
            if as_given is None:
                triangles, cut_from = divided_at_rims(joined.triangulation)
                owners = owners[cut_from]
                chain = run_cancellable(lambda: Chain.of(triangles))
                decided = bounding(chain, options.nested, options.as_oriented)
                if not options.as_oriented:
                    notes = [oriented_as(joined, owners, chain, decided).note]
                if not chain.areas.any():
                    raise SourceError("all faces of the shape have zero area", element="shape")
                chain = replace(chain)  # drops the cached properties that only `bounding` needs
        with stopwatch("complete"):
            if as_given is None:
                solid = run_cancellable(partial(_from_mesh, triangles, chain, decided, options, method))
                solid = _with_whole_boundary(solid, triangles)
            else:
                solid, unchanged = as_given
                notes = [] if options.as_oriented else [unchanged]
            solid = replace(solid, origins=np.where(solid.origins >= 0, owners[solid.origins], -1))
    source = joined if isinstance(joined, TriangleMesh) else None
    diagnostics = Diagnostics(timings=dict(stopwatch.seconds), notes=(*notes, *solid.diagnostics.notes))
    return replace(solid, source=source, diagnostics=diagnostics)


def _sheet(shape: SurfaceShape) -> Solid:
    """Make a solid of all faces of a mesh as a sheet, which bounds nothing."""
    if isinstance(shape, PointCloud):
        raise SourceError(
            "points are no sheet: what lies between them is completed",
            remedy="leave out completion, or take distance to the points by scipy.spatial.cKDTree",
            element="completion",
        )
    mesh, owners = shape.triangulation, owners_of(shape)
    corners = mesh.vertices[mesh.faces]
    used = face_areas(corners) > 0
    if not used.any():
        raise SourceError("all faces of the shape have zero area", element="shape")
    solid = united([TriangleGroup(corners[used], mesh.faces[used], owners[used], closing=False)], True)
    return replace(solid, source=shape if isinstance(shape, TriangleMesh) else None)


def large_parts(mesh: TriangleMesh, smallest: float) -> tuple[TriangleMesh, Ints, SmallParts]:
    """Return the connected parts of a mesh at least `smallest` in size, their (k,) faces, and a note on the others."""
    parts, sizes = parts_by_place(mesh.vertices, mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel())
    small = sizes < smallest
    kept = np.flatnonzero(~small[parts[::3]])
    if not len(kept):
        raise SourceError(
            f"all parts of the shape are smaller than {smallest:g}",
            element="smallest",
            remedy="choose a smaller length",
        )
    left, area = mesh.face_areas[kept].sum(), max(float(mesh.face_areas.sum()), np.finfo(float).tiny)
    note = SmallParts(int(small.sum()), max(0.0, 1.0 - float(left) / area))
    return TriangleMesh(mesh.vertices, mesh.faces[kept]), kept, note


def _completed_instead(
    shape: TriangleMesh | PolygonMesh,
    mesh: TriangleMesh,
    cut_from: Ints,
    note: Note,
    options: Completion,
    method: Heat,
) -> Solid:
    """Complete a mesh made of a shape; `cut_from` are the triangles of the shape that its faces are parts of.

    In the result, source and origins refer to the shape, and `note` comes first in the diagnostics.
    """
    solid = completed(mesh, options, method)
    origins = np.where(solid.origins >= 0, owners_of(shape)[cut_from][solid.origins], -1)
    diagnostics = replace(solid.diagnostics, notes=(note, *solid.diagnostics.notes))
    source = shape if isinstance(shape, TriangleMesh) else None
    return replace(solid, origins=origins, source=source, diagnostics=diagnostics)


def _with_whole_boundary(solid: Solid, mesh: TriangleMesh) -> Solid:
    """Replace the bounding triangles of a solid by ones that are proven to bound it, if they were cut; see `bodies`.

    The solid is returned as it is if no such triangles are found. `mesh` is the mesh that it was made of.
    """
    cut = solid.triangles[solid.bounding]
    if np.array_equal(cut, solid.windings.triangles):
        return solid
    proven = whole_boundary(cut, solid.windings, mesh)
    if proven is None:
        return solid
    # what lies on a face of the mesh is part of it; the rest is completion, as sure as the nearest part of it was
    with_area = np.flatnonzero(face_areas(mesh.vertices[mesh.faces]) > 0)
    tree = FaceTree.of_triangles(mesh.vertices[mesh.faces[with_area]])
    faces, squares = tree.nearest(proven.mean(axis=1))
    is_given = np.sqrt(squares) <= TOLERANCES[-1] * tolerances(*indexed(proven), SAME_POINT)
    origins = np.where(is_given, with_area[tree.features.ids[faces]], -1)
    confidence, was_added = np.ones(len(proven), dtype=np.float32), solid.origins < 0
    if was_added.any() and not is_given.all():
        patches = FaceTree.of_triangles(solid.triangles[was_added])
        nearest = patches.features.ids[patches.nearest(proven[~is_given].mean(axis=1))[0]]
        confidence[~is_given] = solid.confidence[was_added][nearest]
    inner = ~solid.bounding
    return replace(
        solid,
        triangles=np.concatenate([proven, solid.triangles[inner]]),
        origins=np.concatenate([origins, solid.origins[inner]]),
        confidence=np.concatenate([confidence, solid.confidence[inner]]),
        bounding=np.append(np.ones(len(proven), dtype=bool), np.zeros(int(inner.sum()), dtype=bool)),
        windings=Windings(proven),
        uncrossed=False,
    )


def bytes_to_complete(shape: SurfaceShape, count: int) -> float:
    """Estimate the peak memory of completing a shape like this one with `count` faces."""
    if isinstance(shape, PointCloud):
        return BYTES_OF_HEAT + BYTES_PER_COMPLETED_FACE * count
    mesh = shape.triangulation
    if mesh.n_vertices == 3 * mesh.n_faces and mesh.n_faces > 1:
        return BYTES_OF_HEAT + BYTES_PER_LOOSE_FACE * count
    return BYTES_PER_COMPLETED_FACE * count


def _from_mesh(mesh: TriangleMesh, chain: Chain, decided: Bounding, options: Completion, method: Heat) -> Solid:
    """Make the solid of a mesh, as was decided for its chain: heat completes torn bodies, and lids complete others.

    A body is torn if its loose triangles scatter, or if little of it is left. With the option "heat", all faces are one
    torn body.
    """
    vertices = mesh.vertices
    counts = np.abs(decided.counts)
    faces = np.where((decided.counts < 0)[:, None], chain.faces[:, ::-1], chain.faces)
    torn, surfaces, notes = np.zeros(len(faces), dtype=bool), list[TriangleGroup](), list[Note]()
    by_heat = options.completion == "heat"
    clusters = np.zeros(len(faces), dtype=np.int64) if by_heat else decided.loose
    for cluster in np.unique(clusters[(clusters >= 0) & (counts > 0)]):
        chosen = np.flatnonzero((clusters == cluster) & (counts > 0))
        # φ replaces triangles that scatter; where heat is asked for, it only fills what they leave open
        scatter = 0.0 if by_heat else scatter_of(vertices[faces[chosen]], decided.pieces[chosen])
        if by_heat or scatter or decided.levels[chosen[0]] < TORN_LEVEL:
            torn[chosen] = True
            surfaces += _completed_by_heat(vertices, faces[chosen], chain.firsts[chosen], scatter, method)
    lids = None
    bounds = np.repeat(np.arange(len(faces)), np.where(torn, 0, counts))  # a face that bounds twice is taken twice
    if len(bounds):
        closed, notes = _closed_by_lids(vertices, faces[bounds], chain.firsts[bounds], options.lids == "bent")
        surfaces.append(closed)
        lids = None if torn.any() else closed.triangles[closed.origins < 0]
    sheets = np.flatnonzero(counts == 0)
    if len(sheets):
        surfaces.append(TriangleGroup(vertices[faces[sheets]], faces[sheets], chain.firsts[sheets], closing=False))
    solid = united(surfaces, options.keep_overlaps, notes)
    _warn_of_guesses(solid, lids)
    return solid


def _warn_of_guesses(solid: Solid, lids: Floats | None) -> None:
    """Warn if much of a solid is completed, or if its (m, 3, 3) `lids` overrule the winding numbers of its faces.

    These are None if heat completed the solid, since winding numbers tell little about torn bodies.
    """
    for note in solid.diagnostics.notes:
        if not isinstance(note, CompletedArea):
            continue
        if note.completed_share > MOSTLY_GIVEN:
            warn_user(f"{note}: where so much is missing, the result is a guess", InexactWarning)
        elif lids is not None and overruled(solid, lids) > MOST_OVERRULED:
            warn_user(f'{note}, against the winding numbers of its faces: try lids="flat"', InexactWarning)


def overruled(solid: Solid, lids: Floats) -> float:
    """Return the share of the box of a solid in which winding numbers of its faces clearly contradict it.

    They are those of the solid less those of its (m, 3, 3) lids.
    """
    lower, upper = solid.bounds
    points = lower + np.random.default_rng(0).random((EVIDENCE_POINTS, 3)) * (upper - lower)
    numbers = solid.windings.numbers(points)
    of_faces = numbers - WindingTree.of(lids).numbers(points)
    contradicts = np.where(numbers > INSIDE_WINDING, of_faces < 1 - CLEAR_WINDING, of_faces > CLEAR_WINDING)
    return float(contradicts.mean())


def _closed_by_lids(vertices: Floats, faces: Ints, origins: Ints, bent: bool) -> tuple[TriangleGroup, list[Note]]:
    """Close (m, 3) faces with (m,) origins by lids; return all triangles, and a note if small holes were filled."""
    lost = small_lids(vertices, faces, bent)
    restored = np.concatenate([faces, lost])
    vertices_with_new, added = closed_by(vertices, restored, bent=bent)
    surface = _closed_group(vertices_with_new, restored, added, origins)
    if not len(lost):
        return surface, []
    area_lost, area_given = (float(face_areas(vertices[part]).sum()) for part in (lost, faces))
    return surface, [FacesRestored(len(lost), area_lost / (area_lost + area_given))]


def _closed_group(vertices: Floats, faces: Ints, added: Ints, origins: Ints) -> TriangleGroup:
    """Make a closed surface of (m, 3) faces and (j, 3) added ones, whose triangles count in the winding number.

    `origins`, (k,), are the given faces that the first k faces are part of. All other faces have the origin −1.
    """
    whole = np.concatenate([faces, added])
    return TriangleGroup(vertices[whole], whole, np.append(origins, np.full(len(whole) - len(origins), -1)), True)


def _completed_by_heat(
    vertices: Floats, faces: Ints, origins: Ints, scatter: float, method: Heat
) -> list[TriangleGroup]:
    """Complete a torn body by the zero set of φ.

    It replaces the faces if they scatter; `scatter` is their distance from a surface, or 0 if they do not. Otherwise it
    is used away from the (m, 3) faces, which keep their origins.
    """
    triangles = vertices[faces]
    given = TriangleGroup(triangles, faces, origins, False)
    zero_set = heat_surface(TriangleMesh(*indexed(triangles)), method, scatter)
    if zero_set is None:
        return [given]
    if scatter:
        return [TriangleGroup.made(zero_set[0][zero_set[1]])]
    tree = FaceTree.of_triangles(triangles)
    patches = zero_set[0][zero_set[1]]
    cell = float(np.median(np.linalg.norm(patches[:, 1] - patches[:, 0], axis=1)))
    is_away = tree.distances(patches.mean(axis=1)) > ZERO_SET_FACES * cell
    if not len(boundary(faces)):
        return [replace(given, closing=True)]
    all_vertices = np.concatenate([vertices, zero_set[0]])
    others = zero_set[1][is_away] + len(vertices)
    points, joins = seam_triangles(all_vertices, faces, others, cell)
    all_vertices, whole = np.concatenate([all_vertices, points]), np.concatenate([faces, others, joins])
    whole = np.concatenate([whole, small_gaps(all_vertices, whole)])
    all_vertices, added = closed_by(all_vertices, whole)
    return [_closed_group(all_vertices, whole, added, origins)]


def scatter_of(triangles: Floats, labels: Ints) -> float:
    """Return the median distance between corners of (m, 3, 3) triangles that noise has separated; 0 if most are not.

    `labels` are the pieces of the triangles. The distance is at least the size of the faces over `CELLS_PER_FACE`,
    since finer cells would not show more of them.
    """
    points = triangles.reshape(-1, 3)
    owners = np.repeat(labels, 3)
    near, neighbours = PointTree(points).query(points, min(8, len(points)))
    others = owners[neighbours] != owners[:, None]
    nearest = np.where(others, near, np.inf).min(axis=1)
    sizes = np.repeat(np.sqrt(face_areas(triangles)), 3)
    moved = (nearest > 0) & (nearest < NOISE_REACH * sizes)
    if moved.mean() <= 0.5:
        return 0.0
    return max(float(np.median(nearest[moved])), float(np.median(sizes[moved])) / CELLS_PER_FACE)


def _from_points(cloud: PointCloud, method: Heat) -> Solid:
    """Make the solid that oriented points sample; if they bound nothing, each becomes a small triangle of a sheet."""
    if cloud.normals is None:
        raise SourceError(
            "the point cloud has no normals, which are needed to tell inside from outside", remedy="give it normals"
        )
    gap = mean_gap(np.asarray(cloud.points))
    zero_set = heat_surface(cloud, method, gap / CELLS_PER_POINT_GAP)
    if zero_set is not None:
        return united([TriangleGroup.made(zero_set[0][zero_set[1]])], True, points=cloud.points)
    first, second = axes_across(cloud.normals)
    cosines_and_sines = np.stack([np.cos(2 * np.pi * np.arange(3) / 3), np.sin(2 * np.pi * np.arange(3) / 3)], axis=1)
    directions = cosines_and_sines[:, :1] * first[:, None] + cosines_and_sines[:, 1:] * second[:, None]
    return united(
        [TriangleGroup.made(cloud.points[:, None] + 0.25 * gap * directions, False)], True, points=cloud.points
    )
