"""Closed meshes of assemblies: bodies that overlap, touch and lie within each other, damaged and rounded.

`python benchmarks/assemblies.py` prints a table for `docs/watertight.md`: how many surfaces are closed and have the
right volume, and seconds of the processor, beside manifold3d and MeshLib, which unite the parts that are connected.
MeshLib fills their holes first. Bolted plates need Open CASCADE (`pip install cadquery-ocp`).
"""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import trimesh
from trimesh import creation, transformations

import signedheat as sh

Parts = list[trimesh.Trimesh]


def moved(part: trimesh.Trimesh, place: Sequence[float], turn: np.ndarray | None = None) -> trimesh.Trimesh:
    """Turn and move a part."""
    part = part.copy()
    if turn is not None:
        part.apply_transform(turn)
    part.apply_translation(place)
    return part


def upright() -> np.ndarray:
    """The turn that lays the axis of a wheel along y."""
    return transformations.rotation_matrix(np.pi / 2, (1, 0, 0))


def car(rng: np.random.Generator) -> Parts:
    """A body of boxes with wheels, rims, lights and handles, about 2,400 faces."""
    length, width, height = 4 + rng.random(), 1.8 + 0.3 * rng.random(), 0.6 + 0.3 * rng.random()
    parts = [creation.box((length, width, height))]
    parts.append(moved(creation.box((0.5 * length, 0.9 * width, height)), (-0.1, 0, 0.8 * height)))
    for x in (-1, 1):
        for y in (-1, 1):
            place = 0.32 * x * length, 0.5 * y * width, -0.5 * height
            parts.append(moved(creation.cylinder(0.35, 0.3, sections=int(rng.integers(16, 33))), place, upright()))
            parts.append(moved(creation.annulus(0.1, 0.3, 0.34, sections=24), place, upright()))
        parts.append(moved(creation.icosphere(2, 0.18), (0.5 * length, 0.35 * x * width, 0)))
        handle = creation.capsule(0.8, 0.08, count=(12, 12))
        parts.append(moved(handle, (0, 0.5 * x * width, 0.3 * height), turned(rng)))
    return parts


