"""Soft constraints on grids, for any weight: between none and hard ones."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.surface_cases import sphere

LINE = sh.Polyline([[-1, -1], [1, -1], [1, 0.9], [0.4, 1.2]])
BALL = sphere(1)
CASES = {
    "plane": (sh.Grid((-2, -2), 0.25, (17, 17)), LINE),
    "space": (sh.Grid.around(BALL.bounds, 9), sh.TriangleMesh(BALL.vertices, BALL.faces[10:])),
    "oblong": (sh.Grid((-2, -2), (0.02, 500.0), (200, 5)), LINE),
}


@pytest.mark.parametrize("name", CASES)
def test_weights_have_limits_on_both_ends(name):
    grid, shape = CASES[name]
    solver = sh.SignedHeatSolver(grid)
    free, hard = (
        solver.distance(shape, sh.constraints.Free()).values,
        solver.distance(shape, sh.constraints.ZeroSet(hard=True)).values,
    )
    reach = np.ptp(free)
    for weak in (1e-300, 1e-100, 1e-12):
        np.testing.assert_allclose(solver.distance(shape, sh.constraints.Soft(weak)).values, free, atol=1e-5 * reach)
    for strong in (1e12, 1e300):
        np.testing.assert_array_equal(solver.distance(shape, sh.constraints.Soft(strong)).values, hard)


@pytest.mark.parametrize("weight", [1e-6, 1e-3, 1.0, 100.0, 1000.0])
def test_the_equation_is_solved(weight):
    """Against a dense solution of ``(C + λ Aᵀ W A) φ = b``; conjugate gradients stop at 1e-6."""
    grid, shape = CASES["plane"]
    discretization = sh.SignedHeatSolver(grid).discretization
    adapted, groups = discretization.adapt([shape])
    source = adapted.lower(groups, 1.0)
    from signedheat.grids.stencil import laplacian
    from signedheat.method import diffuse, normalize

    load = adapted.divergence(normalize(adapted, diffuse(adapted, source)))
    volume, n = float(np.prod(grid.spacing)), grid.n_nodes
    stiffness = np.stack([laplacian(e.reshape(grid.shape), grid.spacing).ravel() for e in np.eye(n)], axis=1)
    rows = source.interpolation.toarray()
    pull = rows.T @ (source.weights[:, None] / volume * rows)
    expected = np.linalg.solve(stiffness + weight * pull, load.ravel() - load.mean()).reshape(grid.shape)
    found = adapted.integration.penalize(load, source, weight)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.ptp(expected))


def test_samples_that_nearly_coincide_stay_within_reason():
    """In one cell of a coarse grid: their levels contradict each other, as far as the grid can tell."""
    grid = sh.Grid((-3e12, -4e12, -2e12), 1e12, (7, 8, 6))
    phi = sh.SignedHeatSolver(grid).distance([BALL, sphere(0)], sh.constraints.ZeroSet(hard=True))
    assert np.abs(phi.values).max() < 1e14
