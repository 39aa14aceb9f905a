"""Scenes of several bodies: glTF, 3MF (Core Specification 1.3), COLLADA, STEP by Open CASCADE; and their units."""

from __future__ import annotations

import io
import math
import posixpath
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np

from ..arrays import Floats, Ints
from ..errors import FileFormatError
from ..mesh.welding import welded
from ..packages import ensure_installed
from ..shapes.transforms import Body, concatenated, placed
from ..surfaces.triangle_mesh import TriangleMesh
from . import gltf
from .budgets import BYTES_PER_PLACED, XML, charge, charge_tree
from .files import PathLike, contents, damaged, extension, reading
from .numerals import finite_numbers, integer, integers, parsed_numbers
from .sandbox import parsed

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
"""Units of length, including those of 3MF, in metres."""
MODEL_PART = "3D/3dmodel.model"
"""Usual name of the part of a 3MF package that says what to build."""
PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
"""Attribute that names another part, of 3MF's production extension."""
MOST_COMPONENT_DEPTH = 32
"""Largest depth of nested components; deeper ones are refused."""

Key = tuple[str, str]
"""The name of a part, which is a file in a 3MF package, and the id of an object in it."""
COLLADA_IDS = {"p": 0, "ph": 0, "h": 0, "vcount": 0, "v": -1}
"""Elements of COLLADA files that hold ids or counts, and the least number that each may hold."""
COLLADA_REALS = ("float_array", "matrix", "translate", "rotate", "scale", "lookat", "skew")
"""Elements of COLLADA files that hold real numbers."""
FACET_DEFLECTION = 1e-3
"""Default of the largest distance of triangles from the CAD surface, relative to the diagonal of the box around it."""
FACET_ANGLE = 0.3
"""Approximate angle between neighbouring triangles of curved faces, in radians: 20 of them around a cylinder."""


def _joined(bodies: Sequence[Body]) -> TriangleMesh:
    """Join bodies to a mesh that has their vertices and faces one after another."""
    if not bodies:
        raise FileFormatError("it holds no triangles", remedy="export the shape as a mesh")
    return TriangleMesh(*concatenated(bodies))


def read_glb(path: PathLike) -> TriangleMesh:
    """Read all triangles of a glTF scene, transformed by their nodes, body after body."""
    return _joined(gltf.read_bodies(path))


def read_dae(path: PathLike) -> TriangleMesh:
    """Read all triangles of a COLLADA scene, transformed by their nodes, in the units of the file and with its axes."""
    ensure_installed("collada", ".dae files")
    with reading(path):
        _refuse_wrong_numbers(contents(path))
    parts = parsed("dae", path, "trimesh", ".dae files")
    return _joined([(parts["points"], parts["triangles"])] if len(parts["triangles"]) else [])


def _refuse_wrong_numbers(data: bytes) -> None:
    """Raise `FileFormatError` if ids, counts or coordinates in a COLLADA file are no numbers of their kind.

    Its parser takes −1 for the last vertex, 2³² + 1 for the second, and NaN for 0.
    """
    charge_tree(data, XML)
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError):  # the parser reports it, or knows the encoding
        return
    for element in root.iter():
        kind, words = str(element.tag).rpartition("}")[2], (element.text or "").split()
        if kind in COLLADA_IDS:
            if integers(words, f"<{kind}>", COLLADA_IDS[kind]).max(initial=0) > len(data):
                raise damaged(f"<{kind}> has an id that is larger than the file", element=kind)
        elif kind in COLLADA_REALS:
            finite_numbers(words, f"<{kind}>")
        for name in ("count", "offset", "stride"):
            if name in element.attrib:
                integer(element.attrib[name], f"{name} of <{kind}>")


@dataclass
class _Object:
    """An object of a 3MF package: a mesh, or components, which are other objects and (4, 3) transforms of their rows.

    Rows (x, y, z, 1) are multiplied by a transform from the right.
    """

    vertices: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    faces: Ints = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    parts: list[tuple[Key, Floats]] = field(default_factory=list)


def read_3mf(path: PathLike) -> TriangleMesh:
    """Read the objects that a 3MF package builds, transformed as it says, as a mesh in the unit of the file."""
    with reading(path):
        package = _Package(path)
        root = package.model(package.root)
        items = [(_key(item, package.root), _matrix(item)) for item in _all(root, "item")]
        if not items:  # nothing says what to build: take each object that has a mesh
            keys = [_key(element, package.root, "id") for element in _all(root, "object")]
            items = [(key, np.eye(4, 3)) for key in keys if len(package.object(key).faces)]
        package.charge([key for key, _ in items])
        bodies = [(package.body(key), matrix) for key, matrix in items]
        return _joined([placed(body, matrix) for body, matrix in bodies if len(body[1])])


