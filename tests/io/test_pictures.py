"""Pictures as masks: every packing is read, and one that lacks pixels is not."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from refusals import refused

Image = pytest.importorskip("PIL.Image")
PACKINGS = [
    ("png", {}), ("bmp", {}), ("tif", {}), ("tif", {"compression": "tiff_lzw"}),
    ("tif", {"compression": "tiff_deflate"}), ("tif", {"compression": "group4"}),
]  # fmt: skip


@pytest.mark.parametrize(("ending", "options"), PACKINGS)
def test_every_packing_is_read(tmp_path, ending, options):
    is_free = np.ones((40, 600), dtype=bool)
    is_free[:3, 100:] = False
    Image.fromarray(is_free).save(tmp_path / f"mask.{ending}", **options)
    grid = sh.io.read_mask(tmp_path / f"mask.{ending}")
    assert grid.shape == (600, 40)
    np.testing.assert_array_equal(grid.mask, ~is_free[::-1].T)


@pytest.mark.parametrize("announced", [41, 1 << 24])
def test_one_that_lacks_pixels_is_refused(tmp_path, announced):
    path = tmp_path / "mask.tif"
    Image.fromarray(np.ones((40, 60), dtype=np.uint8)).save(path)
    data = path.read_bytes()
    entry = data.index(b"\x01\x01\x04\x00\x01\x00\x00\x00")  # its height, in two bytes or in four
    path.write_bytes(data[: entry + 8] + announced.to_bytes(4, "little") + data[entry + 12 :])
    with refused(sh.errors.FileFormatError, file="mask.tif"):
        sh.io.read_mask(path)


@pytest.mark.parametrize("packing", ["tiff_lzw", "tiff_deflate", "group4"])
def test_damaged_tiffs_are_refused_and_their_library_is_not_heard(tmp_path, capfd, packing):
    """It goes on after an error, and writes to standard error by its number."""
    pixels = np.random.default_rng(0).random((64, 64)) > 0.5
    image = Image.fromarray(pixels if packing == "group4" else np.uint8(255) * pixels)
    image.save(tmp_path / "good.tif", compression=packing)
    data = bytearray((tmp_path / "good.tif").read_bytes())
    sh.io.read_mask(tmp_path / "good.tif")
    data[100:160] = 60 * b"\xff"
    (tmp_path / "bad.tif").write_bytes(data)
    with refused(sh.errors.FileFormatError, file="bad.tif"):
        sh.io.read_mask(tmp_path / "bad.tif")
    assert capfd.readouterr().err == ""
