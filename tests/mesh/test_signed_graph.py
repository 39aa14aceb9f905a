"""Signs from pairs, planes from neighbours, points that stand for many."""

import itertools
from itertools import product

import numpy as np
import pytest

from signedheat.mesh.signed_graph import Links, best_signs, signs_of
from signedheat.surfaces.normal_orientation import spread_out
from signedheat.surfaces.plane_fits import CLEAN_NEIGHBORS, fit_planes, least_eigenvector, noise_scale


def random_pairs(rng, n, m):
    tails, heads = rng.integers(n, size=(2, m))
    return tails, heads, rng.random(m)


def agreement(tails, heads, weights, signs):
    return float((weights * signs[tails] * signs[heads])[tails != heads].sum())


@pytest.mark.parametrize("seed", range(5))
def test_pairs_that_agree_are_all_satisfied(seed):
    rng = np.random.default_rng(seed)
    tails, heads, weights = random_pairs(rng, 300, 2000)
    truth = rng.choice([-1.0, 1.0], 300)
    signs = signs_of(Links(tails, heads, weights * truth[tails] * truth[heads]), 300)
    apart = tails != heads
    assert ((signs[tails] * signs[heads]) == (truth[tails] * truth[heads]))[apart].all()


@pytest.mark.parametrize("seed", range(5))
def test_pairs_that_contradict_come_near_the_best(seed):
    """All 2¹⁰ choices tried; and no single sign gains by turning."""
    rng = np.random.default_rng(seed)
    n = 10
    tails, heads, weights = random_pairs(rng, n, 40)
    weights *= rng.choice([-1.0, 1.0], 40)
    signs = signs_of(Links(tails, heads, weights), n)
    found = agreement(tails, heads, weights, signs)
    best = max(agreement(tails, heads, weights, np.array(s)) for s in itertools.product([-1.0, 1.0], repeat=n))
    assert found >= 0.75 * best  # pairs at random contradict each other as much as pairs can
    for node in range(n):
        turned = signs.copy()
        turned[node] *= -1
        assert agreement(tails, heads, weights, turned) <= found + 1e-12


def test_without_pairs_all_signs_are_positive():
    nothing = np.zeros(0, dtype=np.int64)
    np.testing.assert_array_equal(signs_of(Links(nothing, nothing, np.zeros(0)), 3), np.ones(3))


def test_least_eigenvector_is_that_of_lapack():
    rng = np.random.default_rng(0)
    axis = np.empty(3)
    for flatness in (1.0, 1e-2, 1e-5, 0.0):
        for _ in range(50):
            frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            m = frame @ np.diag([flatness * 0.5, 1.0, 1.5]) @ frame.T
            value = least_eigenvector(m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2], axis)
            assert abs(value - 0.5 * flatness) < 1e-7  # half the digits: a cubic's root by its angle
            assert abs(axis @ frame[:, 0]) > 1 - 1e-10


def test_least_eigenvector_of_a_line_is_across_it():
    axis = np.empty(3)
    for line in (np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], np.array([0.6, 0.0, -0.8]), np.array([1.0, 2, 2]) / 3):
        m = np.outer(line, line)
        least_eigenvector(m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2], axis)
        assert np.isclose(np.linalg.norm(axis), 1)
        assert abs(axis @ line) < 1e-6


def test_planes_of_both_sides_of_a_box_are_told_apart():
    rng = np.random.default_rng(0)
    points = np.concatenate([np.c_[rng.random((2000, 2)), np.full(2000, z)] for z in (0.0, 0.03)])
    assert noise_scale(points) is None
    fits = fit_planes(points)
    assert fits.n_neighbors == CLEAN_NEIGHBORS
    assert (np.abs(fits.axes[:, 2]) > 0.999).mean() > 0.99


def test_noise_asks_for_more_neighbors_and_moves_points_to_the_surface():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    assert noise_scale(points) is None
    moved = points + rng.normal(scale=0.02, size=points.shape)
    noisy = fit_planes(moved, noise_scale(moved))
    assert noisy.n_neighbors > CLEAN_NEIGHBORS
    assert np.abs(np.linalg.norm(noisy.points, axis=1) - 1).mean() < 0.5 * 0.02
    assert np.median(np.abs((noisy.axes * points).sum(axis=1))) > np.cos(np.radians(10))


def test_points_that_stand_for_others_are_apart_and_leave_none_alone():
    points = np.random.default_rng(0).random((3000, 3))
    radii = np.where(points[:, 0] < 0.5, 0.1, 0.05)
    kept = spread_out(points, radii)
    gaps = np.linalg.norm(points[:, None] - points[kept], axis=2)
    assert (gaps <= radii[kept]).any(axis=1).all()
    earlier = np.tril(np.ones((len(kept), len(kept)), dtype=bool), -1).T
    assert (gaps[kept].T > radii[kept][:, None])[earlier].all()


@pytest.mark.parametrize("seed", range(20))
def test_best_signs_of_small_matrices_are_the_best(seed):
    rng = np.random.default_rng(seed)
    weights = rng.normal(size=(9, 9)) * (rng.random((9, 9)) < 0.6)
    weights += weights.T
    every = np.array(list(product([-1.0, 1.0], repeat=9)))
    off = weights - np.diag(np.diag(weights))
    best = np.einsum("ki,ij,kj->k", every, off, every).max()
    found = best_signs(weights, np.ones(9))
    assert found @ off @ found >= 0.97 * best
    assert set(found) <= {-1.0, 1.0}
