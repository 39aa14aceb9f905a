"""Small files that stand for much: what reading them may take is counted before it is made."""

from __future__ import annotations

import ast
import gzip
import json
import operator
import re
import time
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from expanding_files import EXPANSIONS, TRIANGLE, doubled_svg, own_buffers, three_mf
from refusals import refused
from signedheat import samples
from signedheat.errors import LONGEST_TEXT, FileFormatError, MemoryLimitError, SignedHeatError
from signedheat.io import budgets

SECONDS = 3.0
"""Processor time for a file of some kilobytes, on a busy machine."""


@pytest.mark.parametrize("name", EXPANSIONS)
def test_what_is_used_again_and_again_is_counted_before_it_is_made(tmp_path, name):
    file, write, read, levels = EXPANSIONS[name]
    path = tmp_path / file
    write(path, levels)
    begin = time.process_time()
    with refused(SignedHeatError, file=file):
        read(path)
    write(path, 4)
    read(path)
    assert time.process_time() - begin < SECONDS
    with refused(SignedHeatError, file=file), sh.io.Budget(elements=1, points=1):
        read(path)


def test_components_at_any_depth_are_where_their_matrices_place_them(tmp_path):
    """Eight triangles along x from three levels, each of which places the one below twice."""
    parts = "".join(
        f'<object id="{k}"><components><component objectid="{k - 1}"/><component objectid="{k - 1}" '
        f'transform="1 0 0 0 1 0 0 0 1 {2 ** (k - 1)} 0 0"/></components></object>'
        for k in (1, 2, 3)
    )
    three_mf(tmp_path / "a.3mf", f'<object id="0">{TRIANGLE}</object>{parts}', [3])
    mesh = sh.read(tmp_path / "a.3mf")
    assert mesh.vertices[mesh.faces[:, 0]].tolist() == [[x, 0, 0] for x in range(8)]


def test_a_file_that_is_its_own_buffer_is_read_once(tmp_path, monkeypatch):
    opened = []
    contents = budgets.charge
    monkeypatch.setattr("signedheat.io.files.charge", lambda **given: opened.append(given) or contents(**given))
    own_buffers(tmp_path / "a.gltf", 10)
    with refused(FileFormatError):
        sh.read(tmp_path / "a.gltf")
    assert len(opened) == 2


def test_cells_of_as_many_kinds_as_there_are_cells(tmp_path):
    n = 20_000
    arrays = "".join(
        f'<DataArray type="Int64" Name="{name}" format="ascii">{" ".join(map(str, values))}</DataArray>'
        for name, values in (
            ("connectivity", range(n)), ("offsets", range(1, n + 1)), ("types", range(1000, n + 1000)),
        )
    )  # fmt: skip
    points = f'<DataArray type="Float64" format="ascii">{" ".join(["0.5"] * 3 * n)}</DataArray>'
    (tmp_path / "a.vtu").write_text(
        f'<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="{n}" NumberOfCells="{n}">'
        f"<Points>{points}</Points><Cells>{arrays}</Cells></Piece></UnstructuredGrid></VTKFile>"
    )
    begin = time.process_time()
    with refused(SignedHeatError):
        sh.read(tmp_path / "a.vtu")
    assert time.process_time() - begin < SECONDS


def packed(path, ending, n):
    """An image of n³ zeros, which take no place in the file."""
    zeros = np.zeros((n, n, n), dtype=np.uint8)
    if ending == "nrrd":
        head = f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: {n} {n} {n}\nencoding: gzip\n\n"
        path.write_bytes(head.encode() + gzip.compress(zeros.tobytes(), 6))
    else:
        np.savez_compressed(path, values=zeros.astype(float), origin=np.zeros(3), spacing=np.ones(3))


@pytest.mark.parametrize("ending", ["nrrd", "npz"])
def test_packed_values_are_counted_with_their_copies(tmp_path, ending, monkeypatch):
    path, n = tmp_path / f"a.{ending}", 64
    packed(path, ending, n)
    size = n**3 * (8 if ending == "npz" else 1)
    monkeypatch.setattr(budgets, "available_memory", lambda: int(0.99 * size))
    with refused(MemoryLimitError, file=path.name):
        sh.io.read_field(path)
    monkeypatch.setattr(budgets, "available_memory", lambda: 7 * size)
    sh.io.read_field(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.svg", "<svg>" + "<g/>" * 20_000 + "</svg>"),
        ("a.svg", "<svg>" + "<g a='' b='' c='' d=''/>" * 5_000 + "</svg>"),
        ("a.gltf", '{"a":[' + "[],{}," * 20_000 + "0]}"),
        ("a.json", '{"polylines":[' + "{}," * 20_000 + "0]}"),
        ("a.obj", "v 0 0 0\n" + "f 1 1 1\n" * 5_000),
        ("a.off", "OFF\n3 0 0\n" + "1\n" * 30_000),
        ("a.csv", "1 1\n" * 5_000),
        ("a.stl", "solid a facet\n" + "1 " * 20_000),
    ],
)
def test_texts_are_charged_for_their_words_and_trees(tmp_path, name, content):
    """Of two bytes become a hundred and more."""
    (tmp_path / name).write_text(content)
    read = {
        "svg": sh.io.read_polylines,
        "csv": sh.io.read_polylines,
        "json": lambda path: sh.io.read_curves(path, samples.sphere(1)),
    }.get(name[2:], sh.read)
    with sh.io.Budget(bytes=8 * len(content)), refused(MemoryLimitError, file=name):
        read(tmp_path / name)


