"""How the add-on speaks with the command line: files in a temporary folder. Needs NumPy, and nothing of Blender."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


class CommandError(Exception):
    """The command is missing, or says what is wrong with the mesh."""


def surface_at(
    command: str, vertices: NDArray[np.float64], polygons: list[list[int]], distance: float, resolution: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles of the closed surface at a distance from a mesh: at 0, of the mesh made watertight."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "mesh.ply", Path(folder) / "surface.ply"
        write_ply(given, vertices, polygons)
        run(command, "offset", str(given), repr(distance), "-o", str(made), "--resolution", str(resolution))
        return read_ply(made)


def field_of(
    command: str, vertices: NDArray[np.float64], polygons: list[list[int]], resolution: int, path: str
) -> None:
    """Write the distance to a mesh as OpenVDB, in a band around it of eight cells."""
    size = float(np.ptp(vertices, axis=0).max())
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "mesh.ply"
        write_ply(given, vertices, polygons)
        band = repr(8 * size / resolution)
        run(command, "volume", str(given), "-o", path, "--resolution", str(resolution), "--band", band)


def run(command: str, *words: str) -> None:
    """Run the command line.

    Raises
    ------
    CommandError
        With the one line that it prints where something is wrong.
    """
    try:
        done = subprocess.run([command, *words, "--quiet"], capture_output=True, text=True)
    except OSError as error:
        raise CommandError(f"{command} cannot be run ({error}): set its path in the add-on's preferences") from error
    if done.returncode:
        raise CommandError((done.stderr.strip().splitlines() or [f"{command} failed"])[-1])


def write_ply(path: Path, vertices: NDArray[np.float64], polygons: list[list[int]]) -> None:
    """A mesh in double precision."""
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {axis}" for axis in "xyz"]
    header += [f"element face {len(polygons)}", "property list int int vertex_indices", "end_header"]
    listed = np.array([number for polygon in polygons for number in (len(polygon), *polygon)], dtype="<i4")
    path.write_bytes(("\n".join(header) + "\n").encode() + np.asarray(vertices, "<f8").tobytes() + listed.tobytes())


def read_ply(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles, as the command writes them."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    counts = {name: int(count) for _, name, count in (line.split() for line in lines if line.startswith("element"))}
    columns = sum(line.startswith("property double") for line in lines)  # a confidence may follow x, y and z
    vertices = np.frombuffer(body, "<f8", columns * counts["vertex"]).reshape(-1, columns)
    size = "u1" if "property list uchar int vertex_indices" in lines else "<i4"
    rows = np.frombuffer(body, [("count", size), ("corners", "<i4", 3)], counts["face"], vertices.nbytes)
    if not (rows["count"] == 3).all():
        raise CommandError("the surface has faces that are no triangles")
    return vertices[:, :3].copy(), rows["corners"].astype(np.int64)
