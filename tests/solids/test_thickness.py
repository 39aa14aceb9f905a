"""`thickness`: widths of walls and gaps that are known."""

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.solids.thickness import thickness


def slab(lower, upper, n=1):
    """A box of 12 n² triangles, facing outwards."""
    u, v = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    corner = np.stack([u.ravel(), v.ravel()], axis=1)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
    square = np.concatenate([corner / n, np.zeros((n * n, 4, 1))], axis=2)
    sides = []
    for axis in range(3):
        for end in (0, 1):
            side = np.roll(square + np.array([0, 0, end]), axis, axis=2)
            sides.append(side if end else side[:, ::-1])
    quads = np.concatenate(sides)
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    vertices = np.asarray(lower) + triangles * (np.asarray(upper, dtype=float) - lower)
    return sh.TriangleMesh(vertices, np.arange(len(vertices)).reshape(-1, 3))


@pytest.mark.parametrize("n", [1, 12])
def test_two_slabs(n):
    """All walls of each slab count, the gap between them too; how fine the triangles are does not matter."""
    found = thickness(samples.union(slab((0, 0, 0), (2, 2, 0.1), n), slab((0, 0, 0.3), (2, 2, 0.35), n)))
    assert found.wall == pytest.approx(0.05)
    assert (found.gap, found.typical_gap) == pytest.approx((0.2, 0.2))
    assert found.spacing == pytest.approx(0.025)


def test_widths_do_not_depend_on_where_and_how_large():
    mesh = samples.torus()
    found = thickness(mesh)
    turned, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    turned *= np.sign(np.linalg.det(turned))
    for scale in (1e-3, 1e30):
        other = thickness(sh.TriangleMesh(scale * mesh.vertices @ turned.T, mesh.faces))
        assert other.wall == pytest.approx(scale * found.wall, rel=0.02)
        assert other.gap == pytest.approx(scale * found.gap, rel=0.1)


def test_a_ball_has_no_gaps_and_a_cavity_no_body():
    ball = thickness(samples.sphere(4, radius=0.5))
    assert ball.gap is None
    assert ball.wall == pytest.approx(1.0, rel=0.05)
    inner = samples.sphere(4, radius=0.9)
    shell = thickness(samples.union(samples.sphere(4), sh.TriangleMesh(inner.vertices, inner.faces[:, ::-1])))
    assert shell.wall == pytest.approx(0.1, rel=0.05)
    assert shell.typical_gap == pytest.approx(1.8, rel=0.05)


def test_folds_copies_and_rounding_are_no_gaps():
    """Faces that share a vertex, and doubled ones that single precision has moved apart."""
    crumpled = thickness(samples.with_noise(samples.sphere(4), 0.05, seed=1))
    assert min(crumpled.wall, crumpled.gap) > 0.02
    slabs = samples.union(slab((0, 0, 0), (2, 2, 0.1), 3), slab((0, 0, 0.3), (2, 2, 0.35), 3))
    noise = np.random.default_rng(0).normal(0, 1e-7, slabs.vertices.shape)
    found = thickness(samples.union(slabs, sh.TriangleMesh(slabs.vertices + noise, slabs.faces)))
    assert (found.wall, found.gap) == pytest.approx((0.05, 0.2), rel=1e-4)


def test_sheets_have_neither():
    flat = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert thickness(flat).spacing is None
