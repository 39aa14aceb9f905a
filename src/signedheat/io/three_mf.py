"""3MF: packages of meshes for printing, with their units (3MF Core Specification 1.3)."""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from .files import PathLike, contents, damaged, ensure_fits, extension, reading

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
BYTES = 100
"""Memory that a triangle takes, with its vertices."""

Key = tuple[str, str]
"""Part of the package, and id of an object in it."""


@dataclass
class _Object:
    """A mesh, or other objects, each with a (4, 3) transform that multiplies rows from the right."""

    vertices: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    parts: list[tuple[Key, NDArray[np.float64]]] = field(default_factory=list)


def read_3mf(path: PathLike) -> TriangleMesh:
    """All that a package builds, placed, one object after another, in the units of the file (`unit_of`).

    Raises
    ------
    FileFormatError
        If it is damaged, holds no mesh, or its components contain themselves.
    MemoryLimitError
        If what it unpacks to does not fit into memory.
    """
    with reading(path):
        package = _Package(path)
        root = package.model(package.root)
        items = [(_key(item, package.root), _matrix(item)) for item in _all(root, "item")]
        if not items:  # nothing is said about what to build: everything that is a mesh
            own = [_key(each, package.root, "id") for each in _all(root, "object")]
            items = [(key, np.eye(4, 3)) for key in own if len(package.object(key).faces)]
        ensure_fits(BYTES * sum(package.count(key, 0) for key, _ in items), path)
        placed = [body for key, matrix in items for body in package.placed(key, matrix)]
        if not placed:
            raise FileFormatError("the package holds no triangles", remedy="export the shape as a mesh")
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in placed)])
        faces = [own + start for (_, own), start in zip(placed, starts, strict=False)]
        return TriangleMesh(np.concatenate([vertices for vertices, _ in placed]), np.concatenate(faces))


def unit_of(path: PathLike) -> str | None:
    """The unit of length of a file: what a 3MF file says, metres in glTF; None where formats do not tell.

    Raises
    ------
    FileFormatError
        If the file is damaged, or its unit is none that 3MF knows.
    """
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
        """The name of the part with the build, which the relations of the package tell."""
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

    def placed(self, key: Key, matrix: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]]:
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
    vertices = [[float(v.get(axis, "nan")) for axis in "xyz"] for v in _all(element, "vertex")]
    faces = [[int(t.get(corner, "-1")) for corner in ("v1", "v2", "v3")] for t in _all(element, "triangle")]
    parts = [(_key(each, part), _matrix(each)) for each in _all(element, "component")]
    ids = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(ids) and (ids.min() < 0 or ids.max() >= len(vertices)):
        raise damaged(
            f"object {element.get('id')} names a vertex that it does not have", element=f"object {element.get('id')}"
        )
    return _Object(np.array(vertices, dtype=np.float64).reshape(-1, 3), ids, parts)
