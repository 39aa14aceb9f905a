"""Scenes of several bodies: glTF by trimesh, 3MF (Core Specification 1.3), STEP by Open CASCADE; and their units."""

from __future__ import annotations

import io
import json
import posixpath
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..domains.joining import Body, concatenated
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from ..geometry.welding import welded
from ..packages import lazy_module
from .files import PathLike, companion_contents, contents, damaged, ensure_fits, extension, parsed_by_others, reading

trimesh = lazy_module("trimesh", ".glb and .gltf files")
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

GLTF_BYTES = 80
"""Measured: what each position, index or the like takes while a glTF scene is read."""
TRIANGLE_BYTES = 100
"""Memory that a triangle of a 3MF package takes, with its vertices."""
METRES = {
    "micron": 1e-6,
    "mm": 1e-3,
    "millimeter": 1e-3,
    "cm": 1e-2,
    "centimeter": 1e-2,
    "inch": 0.0254,
    "foot": 0.3048,
    "m": 1.0,
    "meter": 1.0,
}
"""Units of length, those of 3MF among them, in metres."""
ROOT = "3D/3dmodel.model"
PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
DEPTH = 32
"""Components within components."""

Key = tuple[str, str]
"""Part of the package, and id of an object in it."""
FINENESS = 1e-3
"""Distance of triangles from the surface, over the diagonal of the box around it, if nothing else is said."""
ANGLE = 0.3
"""Radians between neighbouring triangles of curved faces, about: 20 of them around a cylinder."""
SEAM = 1e-6
"""Distance over the diagonal within which corners of neighbouring faces are one: Open CASCADE's own precision."""


def _joined(bodies: Sequence[Body]) -> TriangleMesh:
    """One mesh of all bodies, one after another."""
    if not bodies:
        raise FileFormatError("it holds no triangles", remedy="export the shape as a mesh")
    return TriangleMesh(*concatenated(bodies))


def read_glb(path: PathLike) -> TriangleMesh:
    """All triangles of a scene, transformed by their nodes, one body after another.

    Buffers that the file names must lie in the same folder or below it; pictures are not read.
    """
    data = contents(path)
    load_scene = trimesh.load_scene
    plain, files = _without_looks(data, path)

    def parse() -> list[Body]:
        scene = load_scene(io.BytesIO(plain), file_type=extension(path)[1:], process=False, resolver=files)
        bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh)]
        return [(np.asarray(body.vertices), np.asarray(body.faces)) for body in bodies]

    return _joined(parsed_by_others(parse, len(data)))


def _without_looks(data: bytes, path: PathLike) -> tuple[bytes, dict[str, bytes]]:
    """The file without its materials and pictures, and the buffers that it names, by name.

    Numbers that would be made of nothing (an accessor without a view is zeros, as many as it says) are refused where
    they are more than the bytes of the file.
    """
    is_binary = data[:4] == b"glTF"
    length = int.from_bytes(data[12:16], "little") if is_binary else len(data)
    tree = json.loads(data[20 : 20 + length] if is_binary else data)
    files = {
        buffer["uri"]: companion_contents(path, unquote(buffer["uri"]))
        for buffer in tree.get("buffers", [])
        if "uri" in buffer and "base64," not in buffer["uri"]
    }
    most = len(data) + sum(map(len, files.values()))
    if any(not 0 <= accessor.get("count", 0) <= most for accessor in tree.get("accessors", [])):
        raise damaged("it announces more numbers than it has bytes: it is damaged")
    ensure_fits(GLTF_BYTES * sum(accessor.get("count", 0) for accessor in tree.get("accessors", [])), path)
    for looks in ("materials", "textures", "images", "samplers"):
        tree.pop(looks, None)
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            primitive.pop("material", None)
    text = json.dumps(tree).encode()
    if not is_binary:
        return text, files
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = b"glTF" + data[4:8] + (20 + len(text) + len(rest)).to_bytes(4, "little")
    return head + len(text).to_bytes(4, "little") + data[16:20] + text + rest, files


@dataclass
class _Object:
    """A mesh, or other objects, each with a (4, 3) transform that multiplies rows from the right."""

    vertices: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    parts: list[tuple[Key, NDArray[np.float64]]] = field(default_factory=list)


def read_3mf(path: PathLike) -> TriangleMesh:
    """All that a package builds, placed, one object after another, in the units of the file (`unit_of`)."""
    with reading(path):
        package = _Package(path)
        root = package.model(package.root)
        items = [(_key(item, package.root), _matrix(item)) for item in _all(root, "item")]
        if not items:  # nothing is said about what to build: everything that is a mesh
            own = [_key(each, package.root, "id") for each in _all(root, "object")]
            items = [(key, np.eye(4, 3)) for key in own if len(package.object(key).faces)]
        ensure_fits(TRIANGLE_BYTES * sum(package.count(key, 0) for key, _ in items), path)
        return _joined([body for key, matrix in items for body in package.placed(key, matrix)])


def unit_of(path: PathLike) -> str | None:
    """The unit of length of a file: what a 3MF file says, metres in glTF; None where formats do not say."""
    if extension(path) in (".glb", ".gltf"):
        return "m"
    if extension(path) != ".3mf":
        return None
    with reading(path):
        package = _Package(path)
        unit = package.model(package.root).get("unit", "millimeter")
        if unit not in METRES:
            raise damaged(f"it has the unit '{unit}', which 3MF does not know")
        return unit


