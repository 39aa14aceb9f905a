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
    return header.encode() + table.astype(f"<f{size}").tobytes()


@pytest.mark.parametrize("data", ["ascii", "binary"])
@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("size", ["4", "8"])
def test_points_are_read(tmp_path, data, normals, size):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(pcd(data, normals, size=size))
    cloud = sh.read(path)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert (cloud.normals is not None) == normals


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
