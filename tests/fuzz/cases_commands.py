"""Whole command lines: files, names, options and numbers of every kind, in every combination."""

from __future__ import annotations

import io
import json
import os
from argparse import Action
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, family
from fuzz.inputs import Random, chance, one_of
from signedheat import memory, samples
from signedheat.cli import main
from signedheat.cli.options import parser_of
from signedheat.cli.shell import COMMANDS as DECLARED

FREE = 600_000_000
"""Bytes that commands are told to be free, so that what is refused for its size is refused soon."""
COMMANDS = ("volume", "surface", "close", "offset", "contour", "morph", "sample", "info", "view")
ODD = (
    "0",
    "-0",
    "-1",
    "nan",
    "inf",
    "-inf",
    "1e-300",
    "1e300",
    "1e400",
    "",
    " ",
    "abc",
    "0x10",
    "1,5",
    "1_0",
    "٣",
    "-",
)
PLAIN = ("0.1", "0.25", "1", "2", "3", "-0.2", "1e-6", "1e6", "0.5")
NAMES = ("shape", "a shape", "-shape", "größe", "形", "100%", "{x}", "a'b\"c", "x" * 200, "+1", "a.b", "[1-3]*", "#")
SIZES = (1.0, 1.0, 1.0, 1e-9, 1e9, 1e-3, 1e3, 1e-30, 1e30)
PLACES = (0.0, 0.0, 0.0, 1.0, 1e7, -1e12)
RARE = ("help", "scheduler", "version", "workers", "tiles", "label", "transform", "units", "shape", "origin")
VALUES: dict[str, tuple[str, ...]] = {
    "resolution": ("2", "3", "8", "12", "16", "1", "1000000", "8.0"),
    "samples": ("1", "2", "50", "100"),
    "constraint": ("free", "zero-set", "hard", "each-component", "soft", "soft:3", "soft:-1", "soft:nan", "levels:1,2",
                   "levels:", "levels:nan", "soft:", "none"),
    "units": ("mm", "m", "inch:mm", "mm:", ":mm", "parsec", "m:mm"),
    "transform": ("1 0 0 0 0 1 0 0 0 0 1 0", "-1 0 0 0 0 1 0 0 0 0 1 0", "0 0 0 0 0 0 0 0 0 0 0 0", "2", "other.txt",
                  "1 0 0 1e7 0 1 0 0 0 0 1 0 0 0 0 1", "nan 0 0 0 0 1 0 0 0 0 1 0", "1 0 0 0 0 1e-9 0 0 0 0 1 0"),
    "up": ("x", "y", "z", "w"),
    "format": ("npz", "stl", "ply", "json", "vtp", "txt", "xyz", ""),
    "layout": ("arrays", "deepsdf", "both"),
    "shape": ("4 4 4", "3 3", "0 0 0", "-1 2 3", "100000 100000 100000", "4", "2 2 2"),
    "origin": ("0 0 0", "-1 -1 -1", "0 0", "nan 0 0", "1e300 0 0"),
    "spacing": ("0.2", "0.3 0.2 0.5", "1e-12", "1e12", "0.1 0.1"),
    "label": ("0", "1", "3", "-1", "300", "1.5", "nan"),
    "contours": ("0", "1", "5", "100000"),
    "workers": ("1", "0", "-3"),
    "preview": ("picture.png", "picture.xyz", "missing/picture.png", "picture"),
    "tets": ("", "tets.mesh", "missing.mesh"),
    "curves": ("curves.csv", "missing.json"),
    "tiles": ("tiles", "missing/tiles", "curves.csv"),
    "seed": ("0", "1", "-1", "9999999999999999999999"),
}  # fmt: skip


@dataclass(frozen=True)
class Command:
    """Arguments, and the folder in which they are run."""

    arguments: tuple[str, ...]
    folder: Path


def build(random: Random, folder: Path) -> Command:
    """A command whose files are there, more often than not, with a few options."""
    name = one_of(random, COMMANDS)
    chosen = _subparsers()[name]
    ending = one_of(random, [end for end in SHAPES if end not in FLAT or name in ("volume", "offset")])
    shape = f"{one_of(random, NAMES)}{ending}" if chance(random, 0.5) else f"shape{ending}"
    SHAPES[ending](random, folder / shape)
    _files_beside(random, folder)
    if chance(random, 0.05):
        _spoil(random, folder / shape)
    files = {"shape": shape, "files": shape, "file": shape, "mesh": shape, "field": one_of(random, FIELDS)}
    files["curves"] = one_of(random, CURVES if chance(random, 0.2) else CURVES[:3])
    if name in ("surface", "close") and chance(random, 0.8):
        samples.sphere(2).save(folder / "ball.ply")
        files["mesh"] = "ball.ply"
    arguments = [name]
    for action in chosen._actions:
        if not action.option_strings and action.dest != "help":
            arguments += _positional(random, action, files)
    options = [action for action in chosen._actions if action.option_strings and action.dest not in ("help", "output")]
    weights = np.array([0.3 if action.dest in RARE else 1.0 for action in options])
    count = min(int(random.integers(0, 5)), len(options))
    for which in random.choice(len(options), size=count, replace=False, p=weights / weights.sum()):
        arguments += _option(random, options[int(which)])
    if any(action.dest == "resolution" for action in options) and not {"--resolution", "--spacing"} & set(arguments):
        arguments += ["--resolution", str(random.integers(4, 20))]
    if name == "sample" and "--samples" not in arguments:
        arguments += ["--samples", "40"]
    if name != "info":
        known = OUTPUTS["flat" if name == "offset" and ending in FLAT else name]
        arguments += ["--output", one_of(random, known if chance(random, 0.9) else ODD_OUTPUTS)]
    return Command(tuple(arguments), folder)


