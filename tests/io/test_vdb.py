import zlib

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import sphere
from signedheat.grids.blocks import Blocks
from signedheat.io.vdb import write_vdb

tinyvdb = pytest.importorskip("tinyvdb")


@pytest.fixture(scope="module")
def band():
    grid = sh.Grid((-1.4, 0.1 + 0.2, 1e-9), (0.02, 0.021, 0.019), (145, 150, 160))
    middle = 0.5 * (grid.origin + grid.upper)
    return sh.signed_distance(sphere(1500, center=middle), grid, band=0.1)


def read_back(path):
    """The grid, the voxels of its blocks, and numbers of active voxels, as another program reads them."""
    file = tinyvdb.open(str(path))
    file.read_grids()
    grid = file.grid(0)
    nodes = [grid.tree.node(k) for k in range(grid.tree.num_nodes)]
    blocks = [node for node in nodes if node.type == "leaf"]
    values = np.array([np.frombuffer(block.data, dtype=np.float32).reshape(8, 8, 8) for block in blocks])
    return grid, values, np.array([block.active_voxel_count for block in blocks])


def in_order_of_files(blocks):
    """Rows of blocks by the cubes of 4096 and of 128 voxels that they are in, and by their places."""
    places = 8 * blocks.places.astype(int)
    return np.lexsort([*places.T[::-1], *(places // 128).T[::-1], *(places // 4096).T[::-1]])


@pytest.mark.parametrize("half", [False, True])
def test_bands_are_level_sets(tmp_path, band, half):
    write_vdb(band, tmp_path / "band.vdb", half)
    grid, values, active = read_back(tmp_path / "band.vdb")
    assert grid.metadata["class"] == "level set"
    assert grid.float_background() == pytest.approx(band.domain.width, rel=1e-3)
    assert grid.transform["translation"] == tuple(band.domain.origin)
    assert grid.transform["voxel_size"] == tuple(band.domain.spacing)
    given = band.values[in_order_of_files(band.domain.blocks)]
    np.testing.assert_array_equal(active, (np.abs(given) < band.domain.width).sum(axis=(1, 2, 3)))  # False at NaN
    width = band.domain.width
    expected = np.clip(np.where(np.isnan(given), width, given), -width, width).astype(np.float32)
    np.testing.assert_allclose(values, expected, atol=1e-4 if half else 0)


def test_cubes_without_blocks_are_inside_where_the_coarse_field_is(tmp_path, band):
    """Other readers do not tell."""
    write_vdb(band, tmp_path / "band.vdb")
    data, width = (tmp_path / "band.vdb").read_bytes(), np.float32(band.domain.width)
    cubes = np.unique(8 * band.domain.blocks.places.astype(int) // 128 * 128, axis=0)
    found = []
    for packed in unpacked(data, 16**3):
        found.append(np.frombuffer(packed, dtype="<f4").reshape(16, 16, 16))
    assert len(found) == len(cubes)
    for cube, values in zip(cubes, found, strict=True):
        middles = cube + 8 * np.stack(np.indices((16, 16, 16)), axis=-1) + 3.5
        on_grid = (middles < np.array(band.domain.shape)).all(axis=-1)
        is_tile = on_grid & (values != 0)
        phi = band(band.domain.origin + middles[is_tile] * band.domain.spacing)
        np.testing.assert_array_equal(values[is_tile], np.where(phi < 0, -width, width))
    assert any((values == -width).any() for values in found)


def unpacked(data, count):
    """Blocks of `count` numbers in single precision, packed by zlib, anywhere in the data of a file."""
    at = 0
    while (at := data.find(b"\x06", at) + 1) > 0:
        size = int.from_bytes(data[at : at + 8], "little", signed=True)
        if 0 < size < 4 * count and data[at + 8 : at + 9] == b"\x78":
            try:
                block = zlib.decompress(data[at + 8 : at + 8 + size])
            except zlib.error:
                continue
            if len(block) == 4 * count:
                yield block


def test_large_grids_have_several_top_nodes(tmp_path):
    coarse = sh.Field(sh.Grid((0, 0, 0), 100.0, (101, 3, 3)), np.full((101, 3, 3), 50.0))
    grid = sh.Grid((0, 0, 0), 1.0, (9001, 200, 200))
    blocks = Blocks.of(np.array([[600, 2, 3], [5, 20, 3], [1100, 1, 1], [5, 2, 3]]), grid.shape)
    values = np.random.default_rng(0).normal(size=(4, 8, 8, 8)).astype(np.float32)
    write_vdb(sh.Field(sh.results.Band(grid, blocks, 10.0), values, coarse=coarse), tmp_path / "long.vdb")
    order = in_order_of_files(blocks)
    assert (8 * blocks.places[order]).tolist() == [[40, 16, 24], [40, 160, 24], [4800, 16, 24], [8800, 8, 8]]
    np.testing.assert_array_equal(read_back(tmp_path / "long.vdb")[1], values[order])


def test_dense_fields_keep_single_precision_and_unknown_nodes(tmp_path):
    values = np.random.default_rng(1).normal(size=(21, 9, 140))
    values[3, 4, 5:9] = np.nan
    grid = sh.Grid((0.1 + 0.2, -10 / 3, 1e-9), (0.1, 0.2, 0.3), values.shape)
    sh.Field(grid, values).save(tmp_path / "phi.vdb")
    written, back, active = read_back(tmp_path / "phi.vdb")
    assert written.transform["translation"] == tuple(grid.origin)
    assert written.transform["voxel_size"] == tuple(grid.spacing)
    assert active.sum() == values.size - 4
    whole = np.full((24, 16, 144), np.nan, dtype=np.float32)
    places = 8 * np.argwhere(np.ones((3, 2, 18)))
    places = places[np.lexsort([*places.T[::-1], *(places // 128).T[::-1]])]
    for (i, j, k), block in zip(places, back, strict=True):
        whole[i : i + 8, j : j + 8, k : k + 8] = block
    known = ~np.isnan(values)
    np.testing.assert_array_equal(whole[:21, :9, :140][known], values[known].astype(np.float32))


def test_they_are_not_read_and_nothing_else_is_written(tmp_path, band):
    band.save(tmp_path / "band.vdb")
    with refused(sh.errors.FileFormatError, file="band.vdb"):
        sh.read_field(tmp_path / "band.vdb")
    with refused(sh.errors.FileFormatError, file="band.vti"):
        write_vdb(band, tmp_path / "band.vti")


def test_bands_as_images_have_all_nodes(tmp_path):
    solid = sh.complete(sphere(500))
    band = solid.field(resolution=45, band=0.2)
    band.save(tmp_path / "band.vti")
    image = sh.read_field(tmp_path / "band.vti")
    exact = np.clip(solid.distance(band.domain.points.reshape(-1, 3)).reshape(band.domain.shape), -0.2, 0.2)
    np.testing.assert_allclose(image.values, exact, atol=1e-6)
    np.testing.assert_array_equal(image.domain.spacing, band.domain.spacing)


def test_values_too_large_for_16_bits_and_other_fields_are_refused(tmp_path):
    large = sh.Field(sh.Grid((0, 0, 0), 1.0, (2, 2, 2)), np.full((2, 2, 2), 7e4))
    write_vdb(large, tmp_path / "a.vdb")
    tet = sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    for field in (large, sh.Field(tet, np.zeros(4))):
        with refused(sh.errors.FileFormatError, file="b.vdb"):
            write_vdb(field, tmp_path / "b.vdb", half=True)
