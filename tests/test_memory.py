"""What is free is found, and what cannot fit is refused with what would."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import signedheat as sh
from refusals import refused
from shapes.tet_cases import boxes
from signedheat import compiled, memory, samples
from signedheat.curves.jumping_distance import memory_estimate as piecewise_estimate
from signedheat.grids.grid_discretization import bytes_of_area, fitting_spacing, memory_estimate
from signedheat.memory import available_memory
from signedheat.solids import contouring
from signedheat.surfaces import intrinsic_discretization as intrinsic
from signedheat.tets.lattice import BYTES_PER_LATTICE_TET


def test_some_memory_is_free_but_not_more_than_there_is():
    import os

    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < available_memory() < installed


@pytest.mark.parametrize(("limit", "field"), [("RLIMIT_AS", "VmSize"), ("RLIMIT_DATA", "VmData")])
def test_limits_of_the_process_count(limit, field):
    """In a process of its own, which lowers its limit to 1 GB more than it holds."""
    code = """
import resource, sys, signedheat as sh
from signedheat.memory import available_memory, _fields
held = 1024 * _fields("/proc/self/status")[sys.argv[2]]
resource.setrlimit(getattr(resource, sys.argv[1]), (held + 10**9, resource.RLIM_INFINITY))
assert 0.3e9 < available_memory() <= 1e9, available_memory()
try:
    sh.SignedHeatSolver(sh.Grid((0, 0, 0), 1.0, (400, 400, 400))).discretization
except sh.errors.MemoryLimitError:
    print("refused")
"""
    done = subprocess.run([sys.executable, "-c", code, limit, field], capture_output=True, text=True, check=True)
    assert done.stdout == "refused\n"


def test_the_spacing_that_a_command_tells_fits_under_a_limit(tmp_path):
    """With holes, which is known only once it is read, and which take twice as much as what is closed."""
    samples.without_patches(samples.sphere(4), 4, 0.1).save(tmp_path / "holes.stl")
    code = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (420_000_000, 420_000_000))
from signedheat.cli import main
sys.exit(main(sys.argv[1:]))
"""
    command = [sys.executable, "-c", code, "volume", str(tmp_path / "holes.stl"), "-o", str(tmp_path / "out.npy")]
    told = subprocess.run([*command, "--resolution", "700"], capture_output=True, text=True)
    assert told.returncode == 1 and told.stderr.count("\n") == 1
    spacing = told.stderr.partition("spacing of ")[2].split()[0]
    done = subprocess.run([*command, "--spacing", spacing], capture_output=True, text=True)
    assert done.returncode == 0, (told.stderr, done.stderr)


@pytest.mark.parametrize(
    ("lines", "folder", "names", "cached"),
    [
        ("0::/jobs/17\n", "jobs", ("memory.max", "memory.current"), ""),
        ("4:memory:/jobs/17\n0::/\n", "memory/jobs", ("memory.limit_in_bytes", "memory.usage_in_bytes"), "total_"),
        ("0::/elsewhere/17\n", "", ("memory.max", "memory.current"), ""),
    ],
)
def test_the_limit_of_a_job_counts_whose_files_are_given_back(tmp_path, monkeypatch, lines, folder, names, cached):
    """Of a group around the process's own, of version 2 and 1, and of what a container sees as the whole."""
    group = tmp_path / folder
    (group / "17").mkdir(parents=True)
    (tmp_path / "own").write_text(lines)
    (group / names[0]).write_text("5000\n")
    (group / names[1]).write_text("4000\n")
    (group / "17" / names[0]).write_text("max\n")
    (group / "memory.stat").write_text(f"anon 900\n{cached}inactive_file 2000\n{cached}active_file 1000\n")
    monkeypatch.setattr(memory, "CGROUPS", tmp_path / "own")
    monkeypatch.setattr(memory, "CGROUP_ROOT", tmp_path)
    assert available_memory() == 5000 - 4000 + 3000


@pytest.mark.parametrize("shape", [(10_000, 10_000, 10_000), (20_000, 300, 70_000)])
def test_the_spacing_that_is_proposed_fits(shape):
    grid = sh.Grid((0, 0, 0), (0.1, 0.2, 0.1), shape)
    spacing = fitting_spacing(grid, 8_000_000_000)
    counts = np.floor((grid.upper - grid.origin) / spacing).astype(int) + 1
    fitting = memory_estimate(sh.Grid(grid.origin, spacing, counts))
    assert 0.9 * 8e9 < fitting <= 8e9
    with refused(sh.errors.MemoryLimitError):
        _ = sh.SignedHeatSolver(grid).discretization


