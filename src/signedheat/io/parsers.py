"""Parsers of other packages, which `sandbox` runs in a separate process because untrusted files may crash them.

This file is run as a program that does not import this package, to start quickly. Each function takes the path of a
file, and returns arrays of numbers and other values that JSON can hold.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import sys
import warnings
from typing import Any

import numpy as np

NEW_NETWORK, NEW_USER = 0x40000000, 0x10000000
"""Linux flags for a network namespace without interfaces, and for the user namespace that permits it."""
FORBIDDEN = ("socket.", "subprocess.", "os.exec", "os.fork", "os.posix_spawn", "os.spawn", "os.system", "urllib.")
"""Beginnings of the names of Python's audit events that are refused."""


class Refused(Exception):
    """Raised with a cause and a remedy for a file without usable contents."""


def las(path: str) -> dict[str, Any]:
    """Read the points of a LAS or LAZ file."""
    sys.modules["requests"] = None  # type: ignore[assignment]  # so that laspy cannot fetch files
    import laspy

    if path.lower().endswith(".laz") and not laspy.LazBackend.detect_available():
        raise ModuleNotFoundError("lazrs", name="lazrs")
    with laspy.open(path) as file:
        return {"points": np.array(file.read().xyz, dtype=np.float64)}


def e57(path: str) -> dict[str, Any]:
    """Read the points of all scans of an E57 file in the coordinates of the file, which are common to the scans."""
    import pye57

    file = pye57.E57(path)
    scans = [file.read_scan(k, ignore_missing_fields=True) for k in range(file.scan_count)]
    points = [np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1) for scan in scans]
    return {"points": np.concatenate([np.zeros((0, 3)), *points])}


def step(path: str, deflection: float | None, fineness: float, angle: float) -> dict[str, Any]:
    """Triangulate the CAD faces of a STEP file, one after another.

    Parameters
    ----------
    path : str
        The file.
    deflection : float or None
        How far triangles may be off curved faces, in millimetres; by default `fineness` times the diagonal of the box
        around the shape.
    fineness : float
        The default of `deflection`, relative to the diagonal.
    angle : float
        Largest angle between neighbouring triangles of curved faces, in radians.

    Returns
    -------
    dict
        The (n, 3) ``points``, the (m, 3) ``triangles``, whose vertex ids count from 0 in each CAD face,
        ``point_counts`` and ``triangle_counts`` of each CAD face, and the ``diagonal`` of the box.
    """
    from OCP import Bnd, BRep, BRepBndLib, BRepMesh, IFSelect, Message, STEPControl, TopAbs, TopExp, TopLoc, TopoDS

    printer = Message.Message_PrinterOStream.get_type_descriptor_s()
    Message.Message.DefaultMessenger_s().RemovePrinters(printer)
    reader = STEPControl.STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect.IFSelect_ReturnStatus.IFSelect_RetDone or not reader.TransferRoots():
        raise Refused("Open CASCADE cannot read it, or it has no solid", "export it again")
    shape, box = reader.OneShape(), Bnd.Bnd_Box()
    BRepBndLib.BRepBndLib.Add_s(shape, box)
    if box.IsVoid():
        raise Refused("it has no surface", "export it again")
    diagonal = float(np.sqrt(box.SquareExtent()))
    BRepMesh.BRepMesh_IncrementalMesh(shape, deflection or fineness * diagonal, False, angle, False)
    as_face = getattr(TopoDS.TopoDS, "Face_s", None) or TopoDS.TopoDS.Face  # its name until version 8
    walk = TopExp.TopExp_Explorer(shape, TopAbs.TopAbs_ShapeEnum.TopAbs_FACE)
    points, triangles = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
    while walk.More():
        face, location = as_face(walk.Current()), TopLoc.TopLoc_Location()
        mesh = BRep.BRep_Tool.Triangulation_s(face, location)
        n_points, n_triangles = (0, 0) if mesh is None else (mesh.NbNodes(), mesh.NbTriangles())
        move = location.Transformation()
        nodes = (mesh.Node(k).Transformed(move) for k in range(1, n_points + 1))
        points.append(np.array([(node.X(), node.Y(), node.Z()) for node in nodes]).reshape(-1, 3))
        rows = (mesh.Triangle(k) for k in range(1, n_triangles + 1))
        corners = np.array([[row.Value(1), row.Value(2), row.Value(3)] for row in rows], dtype=np.int64).reshape(-1, 3)
        is_reversed = face.Orientation() == TopAbs.TopAbs_Orientation.TopAbs_REVERSED
        triangles.append((corners[:, ::-1] if is_reversed else corners) - 1)
        walk.Next()
    return {
        "points": np.concatenate(points),
        "triangles": np.concatenate(triangles),
        "point_counts": np.array([len(part) for part in points[1:]], dtype=np.int64),
        "triangle_counts": np.array([len(part) for part in triangles[1:]], dtype=np.int64),
        "diagonal": diagonal,
    }


