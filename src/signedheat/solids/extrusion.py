"""Solids between a sheet, or outlines in the plane, and a plane across z."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ..arrays import Floats, Ints
from ..errors import GeometryError
from ..grids.polyline import Polyline
from ..mesh.edges import edge_table
from ..mesh.polylines import filled_outlines
from ..mesh.triangles import face_areas, part_volumes
from ..packages import lazy_module
from ..shapes.foreign import as_shapes
from ..shapes.kinds import Polylines, Shapes
from ..shapes.transforms import joined_shape
from ..surfaces.point_cloud import PointCloud
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import finite_number, public_call
from .mesh_orientation import agreeing_faces
from .rims import boundary

manifold3d: Any = lazy_module("manifold3d", "triangles of outlines")


@public_call
def extrude(shape: Shapes | Polylines, to: float) -> TriangleMesh:
    """Extrude a sheet, or outlines in the plane, along z to a plane, as a closed mesh with upright walls.

    Terrain and reliefs get a base below them or above. Outlines lie at z = 0, and holes run the other way round, as in
    polygons. Faces of a sheet are kept as they are.

    Parameters
    ----------
    shape : open surface; or closed Polyline, several, or polygons of shapely or GeoJSON
        The sheet or the outlines.
    to : float
        Height z of the plane, in the units of the shape.

    Returns
    -------
    TriangleMesh
        Closed, facing outwards. Where a sheet overhangs, walls may pass through it; `complete` then makes one body.

    Raises
    ------
    GeometryError
        If a surface is closed, or reaches the plane; or outlines are open or bound nothing.

    See Also
    --------
    morphology.thicken : Give a sheet a thickness.
    fill_holes : Close holes, and leave the rest of a mesh as it is.

    Examples
    --------
    >>> from signedheat import Polyline, TriangleMesh
    >>> plate = [[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [1, 2], [2, 2], [2, 1]]
    >>> round(extrude([Polyline(line, closed=True) for line in plate], 2.0).volume, 9)
    30.0
    >>> roof = TriangleMesh([[0, 0, 1], [1, 0, 1], [1, 1, 2], [0, 1, 2]], [[0, 1, 2], [0, 2, 3]])
    >>> round(extrude(roof, 0.0).volume, 9)
    1.5
    """
    height = finite_number(to, "to")
    parts = as_shapes(shape)
    lines = [part for part in parts if isinstance(part, Polyline)]
    if lines and len(lines) == len(parts):
        vertices, faces = _filled(lines)
    else:
        vertices, faces = _sheet(joined_shape(cast("Shapes", shape)), height)
    n, rim = len(vertices), boundary(faces)
    tails, heads = rim.T
    foot = vertices.copy()
    foot[:, 2] = height
    walls = [np.stack(corners, axis=1) for corners in ((tails, heads, heads + n), (tails, heads + n, tails + n))]
    closed = np.concatenate([faces, faces[:, ::-1] + n, *walls])
    both = np.concatenate([vertices, foot])
    if float(part_volumes(both, closed)[1].sum()) < 0:
        closed = closed[:, ::-1]
    used, closed = np.unique(closed, return_inverse=True)
    return TriangleMesh(both[used], closed.reshape(-1, 3))


def _filled(lines: list[Polyline]) -> tuple[Floats, Ints]:
    """Triangulate the region that closed lines bound: (n, 3) points at z = 0, and (m, 3) faces."""
    for number, line in enumerate(lines):
        if not line.closed:
            raise GeometryError(f"polyline {number} is open", remedy="close it", element=f"polyline {number}")
    outlines = [outline[::-1] for outline in filled_outlines([line.points for line in lines], "nonzero")]
    if not outlines:
        raise GeometryError("the outlines bound nothing", remedy="check their points", element="polyline 0")
    points = np.concatenate(outlines)
    size = float(np.ptp(points, axis=0).max())
    scaled = [(outline - points.mean(axis=0)) / size for outline in outlines]
    return np.pad(points, ((0, 0), (0, 1))), np.asarray(manifold3d.triangulate(scaled), dtype=np.int64)


def _sheet(shape: Any, height: float) -> tuple[Floats, Ints]:
    """Return (n, 3) vertices and (m, 3) consistently oriented faces of an open surface.

    Raise if it is closed, or reaches the plane z = `height`.
    """
    if isinstance(shape, PointCloud):
        raise GeometryError("points are no sheet", remedy="make a surface of them first", element="shape")
    mesh = shape.triangulation.joined
    faces = mesh.faces[(face_areas(mesh.vertices[mesh.faces]) > 0)]
    heights = mesh.vertices[np.unique(faces), 2] - height
    if not len(heights) or (heights.min() <= 0 <= heights.max()):
        raise GeometryError(
            f"the sheet reaches the plane z = {height:g}",
            remedy="choose a plane below or above all of it",
            element="to",
        )
    if not (edge_table(faces).face_counts == 1).any():
        raise GeometryError("the surface is closed, and no sheet", remedy="extrude a part of it", element="shape")
    return mesh.vertices, agreeing_faces(TriangleMesh(mesh.vertices, faces))
