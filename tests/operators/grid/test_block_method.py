import numpy as np
from scipy.spatial import cKDTree

from signedheat.operators.grid.block_method import SomeNodes
from signedheat.operators.grid.stencil import divergence, solve_poisson


def test_on_a_whole_box_poisson_is_that_of_the_grid():
    rng = np.random.default_rng(0)
    shape, steps = (9, 12, 10), np.array([0.1, 0.2, 0.15])
    directions = rng.normal(size=(*shape, 3))
    nodes = SomeNodes.of(np.ones(shape, dtype=bool))
    phi = nodes.integrate(directions[tuple(nodes.nodes.T)], steps, np.zeros(np.prod(shape)))
    expected = solve_poisson(divergence(directions.astype(np.float32), steps), steps)
    phi, expected = phi - phi.mean(), (expected - expected.mean())[tuple(nodes.nodes.T)]
    np.testing.assert_allclose(phi, expected, atol=1e-2 * np.abs(expected).max())


def test_gradients_of_a_function_give_it_back_on_any_nodes():
    rng = np.random.default_rng(1)
    steps = np.array([0.1, 0.1, 0.2])
    chosen = rng.random((14, 15, 13)) < 0.8
    nodes = SomeNodes.of(chosen)
    slope = np.array([0.3, -0.5, 0.8])
    linear = nodes.nodes * steps @ slope
    start = linear + rng.normal(size=len(linear))
    phi = nodes.integrate(np.tile(slope, (len(linear), 1)), steps, start)
    graph = nodes.neighbors
    differences = [(phi - linear)[graph[:, s]] - (phi - linear) for s in range(6)]
    for side, difference in enumerate(differences):  # a constant on each connected part
        assert np.abs(difference[graph[:, side] >= 0]).max() < 2e-3


def test_diffusion_solves_its_equation_as_far_as_it_has_come():
    nodes = SomeNodes.of(np.ones((20, 18, 16), dtype=bool))
    rng = np.random.default_rng(2)
    sources = np.zeros((len(nodes.nodes), 4))
    which = rng.choice(len(sources), 30)
    sources[which] = rng.normal(size=(30, 4))
    ratios = np.array([1.0, 0.7, 1.3])
    x = nodes.diffuse(sources, ratios, 24)
    image = x.copy()
    for side in range(6):
        there = nodes.neighbors[:, side] >= 0
        image[there] += ratios[side // 2] * (x[there] - x[nodes.neighbors[there, side]])
    near = cKDTree(nodes.nodes[which]).query(nodes.nodes)[0] < 8
    scale = np.abs(x).max(axis=1, keepdims=True)
    assert (np.abs(image - sources)[near] / scale[near]).max() < 2e-2


def test_what_is_spread_is_read_again():
    rng = np.random.default_rng(3)
    nodes = SomeNodes.of(np.ones((8, 8, 8), dtype=bool))
    places = rng.uniform(0, 7, (50, 3))
    values = rng.normal(size=(50, 4))
    spread = nodes.splat(places, values)
    np.testing.assert_allclose(spread.sum(axis=0), values.sum(axis=0), atol=1e-12)
    np.testing.assert_allclose((nodes.nodes.T @ spread), places.T @ values, atol=1e-12)  # first moments
    linear = nodes.nodes @ np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(nodes.at(linear, places), places @ np.array([1.0, -2.0, 0.5]), atol=1e-12)