def dae(path: str) -> dict[str, Any]:
    """Read the triangles of a COLLADA scene, placed by its nodes."""
    import trimesh

    with open(path, "rb") as file:
        scene = trimesh.load_scene(file, file_type="dae", process=False)
    bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh)]
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies)])[: len(bodies)]
    faces = [np.asarray(body.faces, dtype=np.int64) + start for body, start in zip(bodies, starts, strict=True)]
    return {
        "points": np.concatenate([np.zeros((0, 3)), *(np.asarray(body.vertices) for body in bodies)]),
        "triangles": np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]),
    }


def cells(path: str, module: str) -> dict[str, Any]:
    """Read points, cells and values at the points by one of meshio's modules.

    Blocks of cells are named ``"cells 0"``, ``"cells 1"``, …, with their kinds in ``"kinds"``.
    Values are named ``"values 0"``, …, with their names in ``"names"``.
    """
    from importlib import import_module

    if module == "gmsh":
        refuse_nodes_before_the_first()
    mesh = import_module(f"meshio.{module}").read(path)
    values = {name: np.asarray(column) for name, column in mesh.point_data.items()}
    values = {name: column for name, column in values.items() if column.dtype.kind in "biuf"}
    result = {"points": np.asarray(mesh.points, dtype=np.float64), "kinds": [block.type for block in mesh.cells]}
    result |= {f"cells {k}": np.asarray(block.data) for k, block in enumerate(mesh.cells)}
    return result | {"names": list(values)} | {f"values {k}": column for k, column in enumerate(values.values())}


def refuse_nodes_before_the_first() -> None:
    """Make meshio map nodes 0 and −1 of elements in Gmsh files to nodes that do not exist, not to the last ones."""
    from importlib import import_module

    def guarded(read: Any, position: int) -> Any:
        """Return a function that reads elements after two ids have been added to those of the nodes."""

        def read_elements(*arguments: Any) -> Any:
            tags = np.asarray(arguments[position])
            more = np.append(tags, tags.max() + np.array([1, 2]))  # Python counts −1 and −2 from the end
            return read(*arguments[:position], more, *arguments[position + 1 :])

        return read_elements

    for version, name, position in ((22, "_read_cells", 2), (40, "_read_elements", 1), (41, "_read_elements", 1)):
        with contextlib.suppress(ImportError, AttributeError):  # other versions of meshio may name them otherwise
            reader = import_module(f"meshio.gmsh._gmsh{version}")
            setattr(reader, name, guarded(getattr(reader, name), position))


def nifti(path: str) -> dict[str, Any]:
    """Read the values and the (4, 4) affine map of a NIfTI image."""
    import nibabel

    nibabel.imageglobals.logger.disabled = True
    image: Any = nibabel.load(path)
    return {"values": np.asarray(image.dataobj), "affine": np.asarray(image.affine, dtype=np.float64)}


