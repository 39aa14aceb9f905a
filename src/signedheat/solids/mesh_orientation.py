"""Orient meshes and curves: faces consistently and outwards, and curves so that they bound a region together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, cast, overload

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Frozen, Ints, ShortRepr
from ..curves.stroke_directions import CurveOrientation, curve_orientation
from ..diagnostics import ShapeOriented
from ..errors import GeometryError
from ..mesh.components import first_members
from ..shapes.foreign import ForeignShape, converted
from ..shapes.kinds import SurfaceDomain
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface_curves import CurveOrPoints, CurvesAndPoints, ElementList
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import chosen, public_call
from .bounding import Bounding, bounding
from .chain import Chain
from .overlaps import Nesting

Mesh = TriangleMesh | PolygonMesh


@dataclass(frozen=True, eq=False, repr=False)
class Orientation(Frozen, ShortRepr):
    """An oriented mesh, and how it differs from the given one.

    Attributes
    ----------
    shape : TriangleMesh or PolygonMesh
        The oriented mesh, on the same vertices.
    faces : (k,) int
        Faces of the given mesh that were kept, in order.
    turned : (k,) bool
        Which of them were flipped.
    parts : (k,) int
        Patch of each face: connected across edges of two faces, or closed as given. −1 for faces on fewer than three
        distinct points, and for inner walls.
    undecided : (k,) bool
        Faces of sheets, which bound nothing. They are consistent with their neighbours.
    inner : (k,) bool
        Inner walls, which divide a solid into closed cells, so that there is solid on both sides. They are left as
        they are.
    n_parts, closed_parts : int
        Number of patches, and of closed ones among them.
    turned_parts, turned_faces, turned_area : int, int, float
        Number of patches of which more than half the area was flipped, sheets apart, number of flipped faces, and their
        share of the area.
    inconsistent_edges : int
        Number of edges whose two faces were oriented inconsistently.
    nonmanifold_edges : int
        Number of edges of three or more faces, across which patches are not connected.
    nonorientable_parts : int
        Number of patches that cannot be oriented consistently, such as Möbius bands. They are left as they are.
    undecided_parts, undecided_area : int, float
        Number of patches that bound nothing, and their share of the area.
    merged_faces : int
        Number of duplicate faces, which were left out.
    nested_bodies, cavities : int
        Number of closed patches within others that are bodies, and of those that bound cavities.

    See Also
    --------
    orientation : Orient a mesh, and report what was flipped.
    orient : Flip faces or curves so that they agree.

    Examples
    --------
    >>> from signedheat import samples
    >>> found = orientation(samples.with_flipped_faces(samples.sphere(2), 0.1))
    >>> found.turned_faces, found.inconsistent_edges, found.n_parts
    (33, 89, 1)
    """

    shape: Mesh
    faces: Ints
    turned: Bools
    parts: Ints
    undecided: Bools
    inner: Bools
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
    nested_bodies: int
    cavities: int

    @property
    def summary(self) -> dict[str, int | float]:
        """All counts, and shares of the area from 0 to 1, by name: the attributes from `n_parts` to `cavities`."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, (int, float))}

    @property
    def note(self) -> ShapeOriented:
        """A note for diagnostics with these counts and shares."""
        return ShapeOriented(**{entry.name: getattr(self, entry.name) for entry in fields(ShapeOriented)})


