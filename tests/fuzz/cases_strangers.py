"""Files whose structure is wrong: `3MF graphs`, `E57 descriptions`, `glTF scenes`, `loaded solids`."""

from __future__ import annotations

import base64
import io
import json
import warnings
import zipfile
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import scan_files
import signedheat as sh
from fuzz.cases_files import Damaged, check, written
from fuzz.frame import Wrong, family
from fuzz.mutations import damaged
from signedheat import samples
from signedheat.arrays import fingerprint
from signedheat.io.numpy_files import write_npz
from signedheat.io.solid_arrays import SOLID_ARRAYS, SOURCE_ARRAYS

NUMBERS: list[Any] = [0, -1, 1, 2, 3, 4, 7, 255, 65535, 2**31, -(2**31), 2**32, 2**53, 10**30]
NUMBERS += [0.5, -0.0, 1e-320, 1e300, 1e400, None, "1", [], {}, True]
"""What numbers in JSON become."""
VALUES = [0.0, -1.0, 1.0, 1e-320, 1e-30, 1e30, 1e300, np.nan, np.inf, -np.inf]
"""What numbers in arrays become."""
INTEGERS = [-7, -1, 0, 1, 127, 2**31, -(2**31), 2**62, -(2**63)]
"""What indices and counts become."""
TYPES = ["f2", "f4", ">f8", "i1", "i8", "u8", "c16", "b", "S8"]
"""What the types of arrays become."""