def unit_of(path: PathLike) -> str | None:
    """Return the unit of length of a file, one of `METRES`, or None if the file does not state one of these.

    It is always m for glTF and mm for STEP.
    """
    kind = extension(path)
    if kind not in (".3mf", ".dae"):
        return {".glb": "m", ".gltf": "m", ".step": "mm", ".stp": "mm"}.get(kind)
    with reading(path):
        if kind == ".dae":
            return _collada_unit(contents(path))
        package = _Package(path)
        unit = package.model(package.root).get("unit", "millimeter")
        if unit not in METRES:
            raise damaged(f"it has the unit '{unit}', which does not exist in 3MF")
        return unit


def _collada_unit(data: bytes) -> str | None:
    """Return the unit of `METRES` that has the length given in the first ``<asset>`` of a COLLADA file, or None."""
    charge_tree(data, XML)
    for _, element in ElementTree.iterparse(io.BytesIO(data)):
        if element.tag.endswith("}unit"):
            try:
                [metres] = parsed_numbers([element.get("meter", "1")], "meter").tolist()
            except FileFormatError:  # nothing else needs it
                return None
            return next((unit for unit, length in METRES.items() if math.isclose(metres, length, rel_tol=1e-4)), None)
        if element.tag.endswith("}asset"):
            break
    return None


def scale_to(path: PathLike, units: str) -> float:
    """Return the factor by which coordinates of a file are multiplied to convert them to another unit.

    Parameters
    ----------
    path : str or path
        The file.
    units : str
        The other unit, such as ``"mm"``, or ``"inch:mm"`` with the unit to assume for a file that states none.
    """
    assumed, _, target = units.rpartition(":")
    return METRES[unit_of(path) or assumed or target] / METRES[target]


class _Package:
    """A 3MF package, which is a ZIP archive; its parts are read when they are needed."""

    def __init__(self, path: PathLike) -> None:
        self._zip = zipfile.ZipFile(io.BytesIO(contents(path)))
        self._models: dict[str, ElementTree.Element] = {}
        self._objects: dict[Key, _Object] = {}
        self._sizes: dict[Key, tuple[int, int]] = {}
        self._bodies: dict[Key, Body] = {}

    @property
    def root(self) -> str:
        """The name of the part that says what to build, according to the relationships of the package."""
        if "_rels/.rels" in self._zip.namelist():
            for relation in ElementTree.fromstring(self._bytes("_rels/.rels")):
                if relation.get("Type", "").endswith("/3dmodel"):
                    return _part(relation.get("Target", MODEL_PART))
        return MODEL_PART

    def model(self, part: str) -> ElementTree.Element:
        """Return the root of the XML tree of a part."""
        if part not in self._models:
            self._models[part] = ElementTree.fromstring(self._bytes(part))
        return self._models[part]

    def object(self, key: Key) -> _Object:
        """Return an object, by part and id."""
        if key not in self._objects:
            part, number = key
            for element in _all(self.model(part), "object"):
                self._objects[part, element.get("id", "")] = _object(element, part)
            if key not in self._objects:
                raise damaged(f"object {number} does not exist", element=f"object {number}")
        return self._objects[key]

    def charge(self, keys: Sequence[Key], depth: int = 0) -> tuple[int, int]:
        """Charge the memory of objects that are about to be joined, with their components, to the budget of the file.

        Parameters
        ----------
        keys : sequence of (part, id)
            The objects. Components of several objects are made, and charged, once (see `body`).
        depth : int
            How many objects contain these.

        Returns
        -------
        made : int
            The number of vertices plus faces of all objects.
        height : int
            The largest number of levels of nested components.
        """
        made, height = 0, 0
        for key in keys:
            if key not in self._sizes:
                if depth > MOST_COMPONENT_DEPTH:
                    raise damaged("its components contain themselves, or too many others")
                item = self.object(key)
                size, levels = self.charge([part for part, _ in item.parts], depth + 1)
                if levels >= MOST_COMPONENT_DEPTH:
                    raise damaged(f"its components lie more than {MOST_COMPONENT_DEPTH} levels deep")
                self._sizes[key] = len(item.vertices) + len(item.faces) + size, levels + 1
            size, levels = self._sizes[key]
            made, height = made + size, max(height, levels)
        charge(BYTES_PER_PLACED * made, len(keys), made)
        return made, height

    def body(self, key: Key) -> Body:
        """Return the vertices and faces of an object with all its components, without those that have no faces.

        Each object is made once and then copied, so that the work is no more than the size of the result.
        """
        if key not in self._bodies:
            item = self.object(key)
            inner = [(self.body(part), matrix) for part, matrix in item.parts]
            bodies = [(item.vertices, item.faces)] if len(item.faces) or not inner else []
            bodies += [placed(body, matrix) for body, matrix in inner if len(body[1])]
            self._bodies[key] = concatenated(bodies) if len(bodies) > 1 else (*bodies, (item.vertices, item.faces))[0]
        return self._bodies[key]

    def _bytes(self, part: str) -> bytes:
        """Return the XML text of a part, whose memory is charged to the budget of the file before it is used.

        No more is unpacked than the archive announces. Entities, which may expand to any size, are refused.
        """
        entry = self._zip.getinfo(part)
        charge(bytes=entry.file_size)
        with self._zip.open(entry) as file:
            data = file.read(entry.file_size)
        if b"<!DOCTYPE" in data[:4096] or b"<!ENTITY" in data:
            raise damaged("its model defines entities")
        charge_tree(data, XML)
        return data