@overload
def orientation(shape: Mesh | ForeignShape, *, nested: Nesting = "given") -> Orientation: ...
@overload
def orientation(
    shape: CurvesAndPoints | ElementList | Sequence[ElementList], domain: SurfaceDomain | ForeignShape
) -> CurveOrientation: ...
@public_call
def orientation(
    shape: Mesh | ForeignShape | CurvesAndPoints | ElementList | Sequence[ElementList],
    domain: SurfaceDomain | ForeignShape | None = None,
    *,
    nested: Nesting = "given",
) -> Orientation | CurveOrientation:
    """Orient a mesh, or curves on a surface, and report which faces or curves were flipped, merged and left out.

    Faces that bound a solid face out of it. So bodies face outwards, and cavities, whose normals point into the hollow,
    inwards. Vertices that coincide up to rounding count as one, and so do faces on the same corners. A closed part
    whose faces are consistent is kept or flipped as a whole. Other faces are made consistent with their neighbours
    across edges of two faces, and the winding number of all faces decides which way each connected patch of them faces.
    Sheets, which enclose nothing, are only made consistent. Walls between the closed cells of a solid are not flipped;
    the attribute `inner` of the result marks them.

    Curves are flipped so that they bound a region together. Where they leave gaps, it is the region with the shortest
    boundary.

    Meshes of n faces take O(n log n) time.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or a sequence of Curve and SurfacePoints
        Any mesh, however broken; or broken curves on a surface.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that the curves lie on.
    nested : {"given", "cavities", "bodies"}
        For meshes: whether closed parts within others are bodies, which face outwards, or cavities, which face inwards.
        With "given", a part is a body if it faces as the outermost part around it does, and else a cavity. With
        "cavities", they are cavities, and parts within these are bodies. With "bodies", all are bodies.

    Returns
    -------
    Orientation or CurveOrientation
        For a mesh, `results.Orientation`: the oriented mesh, which of its faces were flipped, how many were merged or
        are sheets or inner walls, and the number of bodies and cavities within others. For curves on a surface,
        `results.CurveOrientation`: the oriented curves, which of them were flipped, and how well the region explains
        each.

    Raises
    ------
    GeometryError
        If the shape is no mesh, and no domain is given.
    SourceError
        If a curve does not fit the domain.

    See Also
    --------
    orient : Flip faces or curves so that they agree.
    results.Orientation : How a mesh was oriented.
    results.CurveOrientation : How curves were oriented.
    complete : Make a solid of a broken shape.

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
    if domain is not None:
        return curve_orientation(cast("CurvesAndPoints", shape), domain)
    chosen(nested, Nesting, "nested")
    shape = converted(shape)
    if not isinstance(shape, TriangleMesh | PolygonMesh):
        kind = type(shape).__name__
        raise GeometryError(f"a {kind} has no faces to orient", remedy="pass a TriangleMesh or PolygonMesh")
    chain = Chain.of(shape.triangulation)
    return oriented_as(shape, owners_of(shape), chain, bounding(chain, nested))


def oriented_as(shape: Mesh, owners: Ints, chain: Chain, decided: Bounding) -> Orientation:
    """Orient a mesh as decided for its chain; `owners` are the (m,) faces that its triangles are part of."""
    n = int(owners.max()) + 1
    proper = chain.numbers >= 0

    def given(values: NDArray[Any], without: float) -> NDArray[Any]:
        """(m,) values of the chain's distinct triangles at the given ones; `without` at those that it lacks."""
        return np.append(values, np.array(without, dtype=values.dtype))[chain.numbers]

    areas, as_given, inside = given(chain.areas, 0), given(decided.as_given, 0), given(decided.inner, 0)

    def most(mask: Bools) -> Bools:
        """(n,) whether more than half of the area of each face is in an (m,) mask of triangles."""
        return np.bincount(owners, np.where(mask, areas, -areas), n) > 0

    first = first_members(owners, n)
    turned, whole = most(decided.to_turn(chain)), most(as_given)
    # of copies, one that need not turn is kept; of what is closed as given, all are
    group = np.where(proper[first] & ~whole, chain.numbers[first], len(chain.faces) + np.arange(n))
    order = np.lexsort((turned, group))
    kept = np.sort(order[np.append(True, np.diff(group[order]) != 0)])
    pieces = np.where(inside, -1, given(decided.pieces, -1))[first][kept]
    sheet = most(proper & (given(decided.counts, 0) == 0) & ~as_given)[kept]
    turned, inner = turned[kept], most(inside)[kept]
    sheet &= ~inner & (pieces >= 0)
    weights = np.bincount(owners, areas, n)[kept]
    total = max(float(weights.sum()), np.finfo(float).tiny)
    part_ids, labels = np.unique(pieces[pieces >= 0], return_inverse=True)
    own, mass = pieces >= 0, weights[pieces >= 0]
    inwards = np.bincount(labels, np.where(turned[own], mass, -mass), len(part_ids)) > 0
    closing = np.zeros(len(decided.orientable), dtype=bool)
    closing[decided.pieces] = decided.closed
    idle = np.bincount(labels, sheet[own], len(part_ids)) > 0
    return Orientation(
        shape=_flipped_mesh(shape, kept, turned),
        faces=kept,
        turned=turned,
        parts=pieces,
        undecided=sheet,
        inner=inner,
        n_parts=len(part_ids),
        closed_parts=int(closing[part_ids].sum()),
        turned_parts=int((inwards & ~idle).sum()),
        turned_faces=int(turned.sum()),
        turned_area=float(weights[turned].sum()) / total,
        inconsistent_edges=decided.disagreeing,
        nonmanifold_edges=int((chain.edges.face_counts > 2).sum()),
        nonorientable_parts=int((~decided.orientable[part_ids]).sum()),
        undecided_parts=int(idle.sum()),
        undecided_area=float(weights[sheet].sum()) / total,
        merged_faces=n - len(kept),
        nested_bodies=decided.bodies,
        cavities=decided.cavities,
    )


