import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from shapes.grid_cases import assert_closed_manifold, sphere
from signedheat.extensions import band_grids, band_memory, band_plan
from signedheat.extensions.band_stores import TilesComputed

pytest.importorskip("zarr")

RESOLUTION, BAND = 150, 0.05


def holed():
    whole = sphere(1500)
    centres = whole.vertices[whole.faces].mean(axis=1)
    return sh.TriangleMesh(whole.vertices, whole.faces[(centres @ np.array([0.6, 0.0, 0.8])) < 0.9])


@pytest.fixture(scope="module")
def single():
    return sh.solid_distance(holed(), resolution=RESOLUTION, band=BAND)


def assert_same(band, single):
    np.testing.assert_array_equal(band.blocks.places, single.blocks.places)
    np.testing.assert_array_equal(band.values, single.values)
    np.testing.assert_array_equal(band.confidence, single.confidence)


def test_tiles_give_the_same_bits_and_seams_are_closed(tmp_path, single):
    band = sh.tiled_distance(holed(), tmp_path / "store", resolution=RESOLUTION, band=BAND)
    assert_same(band, single)
    assert len(list((tmp_path / "store" / "tiles").iterdir())) == 8
    for level in (0.0, 0.04):
        assert_closed_manifold(band.contour(level))
    note = band.diagnostics.note(TilesComputed)
    assert (note.tiles, note.reused) == (8, 0)
    points = np.random.default_rng(0).normal(size=(200, 3))
    np.testing.assert_array_equal(band(points), single(points))


def test_a_run_goes_on_where_it_was_stopped(tmp_path, single):
    store = tmp_path / "store"

    def stop(fraction, step):
        if step == "tiles" and fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sh.tiled_distance(holed(), store, resolution=RESOLUTION, band=BAND, progress=stop)
    done = sorted(store.glob("tiles/*/zarr.json"))
    torn = done[0].parent
    for each in torn.glob("values/c/*"):  # as a killed process leaves it
        each.unlink() if each.is_file() else None
    done[0].write_text(json.dumps({"attributes": {}, "zarr_format": 3, "node_type": "group"}))
    band = sh.tiled_distance(holed(), store, resolution=RESOLUTION, band=BAND)
    assert_same(band, single)
    assert 0 < band.diagnostics.note(TilesComputed).reused < 8
    with refused(sh.FileFormatError, file="store"):
        sh.tiled_distance(holed(), store, resolution=RESOLUTION + 10, band=BAND)


def test_processes_give_the_same_bits(tmp_path, single):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        band = sh.tiled_distance(holed(), tmp_path / "store", resolution=RESOLUTION, band=BAND, scheduler=pool)
    assert_same(band, single)
    assert band.diagnostics.note(TilesComputed).peak_memory > 1e7


def test_another_shape_in_the_same_folder_is_not_taken_for_the_first(tmp_path):
    store = tmp_path / "store"
    for radius in (1.0, 0.5):
        ball = sphere(300, radius)
        grid = sh.Grid((-1.3,) * 3, 2.6 / 32, (33,) * 3)
        band = sh.tiled_distance(ball, store, grid, band=0.2)
        assert abs(band([[radius + 0.05, 0.0, 0.0]])[0] - 0.05) < 0.02
        shutil.rmtree(store)


def test_points_without_normals_go_in_tiles_too(tmp_path):
    points = np.random.default_rng(0).normal(size=(600, 3))
    cloud = sh.PointCloud(points / np.linalg.norm(points, axis=1, keepdims=True))
    grid = sh.Grid((-1.3,) * 3, 2.6 / 32, (33,) * 3)
    band = sh.tiled_distance(cloud, tmp_path / "store", grid, band=0.2)
    assert_same(band, sh.solid_distance(cloud, grid, band=0.2))
    with refused(sh.FileFormatError, file="store"):
        sh.tiled_distance(sh.PointCloud(cloud.points[1:]), tmp_path / "store", grid, band=0.1)


@pytest.fixture
def steep(monkeypatch):
    """Grids as those of thousands of nodes: 8 of them for each of the coarse grid, and a band between the two."""
    monkeypatch.setattr(band_grids, "FEWEST", 10)
    monkeypatch.setattr(band_grids, "MOST", 20)
    monkeypatch.setattr(band_grids, "STEEPEST", 8)