@cache
def _subparsers() -> dict[str, Any]:
    return next(action.choices for action in parser_of(DECLARED)._actions if getattr(action, "choices", None))


def _positional(random: Random, action: Action, files: dict[str, str]) -> list[str]:
    if action.dest in files:
        return ["./" + files[action.dest] if files[action.dest].startswith("-") else files[action.dest]]
    if action.choices:
        return [str(one_of(random, list(action.choices)))]
    count = int(random.integers(1, 4)) if action.nargs == "+" else 1
    return [one_of(random, ODD if chance(random, 0.05) else PLAIN) for _ in range(count)]


def _option(random: Random, action: Action) -> list[str]:
    flag = action.option_strings[-1]
    if action.nargs == 0:
        return [flag]
    value = one_of(random, ODD) if chance(random, 0.08) else one_of(random, VALUES.get(action.dest, PLAIN))
    if action.nargs in ("+", "*"):
        return [flag, *value.split()]
    if action.nargs == "?" and not value:
        return [flag]
    return [f"{flag}={value}"]


def _placed(random: Random, points: np.ndarray) -> np.ndarray:
    return points * one_of(random, SIZES) + random.normal(size=3) * one_of(random, PLACES)


def _mesh(random: Random) -> sh.TriangleMesh:
    made = one_of(random, (samples.sphere(1), samples.sphere(2), samples.without_patches(samples.sphere(2), 3, 0.2),
                           samples.soup(samples.sphere(1), 0.05), sh.TriangleMesh(np.eye(3), [[0, 1, 2]])))  # fmt: skip
    return sh.TriangleMesh(_placed(random, made.vertices), made.faces)


def _save_mesh(random: Random, path: Path) -> None:
    _mesh(random).save(path)


