import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.grid_cases import sphere
from signedheat.io.vdb import read_vdb, write_vdb


@pytest.fixture(scope="module")
def band():
    grid = sh.Grid((-1.4, 0.1 + 0.2, 1e-9), (0.02, 0.021, 0.019), (145, 150, 160))
    middle = 0.5 * (grid.origin + grid.upper)
    return sh.signed_distance(sphere(1500, center=middle), grid, band=0.1)


def blocks_of_tinyvdb(path):
    """Voxels and numbers of active ones, block after block, as another implementation of the format reads them."""
    tinyvdb = pytest.importorskip("tinyvdb")
    with_blocks = tinyvdb.open(str(path))
    with_blocks.read_grids()
    grid = with_blocks.grid(0)
    nodes = [grid.tree.node(k) for k in range(grid.tree.num_nodes)]
    blocks = [node for node in nodes if node.type == "leaf"]
    values = [np.frombuffer(block.data, dtype=np.float32).reshape(8, 8, 8) for block in blocks]
    return grid, np.array(values), np.array([block.active_voxel_count for block in blocks])


@pytest.mark.parametrize("half", [False, True])
def test_bands_are_level_sets(tmp_path, band, half):
    write_vdb(band, tmp_path / "band.vdb", half)
    back = read_vdb(tmp_path / "band.vdb")
    assert back.metadata["class"] == "level set"
    assert back.background == pytest.approx(band.width, rel=1e-3)
    np.testing.assert_array_equal(back.origin, band.grid.origin)
    np.testing.assert_array_equal(back.spacing, band.grid.spacing)
    rows = band.blocks.rows(back.places // 8)
    assert sorted(rows.tolist()) == list(range(len(band.blocks)))
    values = band.values[rows]
    np.testing.assert_array_equal(back.active, np.abs(values) < band.width)  # False at NaN
    expected = np.clip(np.where(np.isnan(values), band.width, values), -band.width, band.width).astype(np.float32)
    np.testing.assert_allclose(back.values, expected, atol=1e-4 if half else 0)
    assert {round(tile[2], 3) for tile in back.tiles} == {-0.1}  # what is inside, and no block
    for place, size, _ in back.tiles:
        assert band.coarse(band.grid.origin + (place + 0.5 * (size - 1)) * band.grid.spacing) < -band.width / 2
    grid, others, active = blocks_of_tinyvdb(tmp_path / "band.vdb")
    np.testing.assert_array_equal(others, back.values)
    np.testing.assert_array_equal(active, back.active.sum(axis=(1, 2, 3)))
    assert grid.float_background() == np.float32(back.background)
    assert grid.transform["translation"] == tuple(band.grid.origin)
    assert grid.transform["voxel_size"] == tuple(band.grid.spacing)


def test_large_grids_have_several_top_nodes(tmp_path):
    coarse = sh.GridField(sh.Grid((0, 0, 0), 100.0, (101, 3, 3)), np.full((101, 3, 3), 50.0))
    from signedheat.operators.grid.blocks import Blocks

    grid = sh.Grid((0, 0, 0), 1.0, (9001, 200, 200))
    blocks = Blocks.of(np.array([[600, 2, 3], [5, 20, 3], [1100, 1, 1], [5, 2, 3]]), grid.shape)
    values = np.random.default_rng(0).normal(size=(4, 8, 8, 8)).astype(np.float32)
    write_vdb(sh.GridField(grid, values, blocks=blocks, coarse=coarse, width=10.0), tmp_path / "long.vdb")
    back = read_vdb(tmp_path / "long.vdb")
    assert back.places.tolist() == [[40, 16, 24], [40, 160, 24], [4800, 16, 24], [8800, 8, 8]]
    np.testing.assert_array_equal(back.values, values[blocks.rows(back.places // 8)])
    np.testing.assert_array_equal(blocks_of_tinyvdb(tmp_path / "long.vdb")[1], back.values)


def test_dense_fields_keep_single_precision_and_unknown_nodes(tmp_path):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(21, 9, 140))
    values[3, 4, 5:9] = np.nan
    phi = sh.GridField(sh.Grid((1, 2, 3), (0.1, 0.2, 0.3), values.shape), values)
    phi.save(tmp_path / "phi.vdb")
    back = read_vdb(tmp_path / "phi.vdb")
    assert back.active.sum() == values.size - 4
    _, others, active = blocks_of_tinyvdb(tmp_path / "phi.vdb")
    np.testing.assert_array_equal(others, back.values)
    np.testing.assert_array_equal(active, back.active.sum(axis=(1, 2, 3)))
    known = ~np.isnan(values)
    np.testing.assert_array_equal(sh.load_field(tmp_path / "phi.vdb").values[known], values[known].astype(np.float32))


def test_bands_come_back_as_fields(tmp_path, band):
    band.save(tmp_path / "band.vdb")
    back = sh.load_field(tmp_path / "band.vdb")
    assert back.grid.shape == band.grid.shape
    expected = np.clip(band.dense().values, -band.width, band.width)
    np.testing.assert_allclose(back.values, expected, atol=0.02)  # the coarse field decides what lies beyond
    assert ((back.values < 0) == (expected < 0)).all()


def test_damaged_files_are_refused(tmp_path, band):
    band.save(tmp_path / "band.vdb")
    data = (tmp_path / "band.vdb").read_bytes()
    for length in (5, 60, 400, len(data) // 2, len(data) - 1):
        (tmp_path / "cut.vdb").write_bytes(data[:length])
        with refused(sh.errors.FileFormatError, file="cut.vdb"):
            sh.load_field(tmp_path / "cut.vdb")
    with refused(sh.errors.FileFormatError, file="band.vti"):
        write_vdb(band, tmp_path / "band.vti")


def test_bands_as_images_have_all_nodes(tmp_path):
    solid = sh.complete(sphere(500))
    band = solid.field(resolution=45, band=0.2)
    band.save(tmp_path / "band.vti")
    image = sh.load_field(tmp_path / "band.vti")
    exact = np.clip(solid.distance(band.grid.points.reshape(-1, 3)).reshape(band.grid.shape), -0.2, 0.2)
    np.testing.assert_allclose(image.values, exact, atol=1e-6)
    np.testing.assert_array_equal(image.grid.spacing, band.grid.spacing)
