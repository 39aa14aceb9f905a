"""PCD: what is written in each way is read again; odd files are refused."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(7, 3)).astype(np.float32)
NORMALS = (POINTS / np.linalg.norm(POINTS, axis=1)[:, None]).astype(np.float32)


def pcd(data, normals=True, points=POINTS, size="4"):
    names = "x y z intensity" + (" normal_x normal_y normal_z" if normals else "")
    columns = len(names.split())
    header = (
        f"# .PCD v.7\nVERSION .7\nFIELDS {names}\nSIZE {' '.join([size] * columns)}\nTYPE {' '.join('F' * columns)}\n"
        f"COUNT {' '.join('1' * columns)}\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\nDATA {data}\n"
    )
    table = np.column_stack([points, np.arange(len(points)), *([NORMALS[: len(points)]] if normals else [])])
    if data == "ascii":
        return (header + "\n".join(" ".join(map(str, row)) for row in table.tolist()) + "\n").encode()
    table = table.astype(f"<f{size}")
    return header.encode() + (packed(table.T.tobytes()) if data == "binary_compressed" else table.tobytes())


def packed(data):
    """LZF, that packs runs of one byte only: what comes again is a part that begins one byte before."""
    result, at = b"", 0
    while at < len(data):
        run = 1
        while run < 200 and data[at : at + run + 1] == data[at : at + 1] * (run + 1):
            run += 1
        result += b"\0" + data[at : at + 1]
        length = run - 1 - 2
        if 1 <= length < 7:
            result += bytes([length << 5, 0])
        elif length >= 7:
            result += bytes([7 << 5, length - 7, 0])
        at += run if length >= 1 else 1
    return np.array([len(result), len(data)], dtype="<u4").tobytes() + result


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("size", ["4", "8"])
def test_points_are_read(tmp_path, data, normals, size):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(pcd(data, normals, size=size))
    cloud = sh.read(path)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert (cloud.normals is not None) == normals


@pytest.mark.parametrize("n", [3, 300, 2048])
def test_what_is_packed_is_unpacked_where_parts_come_again(tmp_path, n):
    """Of points in a pattern, written by hand: a part of nine bytes, or more, from as far back as can be said."""
    first = np.arange(3 * n, dtype="<f4").reshape(3, n)
    table = np.concatenate([first, first], axis=1)  # each axis twice
    body = b""
    for row in first:
        values = row.tobytes()
        for at in range(0, len(values), 32):
            body += bytes([len(values[at : at + 32]) - 1]) + values[at : at + 32]
        for left in range(4 * n, 0, -264):
            length, back = min(left, 264) - 2, 4 * n - 1
            long = bytes([length - 7]) if length >= 7 else b""
            body += bytes([min(length, 7) << 5 | back >> 8]) + long + bytes([back & 255])
    header = f"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {2 * n}\nHEIGHT 1\nDATA binary_compressed\n"
    sizes = np.array([len(body), table.nbytes], dtype="<u4").tobytes()
    (tmp_path / "cloud.pcd").write_bytes(header.encode() + sizes + body)
    np.testing.assert_array_equal(sh.read(tmp_path / "cloud.pcd").points, table.T)


@pytest.mark.parametrize("at", range(8, 60, 7))
def test_damaged_packed_data_are_refused(tmp_path, at):
    content = pcd("binary_compressed")
    begin = content.index(b"compressed\n") + len(b"compressed\n")
    for change in (content[: begin + at], content[: begin + 8] + b"\xff" * at + content[begin + 8 + at :]):
        (tmp_path / "cloud.pcd").write_bytes(change)
        with refused(sh.errors.FileFormatError, file="cloud.pcd"):
            sh.read(tmp_path / "cloud.pcd")


def test_points_without_a_position_are_left_out(tmp_path):
    points = POINTS.copy()
    points[2] = np.nan
    (tmp_path / "cloud.pcd").write_bytes(pcd("binary", points=points))
    np.testing.assert_array_equal(sh.read(tmp_path / "cloud.pcd").points, np.delete(POINTS, 2, axis=0))


@pytest.mark.parametrize("change", [
    lambda content: content[:-9], lambda content: content[:40], lambda content: content.replace(b"x y z", b"u v w"),
    lambda content: content.replace(b"DATA binary", b"DATA binary_compressed"),
    lambda content: content.replace(b"POINTS 7", b"POINTS -7"), lambda content: content.replace(b"TYPE F", b"TYPE Q"),
    lambda content: content.replace(b"DATA binary", b"DATA ascii"),
])  # fmt: skip
def test_odd_files_are_refused(tmp_path, change):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(change(pcd("binary")))
    with refused(sh.errors.FileFormatError, file="cloud.pcd"):
        sh.read(path)