def test_budgets_are_set_within_each_other(tmp_path):
    path = tmp_path / "ball.ply"
    samples.sphere(3).save(path)
    with sh.io.Budget(bytes=1e9):
        with refused(MemoryLimitError, file="ball.ply"), sh.io.Budget(bytes=100):
            sh.read(path)
        sh.read(path)
    sh.read(path)


def test_processor_time_is_charged(tmp_path):
    path = tmp_path / "a.svg"
    doubled_svg(path, 14)
    with sh.io.Budget(seconds=1e-3), refused(FileFormatError, file="a.svg"):
        sh.io.read_polylines(path)
    assert len(sh.io.read_polylines(path)) == 2**14


@pytest.mark.parametrize("name", ["bytes", "elements", "points", "seconds"])
@pytest.mark.parametrize("value", [0, -1, float("nan"), float("inf"), "1", True])
def test_limits_are_positive_numbers(name, value):
    with refused(SignedHeatError, name):
        sh.io.Budget(**{name: value})


# -- texts of any length --


def test_messages_quote_no_more_than_a_line(tmp_path):
    for name, content in {
        "a.ply": "ply\nformat ascii 1.0\nproperty " + "a" * 100_000 + "\nend_header\n",
        "a.obj": "a" * 100_000 + " 1 2 3\n",
        "a.gltf": json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": ["a" * 100_000]}),
        "a.nrrd": f"NRRD0004\ntype: {'a' * 100_000}\ndimension: 1\nsizes: 3\nencoding: raw\n\n",
        "a.pcd": f"FIELDS {' '.join('abc' * 50_000)}\nDATA ascii\n",
        "a.vtp": f'<VTKFile type="{"a" * 100_000}"/>',
    }.items():
        (tmp_path / name).write_text(content)
        with refused(SignedHeatError, file=name) as caught:
            sh.read(tmp_path / name)
        error = caught.value
        assert all(len(text or "") <= LONGEST_TEXT for text in (error.cause, error.remedy, error.element))


SOURCE = Path(sh.__file__).parent
FINDING = {"sub": "findall", "split": "findall", "finditer": "findall"}
"""Functions that go through a text as others do."""


def patterns():
    """All regular expressions of the package, their flags, and how they are used, by their names or at once."""
    texts = [file.read_text() for file in SOURCE.rglob("*.py")]
    source, used = "\n".join(texts), set()
    for tree in map(ast.parse, texts):
        named = {id(node.value): node.targets[0].id for node in ast.walk(tree) if isinstance(node, ast.Assign)
                 and isinstance(node.targets[0], ast.Name)}  # fmt: skip
        for node in ast.walk(tree):
            match node:
                case ast.Call(ast.Attribute(ast.Name("re"), way), [ast.Constant(pattern), *rest], keywords):
                    listed = [*rest, *(keyword.value for keyword in keywords)]
                    flags = [getattr(re, flag.attr) for flag in listed if isinstance(flag, ast.Attribute)]
                    name = named.get(id(node), "")
                    ways = re.findall(rf"\b{name}\.(match|fullmatch|search|sub|findall|finditer|split)\b", source)
                    for use in ways if way == "compile" and name else ["fullmatch"] if way == "compile" else [way]:
                        used.add((pattern, reduce(operator.or_, flags, re.RegexFlag(0)), FINDING.get(use, use)))
    assert len({pattern for pattern, _, _ in used}) > 15
    return sorted(used, key=str)


@pytest.mark.parametrize(("pattern", "flags", "way"), patterns())
def test_regular_expressions_are_linear(pattern, flags, way):
    """On whatever repeats and then ends in what does not match."""
    n, is_text = 30_000, isinstance(pattern, str)
    words = {*re.findall("[A-Za-z-]{3,}", pattern if is_text else pattern.decode())}
    words |= {" ", "1", "a", "1,", "1.", "-", "(", "\\ ", "\n", "1e", "$a", "1/", '"', "_", "+.", "１"}
    begin = time.process_time()
    for word in sorted(words):
        for text in (word * n, (word + " ") * n, word + " " * n, word * n + "\0", word + "1" * n + "x", word + "(" * n):
            getattr(re, way)(pattern, text if is_text else text.encode(), flags)
    assert time.process_time() - begin < SECONDS