class _Package:
    """The parts of a package, read when they are needed."""

    def __init__(self, path: PathLike) -> None:
        self._path = path
        self._zip = zipfile.ZipFile(io.BytesIO(contents(path)))
        self._models: dict[str, ElementTree.Element] = {}
        self._objects: dict[Key, _Object] = {}
        self._counts: dict[Key, int] = {}

    @property
    def root(self) -> str:
        """The name of the part with the build, as the relations of the package say."""
        if "_rels/.rels" in self._zip.namelist():
            for relation in ElementTree.fromstring(self._bytes("_rels/.rels")):
                if relation.get("Type", "").endswith("/3dmodel"):
                    return _part(relation.get("Target", ROOT))
        return ROOT

    def model(self, part: str) -> ElementTree.Element:
        """The root element of a part."""
        if part not in self._models:
            self._models[part] = ElementTree.fromstring(self._bytes(part))
        return self._models[part]

    def object(self, key: Key) -> _Object:
        """An object, by part and id."""
        if key not in self._objects:
            part, wanted = key
            for element in _all(self.model(part), "object"):
                self._objects[part, element.get("id", "")] = _object(element, part)
            if key not in self._objects:
                raise damaged(f"object {wanted} does not exist", element=f"object {wanted}")
        return self._objects[key]

    def count(self, key: Key, depth: int) -> int:
        """Number of triangles of an object with all its components, found without placing them."""
        if depth > DEPTH:
            raise damaged("its components contain themselves, or too many others")
        if key not in self._counts:
            found = self.object(key)
            inner = sum(self.count(part, depth + 1) for part, _ in found.parts)
            self._counts[key] = len(found.faces) + inner
        return self._counts[key]

    def placed(self, key: Key, matrix: NDArray[np.float64]) -> Iterator[Body]:
        """Vertices and faces of an object and its components; what is mirrored keeps its outside."""
        found = self.object(key)
        if len(found.faces):
            faces = found.faces if np.linalg.det(matrix[:3]) >= 0 else found.faces[:, ::-1]
            yield found.vertices @ matrix[:3] + matrix[3], faces
        for part, own in found.parts:
            yield from self.placed(part, np.vstack([own[:3] @ matrix[:3], own[3] @ matrix[:3] + matrix[3]]))

    def _bytes(self, part: str) -> bytes:
        """A part, of which no more is unpacked than it announces."""
        entry = self._zip.getinfo(part)
        ensure_fits(10 * entry.file_size, self._path)  # its tree of elements is several times larger
        with self._zip.open(entry) as file:
            data = file.read(entry.file_size)
        if b"<!DOCTYPE" in data[:4096] or b"<!ENTITY" in data:
            raise damaged("its model defines entities")
        return data


def _all(element: ElementTree.Element, name: str) -> Iterator[ElementTree.Element]:
    """Elements of a name, in whatever namespace."""
    return (each for each in element.iter() if each.tag.rpartition("}")[2] == name)


def _part(target: str) -> str:
    return posixpath.normpath(target.lstrip("/"))


def _key(element: ElementTree.Element, part: str, name: str = "objectid") -> Key:
    """The object that an element names; with the production extension it may lie in another part."""
    other = element.get(PATH)
    return part if other is None else _part(other), element.get(name, "")


def _matrix(element: ElementTree.Element) -> NDArray[np.float64]:
    words = element.get("transform")
    if words is None:
        return np.eye(4, 3)
    return np.array([float(word) for word in words.split()]).reshape(4, 3)


def _object(element: ElementTree.Element, part: str) -> _Object:
    """The object that an element of a part describes."""
    vertices = [[float(v.get(axis, "nan")) for axis in "xyz"] for v in _all(element, "vertex")]
    faces = [[int(t.get(corner, "-1")) for corner in ("v1", "v2", "v3")] for t in _all(element, "triangle")]
    parts = [(_key(each, part), _matrix(each)) for each in _all(element, "component")]
    ids = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(ids) and (ids.min() < 0 or ids.max() >= len(vertices)):
        raise damaged(
            f"object {element.get('id')} names a vertex that it does not have", element=f"object {element.get('id')}"
        )
    return _Object(np.array(vertices, dtype=np.float64).reshape(-1, 3), ids, parts)


def read_step(path: PathLike, deflection: float | None = None) -> tuple[TriangleMesh, NDArray[np.int64]]:
    """Triangles of a ``.step`` or ``.stp`` file, and the number of the CAD face that each is part of.

    `Closest.faces` are triangles: the second array, taken at them, says on which CAD face the nearest place lies.

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

    Examples
    --------
    >>> mesh, cad_faces = read_step("part.step", deflection=0.01)  # doctest: +SKIP
    >>> cad_faces[signedheat.complete(mesh).closest(points).faces]  # doctest: +SKIP
    """
    shape = _shape(path)
    box = boxes.Bnd_Box()
    bounding.BRepBndLib.Add_s(shape, box)
    if box.IsVoid():
        raise FileFormatError("it has no surface", path=path)
    diagonal = float(np.sqrt(box.SquareExtent()))
    mesher.BRepMesh_IncrementalMesh(shape, deflection or FINENESS * diagonal, False, ANGLE, False)
    as_face = getattr(casts.TopoDS, "Face_s", None) or casts.TopoDS.Face  # its name until version 8
    walk = explorer.TopExp_Explorer(shape, topology.TopAbs_ShapeEnum.TopAbs_FACE)
    bodies = []
    while walk.More():
        bodies.append(_triangles(as_face(walk.Current())))
        walk.Next()
    counts = [len(triangles) for _, triangles in bodies]
    if not sum(counts):
        raise FileFormatError("it has no surface", path=path)
    mesh = _joined(bodies)
    kept, numbers = np.unique(welded(mesh.vertices, SEAM * diagonal), return_inverse=True)
    return TriangleMesh(mesh.vertices[kept], numbers.ravel()[mesh.faces]), np.repeat(np.arange(len(bodies)), counts)


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


def _triangles(face: Any) -> Body:
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
