import numpy as np
import pytest

from signedheat.operators.grid import block_method
from signedheat.operators.grid.block_method import SomeNodes
from signedheat.operators.grid.block_multigrid import Multigrid


def shell(n):
    """Nodes near half a sphere, as those of a band are: a sheet with a rim, its nodes in steps."""
    place = np.stack(np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij"), axis=-1)
    near = np.abs(np.linalg.norm(place, axis=-1) - 0.8) < 12 / n
    chosen = near & (place[..., 2] > 0.2)
    nodes = SomeNodes.of(chosen)
    return nodes, place[tuple(nodes.nodes.T)]


def test_the_preconditioner_is_symmetric_and_positive():
    nodes, _ = shell(24)
    apply = Multigrid.of(nodes.nodes, nodes.neighbors, np.array([1.0, 2.0, 0.5]))
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, len(nodes.nodes))).astype(np.float32)
    ab, ba = float(a @ apply(b)), float(b @ apply(a))
    assert ab == pytest.approx(ba, abs=1e-4 * float(np.sqrt((a @ apply(a)) * (b @ apply(b)))))
    for _ in range(5):
        a = rng.normal(size=len(a)).astype(np.float32)
        assert a @ apply(a) > 0


@pytest.mark.parametrize("length", [1e-40, 1e30])
def test_lengths_do_not_matter(length):
    nodes, _ = shell(16)
    right = np.random.default_rng(0).normal(size=len(nodes.nodes)).astype(np.float32)
    steps = np.array([1.0, 0.7, 1.4])
    one, other = (Multigrid.of(nodes.nodes, nodes.neighbors, 1 / (u * steps) ** 2)(right) for u in (1.0, length))
    np.testing.assert_allclose(other / np.abs(other).max(), one / np.abs(one).max(), atol=1e-5)


@pytest.mark.parametrize("n", [24, 48, 72])
def test_iterations_do_not_grow_with_the_nodes(n, monkeypatch):
    monkeypatch.setattr(block_method, "MOST", 12)
    nodes, places = shell(n)
    h = 2 / (n - 1)
    truth = np.linalg.norm(places, axis=1)
    start = np.round(truth / (4 * h)) * 4 * h  # as wrong as a coarse field may be
    phi = nodes.integrate(places / truth[:, None], np.full(3, h), start)
    phi -= (phi - truth).mean()
    assert np.abs(phi - truth).max() < 0.05 * h


def test_parts_apart_and_single_nodes_are_solved_too():
    chosen = np.zeros((24, 9, 9), dtype=bool)
    chosen[:10], chosen[12:22] = True, True
    chosen[23, 4, 4] = True
    nodes = SomeNodes.of(chosen)
    slope = np.array([0.3, -0.5, 0.8])
    linear = nodes.nodes @ slope
    phi = nodes.integrate(np.tile(slope, (len(linear), 1)), np.ones(3), np.zeros(len(linear)))
    assert np.isfinite(phi).all()
    for part in (nodes.nodes[:, 0] < 10, (nodes.nodes[:, 0] >= 12) & (nodes.nodes[:, 0] < 22)):
        away = (phi - linear)[part]
        assert np.ptp(away) < 0.01