def _all(element: ElementTree.Element, name: str) -> Iterator[ElementTree.Element]:
    """Return the element itself and all elements within it that have a name, in any namespace."""
    return (inner for inner in element.iter() if inner.tag.rpartition("}")[2] == name)


def _part(target: str) -> str:
    """Return the name of a part in the archive, given as an absolute path in the package."""
    return posixpath.normpath(target.lstrip("/"))


def _key(element: ElementTree.Element, part: str, name: str = "objectid") -> Key:
    """Return the part and id of the object that an element of `part` names by its attribute `name`.

    With 3MF's production extension the object may lie in another part.
    """
    path = element.get(PATH)
    return part if path is None else _part(path), element.get(name, "")


def _matrix(element: ElementTree.Element) -> Floats:
    """Return the (4, 3) transform that an element states, by default the identity.

    Rows (x, y, z, 1) are multiplied by it from the right.
    """
    words = element.get("transform")
    if words is None:
        return np.eye(4, 3)
    return parsed_numbers(words.split(), "transform").reshape(4, 3)


def _object(element: ElementTree.Element, part: str) -> _Object:
    """Return the object that an element of a part describes."""
    vertices = [v.get(axis, "nan") for v in _all(element, "vertex") for axis in "xyz"]
    faces = [t.get(corner, "") for t in _all(element, "triangle") for corner in ("v1", "v2", "v3")]
    parts = [(_key(component, part), _matrix(component)) for component in _all(element, "component")]
    ids = integers(faces, "corners of triangles", 0).reshape(-1, 3)
    if len(ids) and 3 * ids.max() >= len(vertices):
        raise damaged(
            f"object {element.get('id')} refers to a vertex that it does not have",
            element=f"object {element.get('id')}",
        )
    return _Object(parsed_numbers(vertices, "vertices").reshape(-1, 3), ids, parts)


def read_step(path: PathLike, deflection: float | None = None) -> tuple[TriangleMesh, Ints]:
    """Read the triangles of a ``.step`` or ``.stp`` file, and the number of the CAD face that each is part of.

    With ``faces = complete(mesh).closest(points).faces``, ``cad_faces[faces]`` are the CAD faces nearest to points
    where ``faces >= 0``. Where it is −1, a completed surface is nearest, which is part of no CAD face.

    Parameters
    ----------
    path : str or path
        The file.
    deflection : float, optional
        How far triangles may be off curved faces, in millimetres; by default a thousandth of the diagonal of the box
        around the shape.

    Returns
    -------
    mesh : TriangleMesh
        The triangles in millimetres, whatever the units of the file. They face outwards where the CAD faces do.
    cad_faces : (m,) int
        The number of the CAD face of each triangle; faces are numbered from 0 in the order of the file.

    Raises
    ------
    FileFormatError
        If the file cannot be read, or has no surface.
    MissingPackageError
        If Open CASCADE (cadquery-ocp) is not installed.

    See Also
    --------
    read : Read a shape or a solid.

    Examples
    --------
    >>> mesh, cad_faces = read_step("part.step", deflection=0.01)  # doctest: +SKIP
    >>> faces = signedheat.complete(mesh).closest(points).faces  # doctest: +SKIP
    >>> cad_faces[faces[faces >= 0]]  # doctest: +SKIP
    """
    fineness = {"deflection": deflection, "fineness": FACET_DEFLECTION, "angle": FACET_ANGLE}
    # one line may describe a surface of very many triangles, or one that is slow to triangulate
    parts = parsed("step", path, "OCP", ".step files", bytes_per_byte=10_000, least_seconds=60, **fineness)
    counts = parts["triangle_counts"]
    if not counts.sum():
        raise FileFormatError("it has no surface", path=path)
    starts = np.cumsum([0, *parts["point_counts"][:-1]])
    faces = parts["triangles"] + np.repeat(starts, counts)[:, None]
    # corners of neighbouring faces that agree within the precision of Open CASCADE become one vertex
    rows, numbers = np.unique(welded(parts["points"], 1e-6 * parts["diagonal"]), return_inverse=True)
    return TriangleMesh(parts["points"][rows], numbers.ravel()[faces]), np.repeat(np.arange(len(counts)), counts)


def step_mesh(path: PathLike) -> TriangleMesh:
    """Read the triangles of a STEP file alone."""
    return read_step(path)[0]
