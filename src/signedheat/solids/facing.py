"""Orientation in one function: of meshes in space, and of the pieces of broken curves on surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast, overload

import numpy as np

from ..arrays import Ints
from ..curves.piece_orientation import curve_orientation
from ..foreign import ForeignShape
from ..kinds import SurfaceDomain
from ..memory import within_memory
from ..mesh.edges import orient_faces, pair_halfedges
from ..mesh.triangles import face_areas
from ..mesh.welding import welded_vertices
from ..surfaces.surface_curves import CurveOrPoints
from ..surfaces.triangle_mesh import TriangleMesh
from .mesh_orientation import Mesh, orientation


@overload
def orient(shape: Mesh | ForeignShape) -> Mesh: ...
@overload
def orient(shape: Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape) -> list[CurveOrPoints]: ...
@within_memory
def orient(
    shape: Mesh | ForeignShape | Sequence[CurveOrPoints], domain: SurfaceDomain | ForeignShape | None = None
) -> Mesh | list[CurveOrPoints]:
    """Turn the faces of a mesh so that neighbours agree and every part points outwards; or curves so that they agree.

    See `orientation` and `curve_orientation`, which also say what was turned.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh or a sequence of Curve and SurfacePoints
        Any mesh, or the pieces of broken curves.
    domain : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface or IntrinsicTriangulation
        The surface that the curves lie on.

    Raises
    ------
    GeometryError
        If the shape is no mesh, and no domain is given.
    SourceError
        If a curve does not fit the domain.

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
    """(m, 3) faces, turned where most of the area of their component faces the other way."""
    heads = np.roll(mesh.faces, -1, axis=1).ravel()
    ids = welded_vertices(mesh.vertices, mesh.faces.ravel(), heads)
    tails, owners = ids[mesh.faces.ravel()], np.repeat(np.arange(mesh.n_faces), 3)
    pairs = pair_halfedges(tails, ids[heads], mesh.n_vertices)
    turned = orient_faces(pairs, tails, owners, face_areas(mesh.vertices[mesh.faces])).turned
    faces = tails.reshape(-1, 3)
    return np.where(turned[:, None], faces[:, ::-1], faces)