def test_far_finer_bands_have_one_between_and_come_as_near_to_the_truth(steep, tmp_path):
    band = sh.solid_distance(holed(), resolution=88, band=BAND)
    whole = sh.solid_distance(holed(), resolution=88)
    h = float(band.grid.spacing[0])
    assert band.coarse.grid.spacing[0] == pytest.approx(8 * h)
    points = band.grid.origin + (band.blocks.places[:, None] * 8 + [[1, 4, 6], [5, 2, 3]]).reshape(-1, 3) * h
    truth = np.linalg.norm(points, axis=1) - 1
    points, truth = points[np.abs(truth) < 3 * h], truth[np.abs(truth) < 3 * h]
    error, other = (np.sqrt(np.mean((field(points) - truth) ** 2)) for field in (band, whole))
    assert error < 1.15 * other
    wrong = [((field(points) < 0) != (truth < 0)).mean() for field in (band, whole)]
    assert wrong[0] < 1.15 * wrong[1]
    assert_closed_manifold(band.contour())
    store = tmp_path / "store"

    def stop(fraction, step):
        if step == "tiles":  # of the band between
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sh.tiled_distance(holed(), store, resolution=88, band=BAND, progress=stop)
    with refused(sh.FileFormatError, file="between"):
        sh.tiled_distance(holed(), store, resolution=89, band=BAND)
    assert_same(sh.tiled_distance(holed(), store, resolution=88, band=BAND), band)


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler in a process of its own, and its two workers, each with 2 GB."""
    pytest.importorskip("distributed")
    environment = {**os.environ, "NUMBA_NUM_THREADS": "1", "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "5"}
    address = tmp_path / "scheduler.json"
    processes = []

    def start(kind, *options):
        command = [sys.executable, "-W", "ignore", "-m", f"distributed.cli.dask_{kind}", *options]
        with open(os.devnull, "w") as nowhere:
            processes.append(subprocess.Popen(command, env=environment, stdout=nowhere, stderr=nowhere, cwd=tmp_path))

    try:
        start("scheduler", "--scheduler-file", str(address), "--port", "0", "--no-dashboard")
        for _ in range(2):
            options = "--nthreads", "1", "--memory-limit", "2GB", "--no-nanny", "--no-dashboard"
            start("worker", "--scheduler-file", str(address), *options)
        deadline = time.monotonic() + 90
        while not address.exists():
            assert time.monotonic() < deadline
            time.sleep(0.2)
        yield json.loads(address.read_text())["address"], processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_cluster_whose_worker_is_killed_gives_the_same_bits(tmp_path, single, cluster):
    where, workers = cluster
    killed = []

    def kill(fraction, step):
        if step == "tiles" and not killed:
            killed.append(fraction)
            workers[0].send_signal(signal.SIGKILL)

    store = Path(tmp_path) / "store"
    band = sh.tiled_distance(holed(), store, resolution=RESOLUTION, band=BAND, scheduler=where, progress=kill)
    assert killed
    assert_same(band, single)


CLIENT = """
import numpy as np, sys, signedheat as sh
mesh = np.load(sys.argv[1])
sh.tiled_distance(
    sh.TriangleMesh(mesh["vertices"], mesh["faces"]), sys.argv[2], resolution=int(sys.argv[3]), band=float(sys.argv[4]),
    scheduler=sys.argv[5],
)
"""


def killed_in_between(folder, mesh, resolution, band, where, tiles):
    """Run a client in a process of its own, which is killed when so many tiles are done; then go on in this one."""
    store = folder / "store"
    np.savez(folder / "mesh.npz", vertices=mesh.vertices, faces=mesh.faces)
    arguments = [str(folder / "mesh.npz"), str(store), str(resolution), str(band), where]
    client = subprocess.Popen([sys.executable, "-W", "ignore", "-c", CLIENT, *arguments])
    try:
        while client.poll() is None and len(list(store.glob("tiles/*/zarr.json"))) < tiles:
            time.sleep(0.05)
    finally:
        client.send_signal(signal.SIGKILL)
        client.wait()
    return sh.tiled_distance(mesh, store, resolution=resolution, band=band, scheduler=where)


@pytest.mark.slow
def test_a_client_that_is_killed_goes_on_when_it_is_started_again(tmp_path, single, cluster):
    band = killed_in_between(tmp_path, holed(), RESOLUTION, BAND, cluster[0], 2)
    assert_same(band, single)
    assert band.diagnostics.note(TilesComputed).reused >= 2


@pytest.mark.slow
def test_workers_of_2_gb_compute_what_would_take_8_on_a_whole_grid(tmp_path, cluster):
    """512³ nodes of a broken shape at 64 bytes each; the client is killed and started again on the way."""
    whole = sphere(20_000)
    centres = whole.vertices[whole.faces].mean(axis=1)
    mesh = sh.TriangleMesh(whole.vertices, whole.faces[(centres @ np.array([0.6, 0.0, 0.8])) < 0.97])
    band = killed_in_between(tmp_path, mesh, 512, 0.02, cluster[0], 8)
    note = band.diagnostics.note(TilesComputed)
    assert note.reused >= 8
    assert 1e8 < note.peak_memory < 2e9
    points = np.random.default_rng(0).normal(size=(2000, 3))
    points *= 1.01 / np.linalg.norm(points, axis=1, keepdims=True)
    points = points[points @ np.array([0.6, 0.0, 0.8]) < 0.9]
    np.testing.assert_allclose(band(points), 0.01, atol=3e-4)  # 20,000 points: faces lie up to 2e-4 within the sphere


def test_tiles_beyond_the_disk_are_refused_before_any_is_computed(tmp_path):
    with refused(sh.MemoryLimitError) as caught:
        sh.tiled_distance(holed(), tmp_path / "new" / "tiles", spacing=1e-9, band=1e-3)
    assert "disk" in caught.value.cause
    assert float(re.search(r"spacing of ([0-9.e-]+)", caught.value.remedy).group(1)) > 1e-9
    assert not (tmp_path / "new").exists()


def test_tiles_whose_work_does_not_fit_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(band_memory, "available_memory", lambda: 150_000_000)
    with refused(sh.MemoryLimitError) as caught:
        sh.tiled_distance(holed(), tmp_path, resolution=RESOLUTION, band=BAND)
    assert "at a time" in caught.value.cause


def test_tiles_are_found_in_a_box_of_a_trillion_of_them():
    speck = box([0.5, 0.5, 0.5], [0.5001, 0.5001, 0.5001])
    coarse = sh.solid_distance(speck, sh.Grid(np.zeros(3), np.full(3, 1 / 32), (33, 33, 33)))
    plan = band_plan.plan_band(coarse, sh.Grid(np.zeros(3), coarse.grid.spacing / 2**15, (2**20 + 1,) * 3), 1e-5)
    assert 1 <= len(plan.tiles) <= 64
    middle = (plan.tiles + 0.5) * band_plan.TILE * plan.steps
    assert np.linalg.norm(middle - 0.50005, axis=1).max() < 5e-4