def test_libraries_that_others_have_imported_and_nobody_used():
    """Of Numba, what its import leaves to be taken, which is 21 MB less."""
    code = """
import sys, numpy as np, signedheat as sh, memory
from signedheat.memory import libraries
if sys.argv[1] == "imported":
    import numba
plate = sh.TriangleMesh(np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0.02], [0, 2, 0.02]]), [[0, 1, 2], [0, 2, 3]])
before, told = memory.resident("VmRSS"), libraries()
sh.signed_distance(plate, sh.Grid((-1, -1, -1), 0.2, (21, 21, 11)))
print((told - (memory.resident("VmHWM") - before)) / 1e6)
"""
    excess = []
    for how in ("not", "imported"):
        excess.append(float(of_what_is_compiled([sys.executable, "-c", code, how]).stdout))
    assert all(abs(megabytes) < 15 for megabytes in excess), excess


def test_how_much_surface_there_is_counts(monkeypatch):
    """On the same grid, of which one ball takes little."""
    grid = sh.Grid((0, 0, 0), 0.1, (60, 60, 60))
    one = sh.TriangleMesh(BALL.vertices + 3, BALL.faces)
    at = [(x, y, z) for x in (1, 2.2, 3.4, 4.6) for y in (1, 2.2, 3.4, 4.6) for z in (1, 2.2, 3.4, 4.6)]
    many = samples.union(*(sh.TriangleMesh(0.5 * BALL.vertices + place, BALL.faces) for place in at))
    sh.SignedHeatSolver(grid).distance(one)
    free = memory.libraries() + 32 * grid.n_nodes
    monkeypatch.setattr(memory, "_free", lambda: free)
    sh.SignedHeatSolver(grid).distance(one)
    with refused(sh.errors.MemoryLimitError):
        sh.SignedHeatSolver(grid).distance(many)


def test_the_spacing_that_is_proposed_fits_with_the_surface():
    grid, area, free = sh.Grid((0, 0, 0), 0.01, (900, 900, 900)), 200.0, 8_000_000_000
    spacing = fitting_spacing(grid, free, area=area)
    counts = np.floor((grid.upper - grid.origin) / spacing).astype(int) + 1
    fitting = memory_estimate(sh.Grid(grid.origin, spacing, counts)) + bytes_of_area(area, spacing, counts.prod())
    assert 0.9 * free < fitting <= free


BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "memory.py"


def of_what_is_compiled(command):
    """A process that compiled nothing, which takes memory of its own: another one if the first left kernels behind."""
    for _ in range(2):
        before = len(list(compiled.cache_folder().rglob("*.nbc")))
        made = subprocess.run(command, capture_output=True, text=True, check=True, cwd=BENCHMARK.parent)
        if len(list(compiled.cache_folder().rglob("*.nbc"))) == before:
            break
    return made


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("triangles", 90),
        ("polygons", 70),
        ("points", 15_000),
        ("voxels", 56),
        ("tets", 14),
        ("piecewise", 30),
        ("noisy soups", 40),
        ("φ alone, a ball", 128),
        ("φ alone, 64 balls", 128),
    ],
)
def test_estimates_are_near_the_peak_of_a_process_of_its_own(kind, size):
    made = of_what_is_compiled([sys.executable, str(BENCHMARK), kind, str(size)])
    row = json.loads(made.stdout)
    assert 0.75 < row["estimated"] / row["measured"] < 1.3, row


BALL = samples.sphere(3)
INSIDE = sh.TriangleMesh(0.3 * BALL.vertices + 0.5, BALL.faces)
DOMAINS = {
    "triangles": (BALL, lambda d: d.points_at(0)),
    "intrinsic": (sh.intrinsic_delaunay(BALL), lambda d: BALL.points_at(0)),
    "polygons": (sh.PolygonMesh(BALL.vertices, BALL.faces), lambda d: d.points_at(0)),
    "points": (sh.PointCloud(BALL.vertices), lambda d: d.points_at(0)),
    "faces of voxels": (sh.DigitalSurface(np.ones((9, 9, 9), dtype=bool)), lambda d: d.points_at(0)),
    "tets": (boxes((3, 3, 3), 0.3), lambda d: INSIDE),
    "grid": (sh.Grid((-0.4, -0.4, -0.4), 0.1, (17, 17, 17)), lambda d: INSIDE),
}


@pytest.mark.parametrize("name", DOMAINS)
def test_what_does_not_fit_is_refused_and_what_would_is_named(name, monkeypatch):
    domain, source = DOMAINS[name]
    sh.SignedHeatSolver(domain).distance(source(domain))
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 100_000)
    with refused(sh.errors.MemoryLimitError) as caught:
        sh.SignedHeatSolver(domain).distance(source(domain))
    assert any(letter.isdigit() for letter in caught.value.remedy)