def owners_of(shape: Mesh) -> Ints:
    """(m,) face of the mesh that each triangle is part of."""
    return shape.refinement.face_polygons if isinstance(shape, PolygonMesh) else np.arange(shape.n_faces)


def _flipped_mesh(shape: Mesh, kept: Ints, flipped: Bools) -> Mesh:
    """Return a mesh of the (k,) kept faces, those that are `flipped`, (k,), reversed; `shape` if nothing changes."""
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


@overload
def orient(shape: Mesh | ForeignShape) -> Mesh: ...
@overload
def orient(shape: Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape) -> list[CurveOrPoints]: ...
@public_call
def orient(
    shape: Mesh | ForeignShape | Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape | None = None
) -> Mesh | list[CurveOrPoints]:
    """Flip faces of a mesh so that all are consistent and face out of the solid, or curves so that they bound a region.

    Bodies face outwards and cavities inwards; sheets, which enclose nothing, are only made consistent. `orientation`
    also reports what was flipped.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or a sequence of Curve and SurfacePoints
        Any mesh, or broken curves.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that the curves lie on.

    Returns
    -------
    TriangleMesh, PolygonMesh or list of Curve and SurfacePoints
        The oriented mesh, on the same vertices; or the oriented curves, in their order.

    Raises
    ------
    GeometryError
        If the shape is no mesh, and no domain is given.
    SourceError
        If a curve does not fit the domain.

    See Also
    --------
    orientation : Orient a mesh or curves, and report what was flipped.
    complete : Make a solid of a broken shape.
    fill_holes : Close holes, and leave the rest of a mesh as it is.

    Examples
    --------
    >>> from signedheat import samples
    >>> sphere = samples.with_flipped_faces(samples.sphere(3), 0.4)
    >>> bool((orient(sphere).faces == samples.sphere(3).faces).all())
    True

    Of four quarters of a loop round a torus, one that runs backwards.

    >>> import numpy as np
    >>> mesh = samples.torus(n_around=48, n_across=24)
    >>> pieces = [mesh.path(24 * np.arange(begin, begin + 9)) for begin in (0, 12, 24, 36)]
    >>> pieces[1] = pieces[1].reversed()
    >>> [bool(piece.faces[0] == given.faces[0]) for piece, given in zip(orient(pieces, mesh), pieces)]
    [True, False, True, True]
    """
    if domain is None:
        return orientation(cast("Mesh | ForeignShape", shape)).shape
    return curve_orientation(cast("Sequence[CurveOrPoints]", shape), domain).curves


def agreeing_faces(mesh: TriangleMesh) -> Ints:
    """(m, 3) faces of a mesh, oriented consistently in components that can be, on the first vertex at each position."""
    chain, faces = Chain.of(mesh), mesh.faces.copy()
    flipped = chain.agreeing(np.ones(len(chain.faces), dtype=bool)).turned
    proper = chain.numbers >= 0
    faces[proper] = np.where(flipped[:, None], chain.faces[:, ::-1], chain.faces)[chain.numbers[proper]]
    return faces
