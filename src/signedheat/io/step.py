"""STEP, what CAD writes: triangles of its faces, and which face each is part of, by Open CASCADE."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..geometry.welding import welded
from ..packages import lazy_module
from .files import PathLike, contents

messages = lazy_module("OCP.Message", ".step files")
control = lazy_module("OCP.STEPControl", ".step files")
selected = lazy_module("OCP.IFSelect", ".step files")
mesher = lazy_module("OCP.BRepMesh", ".step files")
topology = lazy_module("OCP.TopAbs", ".step files")
explorer = lazy_module("OCP.TopExp", ".step files")
casts = lazy_module("OCP.TopoDS", ".step files")
tools = lazy_module("OCP.BRep", ".step files")
places = lazy_module("OCP.TopLoc", ".step files")
boxes = lazy_module("OCP.Bnd", ".step files")
bounding = lazy_module("OCP.BRepBndLib", ".step files")

FINENESS = 1e-3
"""Distance of triangles from the surface, over the diagonal of the box around it, if nothing else is said."""
ANGLE = 0.3
"""Radians between neighbouring triangles of curved faces, about: 20 of them around a cylinder."""
SEAM = 1e-6
"""Distance over the diagonal within which corners of neighbouring faces are one: Open CASCADE's own precision."""


def read_step(path: PathLike, deflection: float | None = None) -> tuple[TriangleMesh, NDArray[np.int64]]:
    """Triangles of a ``.step`` or ``.stp`` file, and the number of the CAD face that each is part of.

    `Closest.faces` are triangles: the second array, taken at them, tells on which CAD face the nearest place lies.

    Parameters
    ----------
    path : str or path
        The file.
    deflection : float, optional
        How far triangles may be off curved faces, in millimetres: by default a thousandth of the diagonal.

    Returns
    -------
    mesh : TriangleMesh
        In millimetres, whatever the units of the file; its faces face outwards, as those of the CAD solid.
    cad_faces : (m,) int
        Faces are numbered from 0 in the order of the file.

    Raises
    ------
    FileFormatError
        If the file cannot be read, or has no surface.
    MissingPackageError
        If Open CASCADE (cadquery-ocp) is not installed.
    """
    shape = _shape(path)
    box = boxes.Bnd_Box()
    bounding.BRepBndLib.Add_s(shape, box)
    if box.IsVoid():
        raise FileFormatError("it has no surface", path=path)
    diagonal = float(np.sqrt(box.SquareExtent()))
    mesher.BRepMesh_IncrementalMesh(shape, deflection or FINENESS * diagonal, False, ANGLE, False)
    vertices, faces, owners, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [], 0
    as_face = getattr(casts.TopoDS, "Face_s", None) or casts.TopoDS.Face  # its name until version 8
    walk = explorer.TopExp_Explorer(shape, topology.TopAbs_ShapeEnum.TopAbs_FACE)
    while walk.More():
        points, triangles = _triangles(as_face(walk.Current()))
        vertices.append(points)
        faces.append(triangles + sum(map(len, vertices[:-1])))
        owners.append(np.full(len(triangles), count))
        count += 1
        walk.Next()
    if not sum(map(len, owners)):
        raise FileFormatError("it has no surface", path=path)
    all_points = np.concatenate(vertices)
    names = welded(all_points, SEAM * diagonal)
    kept, numbers = np.unique(names, return_inverse=True)
    return TriangleMesh(all_points[kept], numbers.ravel()[np.concatenate(faces)]), np.concatenate(owners)


def step_mesh(path: PathLike) -> TriangleMesh:
    """The triangles alone."""
    return read_step(path)[0]


def _shape(path: PathLike) -> Any:
    contents(path)  # which says why a file cannot be read
    printer = messages.Message_PrinterOStream.get_type_descriptor_s()
    messages.Message.DefaultMessenger_s().RemovePrinters(printer)  # which writes to standard output
    reader = control.STEPControl_Reader()
    status = reader.ReadFile(str(Path(path)))
    if status != selected.IFSelect_ReturnStatus.IFSelect_RetDone or not reader.TransferRoots():
        raise FileFormatError("Open CASCADE cannot read it, or it has no solid", remedy="export it again", path=path)
    return reader.OneShape()


def _triangles(face: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners and triangles of a face, counterclockwise from outside."""
    place = places.TopLoc_Location()
    found = tools.BRep_Tool.Triangulation_s(face, place)
    if found is None:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    moved = place.Transformation()
    nodes = (found.Node(k).Transformed(moved) for k in range(1, found.NbNodes() + 1))
    points = np.array([(node.X(), node.Y(), node.Z()) for node in nodes])
    rows = (found.Triangle(k) for k in range(1, found.NbTriangles() + 1))
    triangles = np.array([[row.Value(1), row.Value(2), row.Value(3)] for row in rows], dtype=np.int64) - 1
    if face.Orientation() == topology.TopAbs_Orientation.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return points, triangles
