"""LAS, LAZ and E57: points as other packages write them."""

import struct

import numpy as np
import pytest

import signedheat as sh
from refusals import refused

POINTS = np.random.default_rng(0).uniform(-3, 3, (50, 3)) + np.array([5e5, 5.2e6, 400.0])


@pytest.mark.parametrize("kind", ["las", "laz"])
def test_las(tmp_path, kind):
    laspy = pytest.importorskip("laspy")
    if kind == "laz":
        pytest.importorskip("lazrs")
    path = tmp_path / f"scan.{kind}"
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = POINTS.min(axis=0), np.full(3, 1e-4)
    data = laspy.LasData(header)
    data.x, data.y, data.z = POINTS.T
    data.write(path)
    np.testing.assert_allclose(sh.read(path).points, POINTS, rtol=0, atol=0.6e-4)
    path.write_bytes(path.read_bytes()[:200])
    with refused(sh.errors.FileFormatError):
        sh.read(path)


def test_more_chunks_than_a_laz_file_has_room_for_do_not_end_the_process(tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    path = tmp_path / "scan.laz"
    data = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
    data.x, data.y, data.z = np.random.default_rng(0).normal(size=(3, 50))
    data.write(path)
    changed = bytearray(path.read_bytes())
    (points,) = struct.unpack_from("<I", changed, 96)  # where they begin, with the place of the table of chunks
    (table,) = struct.unpack_from("<q", changed, points)
    assert struct.unpack_from("<II", changed, table) == (0, 1)  # version, chunks
    struct.pack_into("<I", changed, table + 4, 2**32 - 1)
    path.write_bytes(changed)
    with refused(sh.errors.SignedHeatError):
        sh.read(path)


def test_e57_puts_each_scan_into_its_place(tmp_path):
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "scan.e57"
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), np.ascontiguousarray(POINTS.T), strict=True))
    file = pye57.E57(str(path), mode="w")
    file.write_scan_raw(columns)
    file.write_scan_raw(columns, translation=np.array([10.0, 0.0, 0.0]))
    file.close()
    np.testing.assert_allclose(
        sh.read(path).points, np.concatenate([POINTS, POINTS + np.array([10.0, 0, 0])]), atol=1e-6
    )
    path.write_bytes(b"ASTM-E57 and nothing else")
    with refused(sh.errors.FileFormatError):
        sh.read(path)


@pytest.mark.parametrize(("kind", "package"), [("las", "laspy"), ("e57", "pye57")])
def test_a_scan_that_is_not_there(tmp_path, kind, package):
    pytest.importorskip(package)
    with refused(sh.errors.FileFormatError, file=f"scan.{kind}") as caught:
        sh.read(tmp_path / f"scan.{kind}")
    assert not isinstance(caught.value.__cause__, OSError)