def dxf(path: str, sag: float) -> dict[str, Any]:
    """Read the lines of a DXF drawing as seen along z: all their ``points``, (n, 2), and ``counts`` of points of each.

    Segments are no farther from arcs and splines than `sag` times the size of the drawing.
    """
    import ezdxf
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.path import make_path

    paths = []
    for entity in recursive_decompose(ezdxf.readfile(path).modelspace()):  # type: ignore[attr-defined]
        if entity.dxftype() in ("LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE", "HATCH"):
            paths += [part for part in make_path(entity).sub_paths() if len(part)]
    if not paths:
        raise Refused("the drawing contains no lines", "convert text to lines first")
    corners = np.array([tuple(point) for part in paths for point in part.control_vertices()])[:, :2]
    step = sag * max(float(np.ptp(corners, axis=0).max()), float(np.finfo(np.float64).tiny))
    lines = [np.array([tuple(point) for point in part.flattening(step)])[:, :2] for part in paths]
    return {"points": np.concatenate(lines), "counts": np.array([len(line) for line in lines], dtype=np.int64)}


def confine(memory: int, seconds: int) -> None:
    """Limit this process to `memory` bytes and `seconds` of processor time, without network and other programs.

    Limits that a system does not support are not set: Windows has none, and only Linux can remove the network. Python's
    own sockets are refused everywhere.
    """
    with contextlib.suppress(ImportError):
        import resource

        # the process writes only messages to a file
        kinds = {resource.RLIMIT_CPU: seconds, resource.RLIMIT_FSIZE: 1 << 20, resource.RLIMIT_CORE: 0}
        for kind, most in (kinds | {resource.RLIMIT_DATA: memory}).items():
            _, bound = resource.getrlimit(kind)
            least = most if bound == resource.RLIM_INFINITY else min(most, bound)
            with contextlib.suppress(ValueError, OSError):
                resource.setrlimit(kind, (least, least if kind != resource.RLIMIT_CPU else bound))
    if sys.platform == "linux":
        unshare = ctypes.CDLL(None).unshare
        if unshare(NEW_NETWORK):  # without a user namespace, only root may do this
            unshare(NEW_USER | NEW_NETWORK)
    sys.addaudithook(refuse)


def refuse(event: str, _: object) -> None:
    """Raise an exception if an audit event of Python is `FORBIDDEN`, such as opening a socket."""
    if event.startswith(FORBIDDEN):
        raise PermissionError(f"{event} is not for parsers")


def answer(results: dict[str, Any], file: Any) -> None:
    """Write results to a file: a line of JSON with values and the types and shapes of arrays, then their bytes."""
    arrays = {name: np.ascontiguousarray(value) for name, value in results.items() if isinstance(value, np.ndarray)}
    values = {name: value for name, value in results.items() if name not in arrays}
    about = [[name, array.dtype.newbyteorder("=").str, array.shape] for name, array in arrays.items()]
    file.write(json.dumps({"values": values, "arrays": about}).encode() + b"\n")
    for array in arrays.values():
        file.write(array.astype(array.dtype.newbyteorder("="), copy=False).tobytes())
    file.flush()


def main(function: str, path: str, options: str, memory: str, seconds: str) -> None:
    """Parse a file by a function of this module, and write the result or the error to standard output.

    `options` is JSON with its further arguments; `memory` and `seconds` are the limits of `confine`.
    """
    file = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # printed text must not mix with the answer
    warnings.simplefilter("ignore")
    confine(int(memory), int(seconds))
    try:
        with np.errstate(all="ignore"):
            result = globals()[function](path, **json.loads(options))
    except Refused as error:
        result = {"refused": error.args}
    except BaseException as error:
        result = {"error": type(error).__name__, "message": f"{error}"[:400], "package": getattr(error, "name", None)}
    answer(result, file)
    os._exit(0)  # skip exit handlers of packages


if __name__ == "__main__":
    main(*sys.argv[1:])
