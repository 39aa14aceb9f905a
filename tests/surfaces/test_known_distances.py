"""Distance on surfaces where it is known in closed form."""

import numpy as np
import pytest

import signedheat as sh
from shapes.surface_cases import sphere, square
from shapes.surfaces import disk, surface_of_revolution

constraints = [
    sh.constraints.Free(),
    sh.constraints.ZeroSet(),
    sh.constraints.EachComponent(),
    sh.constraints.LevelValues([0.0]),
    sh.constraints.Soft(5.0),
]


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def order(errors, ratio=2.0):
    """Slope of log error against log h."""
    return float(np.polyfit(-np.log(ratio) * np.arange(len(errors)), np.log(errors), 1)[0])


@pytest.mark.parametrize("constraint", constraints, ids=repr)
@pytest.mark.parametrize("diffusion", [1.0, 100.0])
@pytest.mark.parametrize("mesh", [square(21, jitter=0.3), disk(12)], ids=["square", "disk"])
def test_a_straight_line_is_exact_up_to_slanted_boundaries(mesh, constraint, diffusion):
    """In the plane X is a multiple of one vector, so Y is exact; nothing may bend the level sets at the boundary."""
    height = mesh.vertices @ [0.6, 0.8, 0.0]
    phi = sh.SignedHeatSolver(mesh, diffusion, intrinsic=False).distance(mesh.level_set(height, 0.1), constraint).values
    np.testing.assert_allclose(phi, height - 0.1, atol=1e-11)


def cylinder_error(n):
    mesh = surface_of_revolution(lambda z: np.ones_like(z), 2.0, 3 * n, n)
    return rms(distance_to_parallel(mesh, 0.9) - (mesh.vertices[:, 2] - 0.9))


def frustum_error(n):
    mesh = surface_of_revolution(lambda z: 1 + 0.5 * z, 2.0, 4 * n, n)
    return rms(distance_to_parallel(mesh, 0.9) - np.hypot(1, 0.5) * (mesh.vertices[:, 2] - 0.9))


def distance_to_parallel(mesh, height):
    return sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.level_set(mesh.vertices[:, 2], height)).values


def disk_error(n):
    mesh = disk(n)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    phi = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.level_set(radius**2, 0.55**2)).values
    return rms(phi - (radius - 0.55))


def small_circle_error(n):
    mesh = sphere(int(np.log2(n)))
    z = mesh.vertices[:, 2]
    phi = sh.SignedHeatSolver(mesh, intrinsic=False).distance(mesh.level_set(z, 0.4)).values
    return rms(phi - (np.arcsin(np.clip(z, -1, 1)) - np.arcsin(0.4)))


@pytest.mark.parametrize("error", [cylinder_error, frustum_error, disk_error, small_circle_error])
def test_first_order_convergence(error):
    errors = [error(n) for n in (8, 16, 32)]
    assert order(errors) >= 0.9
    assert errors[-1] < 0.02


@pytest.mark.parametrize("tau", [0.2, 1.0])
@pytest.mark.parametrize("start", [0, 700])
def test_distance_goes_on_where_vectors_underflow(tau, start):
    """On a strip 2000 edges long |X| falls through several ranges of floating-point numbers."""
    n = 2000
    i = 2 * np.arange(n)
    points = np.stack([np.repeat(np.arange(n + 1.0), 2), np.tile([0.0, 1.0], n + 1), np.zeros(2 * n + 2)], axis=1)
    mesh = sh.TriangleMesh(points, np.concatenate([i[:, None] + [0, 2, 1], i[:, None] + [1, 2, 3]]))
    phi = sh.SignedHeatSolver(mesh, tau, intrinsic=False).distance(mesh.path([2 * start, 2 * start + 1])).values
    np.testing.assert_allclose(phi, start - points[:, 0], atol=1e-5)  # C has condition n², and φ the size n


def test_underflow_behind_two_fronts():
    """The far end of each arm of a cross is reached on its own, by waves of different strength."""
    n, pieces, faces = 700, [], []
    for k, (reach, direction) in enumerate([(n, [1, 0, 0]), (n, [0, 1, 0])]):
        i = 2 * np.arange(reach)
        along, across = np.repeat(np.arange(reach + 1.0), 2), np.tile([-0.5, 0.5], reach + 1) * (1 + k)
        pieces.append(np.outer(along, direction) + np.outer(across, [direction[1], direction[0], 0]) + [0, 0, k])
        faces.append(k * 2 * (n + 1) + np.concatenate([i[:, None] + [0, 2, 1], i[:, None] + [1, 2, 3]]))
    mesh = sh.TriangleMesh(np.concatenate(pieces), np.concatenate(faces))
    sources = [mesh.path([0, 1]), mesh.path([2 * (n + 1), 2 * (n + 1) + 1])]
    phi = sh.SignedHeatSolver(mesh, intrinsic=False).distance(sources).values
    np.testing.assert_allclose(np.abs(phi), np.tile(np.repeat(np.arange(n + 1.0), 2), 2), atol=1e-5)


def fan(n=400):
    """A disc as a cap of CAD is triangulated: slivers from one of its vertices."""
    around = np.linspace(0, 2 * np.pi, n, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    return sh.TriangleMesh(rim, [[0, k, k + 1] for k in range(1, n - 1)])


def needles(n=90, m=6):
    """A square of right-angled triangles fifteen times as long as wide."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, m + 1))
    a = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)])
    return sh.TriangleMesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), faces)


@pytest.mark.parametrize("mesh", [fan(), needles()], ids=["fan", "needles"])
@pytest.mark.parametrize("centre, radius, bound", [((0.2, 0.1), 0.2, 0.04), ((-0.1, 0.15), 0.5, 0.01)])
def test_triangles_of_cad_meshes(mesh, centre, radius, bound):
    """The default refines fans and needles, and not for their angles alone: a circle is larger than its triangles."""
    steps = np.linspace(0, -2 * np.pi, 80, endpoint=False)
    circle = np.stack([centre[0] + radius * np.cos(steps), centre[1] + radius * np.sin(steps), 0 * steps], axis=1)
    curve = mesh.polyline(circle, closed=True)
    truth = np.linalg.norm(mesh.vertices[:, :2] - centre, axis=1) - radius
    default, plain = (
        rms(sh.SignedHeatSolver(mesh, intrinsic=intrinsic).distance(curve).values - truth) / np.ptp(truth)
        for intrinsic in ("auto", False)
    )
    assert default < bound and default < 0.25 * plain