def test_piecewise_fields_that_do_not_fit_name_a_number_of_triangles_that_does(monkeypatch):
    half = BALL.path([0, int(BALL.edges.vertices[BALL.edges.vertices[:, 0] == 0][0, 1])])
    free = memory.libraries() + int(piecewise_estimate(BALL.n_faces // 2))
    for surface in (BALL, sh.PolygonMesh(BALL.vertices, BALL.faces), sh.intrinsic_delaunay(BALL)):
        monkeypatch.setattr(memory, "_free", lambda: free)
        with refused(sh.errors.MemoryLimitError) as caught:
            sh.piecewise_distance(half, surface)
        fitting = int(caught.value.remedy.split()[3].replace(",", ""))
        room = (free - memory.libraries()) / memory.REMEDY_MARGIN
        assert piecewise_estimate(fitting) <= room < piecewise_estimate(fitting + 1)


@pytest.mark.parametrize("free", [200e6, 400e6])
def test_lattices_that_do_not_fit_name_a_resolution_that_does(free, monkeypatch):
    monkeypatch.setattr(memory, "_free", lambda: int(free))
    with refused(sh.errors.MemoryLimitError) as caught:
        sh.tetrahedralize(BALL, resolution=120)
    n_tets = sh.tetrahedralize(BALL, resolution=int(float(caught.value.remedy.split()[-1]))).n_tets
    assert 0.4 * free < BYTES_PER_LATTICE_TET * n_tets <= free - memory.libraries()


def test_meshes_that_do_not_fit_are_refused_before_they_are_refined(monkeypatch):
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 2_000_000)
    monkeypatch.setattr(intrinsic, "intrinsic_delaunay", lambda *_, **__: pytest.fail("refined"))
    with refused(sh.errors.MemoryLimitError):
        sh.SignedHeatSolver(BALL, intrinsic=True).distance(BALL.points_at(0))


def test_rows_are_imposed_exactly_only_where_there_is_memory_for_it(monkeypatch):
    """With memory for the default, which takes half as much."""
    grid = sh.Grid.around(BALL, 40)
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 60 * grid.n_nodes)
    sh.SignedHeatSolver(grid).distance(BALL)
    with refused(sh.errors.MemoryLimitError) as caught:
        sh.SignedHeatSolver(grid).distance(BALL, sh.constraints.ZeroSet(hard=True))
    assert "hard=True" in caught.value.remedy


def test_shapes_are_refused_before_their_faces_are_turned(monkeypatch):
    monkeypatch.setattr(memory, "_free", lambda: memory.libraries() + 10_000)
    with refused(sh.errors.MemoryLimitError):
        sh.complete(BALL)


@given(st.integers(1, 10**12), st.floats(0, 1e13), st.floats(0.1, 1e4))
def test_the_largest_number_that_fits_fits(count, available, each):
    found = memory.fitting_count(count, lambda n: each * n, available)
    assert 0 <= found <= count and each * found <= available
    assert found == count or each * (found + 1) > available


def test_lattices_name_the_resolution_that_fits(monkeypatch):
    shape = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 1]], [[0, 1, 2]])
    for grading in (3.0, np.inf):
        with refused(sh.errors.MemoryLimitError) as caught:
            sh.tetrahedralize(shape, resolution=100_000, grading=grading)
        fitting = float(caught.value.remedy.split()[-1])
        assert 20 < fitting < 100_000


TOO_MANY = np.broadcast_to(np.zeros(3), (10**13, 3))
SMALL_BALL = samples.sphere(1)


@pytest.mark.skipif(sys.platform != "linux", reason="others promise any amount of memory")
@pytest.mark.parametrize(
    "call",
    [
        lambda: sh.TriangleMesh(TOO_MANY, [[0, 1, 2]]),
        lambda: sh.complete(SMALL_BALL).distance(TOO_MANY),
        lambda: sh.Field(sh.Grid((0, 0, 0), 1.0, (3, 3, 3)), np.zeros((3, 3, 3)))(TOO_MANY),
        lambda: sh.deviation(TOO_MANY, SMALL_BALL),
        lambda: sh.signed_distance(sh.Polyline([[0, 0], [1, 0], [0, 1]], closed=True), resolution=10**7),
    ],
)
def test_allocations_that_fail_are_memory_limits(call):
    with refused(sh.errors.MemoryLimitError) as caught:
        call()
    assert isinstance(caught.value.__cause__, MemoryError)


def test_surfaces_in_cells_that_are_too_small_are_refused_with_cells_that_fit(monkeypatch):
    monkeypatch.setattr(contouring, "available_memory", lambda: 60_000_000 + memory.libraries())
    with refused(sh.errors.MemoryLimitError) as caught:
        sh.complete(SMALL_BALL).surface(spacing=1e-6)
    fitting = float(caught.value.remedy.rpartition(" ")[2])
    assert 0.01 < fitting < 0.1
    assert len(sh.complete(SMALL_BALL).surface(spacing=fitting).faces) > 1000