def wheels(rng: np.random.Generator) -> Parts:
    """Boxes side by side, and wheels of coaxial cylinders and rings that touch all around, 1,800 to 5,500 faces."""
    parts = [creation.box((4, 1.8, 0.5)), moved(creation.box((2.2, 1.7, 0.5)), (0, 0, 0.5))]
    parts += [moved(creation.box((1, 1.8, 0.2)), (1.5, 0, 0.35))]
    parts += [moved(creation.box((4, 0.1, 0.1)), (0, y, 0)) for y in (-0.95, 0.95)]
    n = 2 * int(rng.integers(12, 40))
    wheel = [creation.cylinder(0.35, 0.3, sections=n), moved(creation.cylinder(0.2, 0.1, sections=n), (0, 0, 0.2))]
    wheel += [creation.annulus(0.35, 0.45, 0.3, sections=n), creation.cylinder(0.05, 0.5, sections=n // 2)]
    return parts + [moved(w, (x, y, -0.25), upright()) for x in (-1.3, 1.3) for y in (-1.05, 1.05) for w in wheel]


def stack(rng: np.random.Generator) -> Parts:
    """Cylinders on each other, and boxes with faces in the same planes."""
    n = int(rng.integers(8, 40))
    parts = [moved(creation.cylinder(0.5 if k % 2 else 0.8, 0.2, sections=n), (0, 0, 0.2 * k)) for k in range(6)]
    return parts + [moved(creation.box((0.4, 0.4, 0.4)), (0.7, 0, 0.2 * k + 0.1)) for k in range(4)]


def frame(_: np.random.Generator) -> Parts:
    """Bars that cross at joints, with faces in common planes."""
    parts = [moved(creation.box((0.1, 0.1, 1)), (x, y, 0.5)) for x in range(3) for y in range(2)]
    for z in (0.05, 0.5, 0.95):
        parts += [moved(creation.box((2.1, 0.1, 0.1)), (1, y, z)) for y in range(2)]
        parts += [moved(creation.box((0.1, 1.1, 0.1)), (x, 0.5, z)) for x in range(3)]
    return parts


def pipes(rng: np.random.Generator) -> Parts:
    """Cylinders of one radius through each other, and a ball and a ring of the same radius."""
    n = 2 * int(rng.integers(6, 20))
    turns = [transformations.rotation_matrix(np.pi / 2, axis) for axis in np.eye(3)]
    parts = [moved(creation.cylinder(0.2, 2, sections=n), (0, 0, 0), turn) for turn in turns]
    parts += [creation.icosphere(2, 0.2), moved(creation.cylinder(0.2, 2, sections=n), (0.4, 0, 0))]
    return [*parts, creation.annulus(0.2, 0.3, 0.5, sections=n)]


def rail(rng: np.random.Generator) -> Parts:
    """A long bar on sleepers, with pegs."""
    parts = [creation.box((20, 0.3, 0.2))]
    for _ in range(int(rng.integers(10, 30))):
        part = creation.box((0.25, 1.6, 0.15)) if rng.random() < 0.7 else creation.cylinder(0.1, 0.5, sections=10)
        parts.append(moved(part, (rng.uniform(-9.5, 9.5), rng.uniform(-0.1, 0.1), rng.choice([-0.17, -0.1, -0.175]))))
    return parts


def bolted(rng: np.random.Generator) -> Parts:
    """Plates with bolts through their holes, of STEP files, 2,900 to 6,000 faces: round heads touch the plates."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.Message import Message, Message_PrinterOStream
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    def pin(x: float, z: float, radius: float, height: float) -> object:
        return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, 0.5, z), gp_Dir(0.0, 0.0, 1.0)), radius, height).Shape()

    Message.DefaultMessenger_s().RemovePrinters(Message_PrinterOStream.get_type_descriptor_s())
    made, places = list[object](), 0.5 + np.arange(int(rng.integers(3, 6)))
    for z in (0.0, 0.2):
        plate = BRepPrimAPI_MakeBox(gp_Pnt(0.0, 0.0, z), float(len(places)), 1.0, 0.2).Shape()
        for x in places:
            plate = BRepAlgoAPI_Cut(plate, pin(x, z, 0.2, 0.2)).Shape()
        made.append(plate)
    made += [BRepAlgoAPI_Fuse(pin(x, -0.1, 0.2, 0.6), pin(x, 0.4, 0.35, 0.15)).Shape() for x in places]
    parts = []
    with tempfile.TemporaryDirectory() as folder:
        for shape in made:
            writer, path = STEPControl_Writer(), str(Path(folder, "part.step"))
            writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
            writer.Write(path)
            mesh, _ = sh.io.read_step(path, deflection=0.002)
            parts.append(trimesh.Trimesh(mesh.vertices, mesh.faces))
    return parts


def turned(rng: np.random.Generator) -> np.ndarray:
    """A random rotation."""
    return transformations.random_rotation_matrix(rng.random(3))


KINDS: tuple[Callable[[np.random.Generator], Parts], ...] = (car, wheels, stack, frame, pipes, rail, bolted)
DAMAGE = "none", "faces turned", "2 % missing", "doubled", "soup", "single", "single, each part", "four digits", "far"
"""What is done to the faces; or how coordinates are rounded, and where from."""


def damaged(parts: Parts, damage: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Turn an assembly, round its coordinates or damage its faces."""
    turn = turned(rng)[:3, :3]
    pieces = [part.vertices @ turn.T for part in parts]
    if damage == "single, each part":  # as nodes of a scene, each with a frame of its own
        for k, piece in enumerate(pieces):
            own, place = turned(rng)[:3, :3], rng.normal(size=3)
            inner = ((piece - place) @ own).astype(np.float32).astype(float)
            pieces[k] = inner @ own.astype(np.float32).astype(float).T + place.astype(np.float32)
    firsts = np.cumsum([0, *(len(piece) for piece in pieces)])
    vertices = np.concatenate(pieces)
    faces = np.concatenate([part.faces + first for part, first in zip(parts, firsts, strict=False)])
    if damage == "single":
        vertices = vertices.astype(np.float32).astype(float)
    elif damage == "far":
        vertices = (vertices + np.array([300.0, -200.0, 100.0])).astype(np.float32).astype(float)
    elif damage == "four digits":
        vertices = np.round(vertices, 4)
    elif damage == "faces turned":
        chosen = rng.random(len(faces)) < 0.2
        faces[chosen] = faces[chosen][:, ::-1]
    elif damage == "2 % missing":
        faces = faces[rng.random(len(faces)) > 0.02]
    elif damage == "doubled":
        faces = np.concatenate([faces, faces[rng.random(len(faces)) < 0.1]])
    elif damage == "soup":
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    return vertices, faces


def united(parts: Parts) -> manifold3d.Manifold | None:
    """Unite parts with manifold3d; None if one is not closed, on which it may crash, or if it refuses one."""
    if not all(part.is_watertight and part.is_winding_consistent for part in parts):
        return None
    made = [manifold3d.Manifold(manifold3d.Mesh64(part.vertices, part.faces.astype(np.uint64))) for part in parts]
    if any(part.status() != manifold3d.Error.NoError for part in made):
        return None
    return manifold3d.Manifold.batch_boolean(made, manifold3d.OpType.Add)


def united_by_manifold(parts: Parts) -> float:
    """Volume of parts united with manifold3d, NaN if it refuses one."""
    whole = united(parts)
    return np.nan if whole is None else whole.volume()


def with_surface(shape: tuple[np.ndarray, np.ndarray]) -> tuple[sh.Solid, sh.TriangleMesh]:
    """Complete a shape and take its surface."""
    solid = sh.complete(shape)
    return solid, solid.surface()


def united_by_meshlib(parts: Parts) -> float:
    """Fill the holes of parts and unite them with MeshLib; returns the volume, NaN if it fails."""
    from meshlib import mrmeshnumpy, mrmeshpy

    made = [mrmeshnumpy.meshFromFacesVerts(part.faces.astype(np.int32), part.vertices) for part in parts]
    for part in made:
        for edge in part.topology.findHoleRepresentiveEdges():
            mrmeshpy.fillHole(part, edge)
    pointers = mrmeshpy.std_vector_Mesh_const_ptr()
    for part in made:
        pointers.append(part)
    shifted = mrmeshpy.UniteManyMeshesParams()
    shifted.useRandomShifts, shifted.maxAllowedError = True, 1e-5  # for faces in common planes
    for parameters in (mrmeshpy.UniteManyMeshesParams(), shifted):
        with suppress(RuntimeError):
            whole = mrmeshpy.uniteManyMeshes(pointers, parameters)
            return float(whole.volume()) if not whole.topology.findHoleRepresentiveEdges() else np.nan
    return np.nan


def with_parts(unite: Callable[[Parts], float], shape: tuple[np.ndarray, np.ndarray]) -> float:
    """Unite the parts of a mesh that are connected where positions are equal."""
    return unite(list(trimesh.Trimesh(*shape, process=True).split(only_watertight=False)))


def seconds_of(call: Callable[..., Any], *arguments: object) -> tuple[Any, float]:
    """Call a function; returns its result and seconds of the processor."""
    begin = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*arguments), time.process_time() - begin


def main() -> None:
    """Print the table."""
    sh.complete(sh.samples.sphere(2)).surface()
    print("| damage | closed | right | s, median | s, most | manifold3d: right | s | MeshLib: right | s |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for damage in DAMAGE:
        rows = []
        for kind in KINDS:
            for seed in range(2):
                rng = np.random.default_rng(seed)
                parts = kind(rng)
                for part in parts:
                    part.merge_vertices()
                volume = united(parts).volume()
                vertices, faces = damaged(parts, damage, rng)
                (solid, surface), seconds = seconds_of(with_surface, (vertices, faces))
                # what rounding moves has another volume; its surface must have that of its solid
                near = 1e-6 if damage not in ("four digits", "far") else 1e-3
                sure = surface.is_watertight and abs(surface.volume / solid.volume - 1) < 1e-6
                row = [surface.is_watertight, sure and abs(surface.volume / volume - 1) < near, seconds]
                for unite, error in ((united_by_manifold, near), (united_by_meshlib, max(near, 1e-5))):
                    other, seconds = seconds_of(with_parts, unite, (vertices, faces))
                    row += [abs(other / volume - 1) < error, seconds]
                rows.append(row)
        n, (closed, right, ours, theirs, seconds, meshlib, meshlib_seconds) = len(rows), np.transpose(rows)
        values = (
            np.median(ours),
            ours.max(),
            theirs.sum(),
            np.median(seconds),
            meshlib.sum(),
            np.median(meshlib_seconds),
        )
        told = " | ".join(f"{value:.0f}" if k in (2, 4) else f"{value:.2f}" for k, value in enumerate(values))
        print(f"| {damage} | {closed.sum():.0f} of {n} | {right.sum():.0f} | {told} |", flush=True)


if __name__ == "__main__":
    main()