def graph(random: np.random.Generator, folder: Path) -> Damaged:
    """Objects that are made of one another, at random."""
    n = int(random.integers(1, 60))
    corners = '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
    triangles = '<triangles><triangle v1="0" v2="1" v3="2"/></triangles>'
    full, empty = f"<mesh><vertices>{corners}</vertices>{triangles}</mesh>", "<mesh><vertices/></mesh>"
    objects = []
    for number in range(n):
        low, high = (0, number) if random.random() < 0.9 else (0, n)
        parts = random.integers(low, max(high, low + 1), int(random.integers(0, 4))).tolist()
        moves = "" if random.random() < 0.8 else f' transform="{" ".join(map(str, random.choice(VALUES, 12)))}"'
        listed = "".join(f'<component objectid="{part}"{moves}/>' for part in parts)
        inside = f"<components>{listed}</components>" if parts else full if random.random() < 0.5 else empty
        objects.append(f'<object id="{number}">{inside}</object>')
    order = random.permutation(n) if random.random() < 0.5 else np.arange(n)
    items = "".join(f'<item objectid="{k}"/>' for k in random.integers(0, n + (random.random() < 0.1), 3))
    head = '<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
    text = head + "".join(objects[k] for k in order)
    with zipfile.ZipFile(folder / "graph.3mf", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", f"{text}</resources><build>{items}</build></model>")
    return Damaged(folder / "graph.3mf", sh.read)


@cache
def scan() -> bytes:
    """An E57 file."""
    points = np.random.default_rng(0).normal(size=(20, 3))
    return written(lambda path: scan_files.write_e57(path, points), "scan.e57")["scan.e57"]


def described(random: np.random.Generator, folder: Path) -> Damaged:
    """A scan whose description is damaged, with checksums that are right."""
    xml = damaged(random, scan_files.description(scan()))
    (folder / "scan.e57").write_bytes(scan_files.with_description(scan(), xml))
    return Damaged(folder / "scan.e57", sh.read)


def scene(random: np.random.Generator, folder: Path) -> Damaged:
    """A glTF scene, of which some numbers are others, or some entries are gone."""
    corners, faces = np.eye(4, 3, dtype="<f4"), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], "<u2")
    data = corners.tobytes() + faces.tobytes() + np.array([3, 0], "<u2").tobytes() + np.ones(3, "<f4").tobytes()
    sizes = [48, 24, 4, 12]
    starts = np.cumsum([0, *sizes])[:4].tolist()
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3}}
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1], "translation": [1, 2, 3]}, {"mesh": 0, "rotation": [0, 0, 0, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": int(random.integers(0, 8))}]}],
        "buffers": [{"byteLength": len(data), "uri": f"data:;base64,{base64.b64encode(data).decode()}"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": size} for start, size in zip(starts, sizes, strict=True)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR", "normalized": False},
        ],
    }
    for _ in range(int(random.integers(1, 4))):
        place: Any = tree
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            key = keys[int(random.integers(0, len(keys)))]
            if not isinstance(place[key], dict | list) or not place[key] or random.random() < 0.1:
                break
            place = place[key]
        if random.random() < 0.15:
            del place[key]
        else:
            place[key] = NUMBERS[int(random.integers(0, len(NUMBERS)))]
    (folder / "scene.gltf").write_text(json.dumps(tree))
    return Damaged(folder / "scene.gltf", sh.read)


def is_read(subject: Damaged) -> str:
    """As of damaged files: read, or refused by name."""
    return check(subject)


@dataclass(frozen=True)
class Loaded:
    """A file of a solid, and what was changed in it."""

    path: Path
    changed: str


@cache
def solid() -> dict[str, np.ndarray]:
    """The arrays of a solid with a hole that is closed."""
    save = sh.complete(samples.without_faces(samples.sphere(2), 0.1)).save
    with np.load(io.BytesIO(written(save, "solid.npz")["solid.npz"])) as file:
        return dict(file)


def numbers(random: np.random.Generator, folder: Path) -> Loaded:
    """A solid of which arrays have other numbers, shapes or types, or are gone; most have a right key."""
    arrays = dict(solid())
    changed = [one_changed(random, arrays) for _ in range(int(random.choice([1, 1, 2])))]
    if "key" in arrays and random.random() < 0.7:
        held = [
            np.asarray(arrays[name]) for name in (*SOLID_ARRAYS, *SOURCE_ARRAYS) if name in arrays and name != "key"
        ]
        arrays["key"] = np.frombuffer(fingerprint(*held), dtype=np.uint8)
    write_npz(folder / "solid.npz", **arrays)
    return Loaded(folder / "solid.npz", "; ".join(changed))


def one_changed(random: np.random.Generator, arrays: dict[str, np.ndarray]) -> str:
    """Change one of the arrays; what was changed."""
    name = list(arrays)[int(random.integers(0, len(arrays)))]
    array = np.array(arrays[name])
    is_real, kind = array.dtype.kind == "f", int(random.integers(0, 8))
    value = VALUES[int(random.integers(0, len(VALUES)))] if is_real else int(random.choice(INTEGERS))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if kind == 0:
            array = np.full(array.shape, value).astype(array.dtype)
        elif kind == 1 and array.size:
            array.reshape(-1)[random.integers(0, array.size, 3)] = np.array(value).astype(array.dtype)
        elif kind == 2:
            array = array[: len(array) // int(random.choice([1, 2, 10**6]))] if array.ndim else array
        elif kind == 3:
            array = array.astype(array.dtype.newbyteorder(">"))
        elif kind == 4:
            array = array.astype(np.dtype(str(random.choice(TYPES))))
        elif kind == 5:
            array = [array[None], array.reshape(-1), array.T, array.reshape(-1)[:0]][int(random.integers(0, 4))]
        elif kind == 6 and array.ndim:
            array = array[random.integers(0, len(array), int(random.integers(0, 2 * len(array) + 1)))]
        else:
            del arrays[name]
            return f"{name}: gone"
    arrays[name] = array
    return f"{name}: {kind}, {value}, {array.dtype} {array.shape}"


def use(subject: Loaded) -> str:
    """It is refused, or it answers with numbers."""
    loaded = sh.read(subject.path)
    points = np.random.default_rng(0).normal(size=(50, 3))
    distances = loaded.distance(points)
    closest = loaded.closest(points)
    values = loaded.field(resolution=5).values, loaded.surface(resolution=5).vertices, loaded.volume
    if not all(np.isfinite(numbers).all() for numbers in (distances, closest.points, *values)):
        raise Wrong("not finite", subject.changed)
    return "loaded"


family("3MF graphs", graph, is_read, memory=1 << 28)
family("glTF scenes", scene, is_read, memory=1 << 28)
family("loaded solids", numbers, use)
if find_spec("pye57") is not None:
    family("E57 descriptions", described, is_read, memory=1 << 28)