def _save_points(random: Random, path: Path) -> None:
    points = random.normal(size=(int(random.integers(1, 60)), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    sh.PointCloud(_placed(random, points), points if chance(random, 0.7) else None).save(path)


def _save_voxels(random: Random, path: Path) -> None:
    volume = random.random(random.integers(1, 7, 3)) < one_of(random, (0.0, 0.3, 0.8, 1.0))
    np.save(path, volume.astype(one_of(random, (bool, np.uint8, float))))


def _save_lines(random: Random, path: Path) -> None:
    points = random.normal(size=(int(random.integers(2, 9)), 2)) * one_of(random, SIZES)
    sh.io.write_polylines([sh.Polyline(points, closed=chance(random, 0.5))], path)


def _save_quads(random: Random, path: Path) -> None:
    squares = sh.DigitalSurface(np.ones((2, 2, 2), dtype=bool)).squares
    sh.PolygonMesh(_placed(random, squares.vertices), squares.polygons).save(path)


SHAPES: dict[str, Callable[[Random, Path], None]] = {
    ".stl": _save_mesh, ".obj": _save_quads, ".ply": _save_mesh, ".off": _save_mesh, ".vtp": _save_mesh,
    ".xyz": _save_points, ".pc": _save_points, ".npy": _save_voxels, ".csv": _save_lines, ".svg": _save_lines,
}  # fmt: skip
FLAT = (".csv", ".svg")
FIELDS = ("field.npz", "field.vti", "field.npy", "on_ball.npz", "plane.npz", "missing.npz", "curves.csv")
CURVES = ("curves.csv", "curves.json", "missing.json", "empty.json", "field.npz")
OUTPUTS = {
    "volume": ("out.npz", "out.vti", "out.nrrd", "out.npy", "out.vtu", "-"),
    "surface": ("out.ply", "out.vtp", "out.obj", "out.npz", "-"),
    "close": ("out.obj", "out.json", "-"),
    "offset": ("out.stl", "out.obj", "out.ply", "out.off", "out.vtp", "-"),
    "flat": ("out.svg", "out.csv", "-"),
    "contour": ("out.stl", "out.obj", "out.json", "out.csv", "out.ply", "-"),
    "morph": ("out.stl", "out.obj", "out.ply", "-"),
    "sample": ("out.npz", "-"),
    "view": ("out.pdf", "out.png"),
}
ODD_OUTPUTS = ("out", "", "folder", "folder/out.stl", "missing/out.npz", "out.xyzzy", "shape.stl", "a b.stl", ".stl")


def _files_beside(random: Random, folder: Path) -> None:
    ball = samples.sphere(1)
    (folder / "folder").mkdir()
    (folder / "empty.json").touch()
    (folder / "other.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n")
    (folder / "curves.csv").write_text("x,y,z\n1,0,0\n0,1,0\n-1,0,0\n")
    (folder / "curves.json").write_text('{"polylines": [{"points": [[0, 0, 1], [0, 1, 0]], "closed": true}]}')
    grid = sh.Grid([-1.0, -1.0, -1.0], 0.5, [5, 5, 5])
    values = np.linalg.norm(grid.points.reshape(*grid.shape, 3), axis=-1) - 0.7
    for ending in ("npz", "vti", "npy"):
        sh.Field(grid, values * one_of(random, SIZES)).save(folder / f"field.{ending}")
    plane = sh.Grid([0.0, 0.0], 1.0, [4, 5])
    sh.Field(plane, random.normal(size=(4, 5))).save(folder / "plane.npz")
    sh.Field(ball, ball.vertices[:, 0]).save(folder / "on_ball.npz")
    sh.TetMesh(np.eye(4)[:, :3], [[0, 1, 2, 3]]).save(folder / "tets.mesh")


def _spoil(random: Random, path: Path) -> None:
    """Cut short, or a folder, or a link to nowhere in its place."""
    data = path.read_bytes()
    path.unlink()
    kind = random.integers(4)
    if kind == 0:
        path.mkdir()
    elif kind == 1:
        path.symlink_to("nowhere")
    else:
        path.write_bytes(data[: int(random.integers(len(data)))] if kind == 2 else data + data)


def check(given: Command) -> str:
    """A status and one line, files whole or not there, inputs as they were, and no number that is none in silence."""
    before = {path.name: path.read_bytes() for path in _regular(given.folder)}
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.StringIO()
    with _inside(given.folder), redirect_stdout(out), redirect_stderr(err), patch.object(memory, "_free", lambda: FREE):
        status = main(given.arguments)
    out.flush()
    told, printed = err.getvalue(), out.buffer.getvalue()  # type: ignore[attr-defined]
    _judge_lines(status, told)
    written = [path for path in _regular(given.folder) if before.get(path.name) != path.read_bytes()]
    asked = given.arguments[-1]
    if any(path.name.startswith(".signedheat") for path in given.folder.rglob("*")):
        raise Wrong("left behind", told)
    if [path.name for path in written if path.name in before and path.name != asked]:
        raise Wrong("changed another file", str(written))
    if status and written:
        raise Wrong("failed, and written", f"{status} {told} {written}")
    if not status and "--json" in given.arguments and asked != "-":
        json.loads(printed, parse_constant=_refuse)
    if not status and "--quiet" not in given.arguments:
        for path in written:
            _judge_file(path, told)
    return {0: "done", 1: "failed", 2: "bad usage"}[status]


@contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _judge_lines(status: int, told: str) -> None:
    lines = told.splitlines()
    if status == 70 or "Traceback" in told:
        raise Wrong("called a bug", told)
    if status not in (0, 1, 2):
        raise Wrong("odd status", str(status))
    if status and (not lines or not lines[-1].startswith("signedheat")):
        raise Wrong("no clear line", told)
    if any(not line.startswith("signedheat") for line in lines):
        raise Wrong("lines of others", told)


def _regular(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.is_file()]


def _refuse(constant: str) -> None:
    raise Wrong("no JSON", constant)


def _values(field: Any) -> np.ndarray:
    """Those of a band without its nodes beyond the walls, which have none."""
    if getattr(field, "blocks", None) is None:
        return np.asarray(field.values)
    steps = np.moveaxis(np.indices((8, 8, 8)), 0, -1)
    nodes = 8 * field.domain.blocks.places[:, None, None, None] + steps
    return np.asarray(field.values[(nodes < field.domain.shape).all(axis=-1)])


def _judge_file(path: Path, told: str) -> None:
    """All numbers are finite, or something was said."""
    try:
        if path.suffix in (".npz", ".vti", ".nrrd", ".npy") and "out" in path.name:
            found = np.load(path) if path.suffix == ".npz" else None
            numbers = _values(sh.read_field(path)) if found is None or "distances" not in found else found["distances"]
        elif path.suffix in (".stl", ".ply", ".off", ".obj", ".vtp"):
            read: Any = sh.read(path)
            numbers = getattr(read, "vertices", np.zeros(0))
        else:
            return
    except (sh.errors.SignedHeatError, KeyError):
        return
    if not np.isfinite(numbers).all() and not told:
        raise Wrong("not finite without a word", f"{path.name}: {np.size(numbers) - np.isfinite(numbers).sum()}")


family("commands", build, check)
