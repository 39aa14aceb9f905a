import os

import numpy as np
import pytest
from numba import njit
from scipy.sparse import diags, eye, kron
from scipy.sparse.linalg import spsolve

import signedheat as sh
from shapes.grid_cases import box, rms, sphere
from signedheat.discretization import discretize
from signedheat.grids.multilevel import diffuse_by_sweeps
from signedheat.grids.node_sources import NodeSources
from signedheat.grids.stencil import divergence, laplacian, solve_poisson
from signedheat.mesh.unit_vectors import unit


def path_laplacian(n):
    if n == 1:
        return diags([np.zeros(1)], [0])
    main = np.full(n, 2.0)
    main[[0, -1]] = 1.0
    return diags([main, -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1])


@pytest.mark.parametrize("shape", [(1, 7, 9, 21), (1, 1, 6, 13), (3, 4, 5, 6), (1, 1, 1, 30)])
def test_sweeps_converge_to_the_direct_solution_in_any_dimension(shape):
    rng = np.random.default_rng(0)
    ratios = rng.uniform(0.3, 2.0, 4) * (np.array(shape) > 1)
    sources = (rng.random((*shape, 4)) * (rng.random(shape) < 0.1)[..., None]).astype(np.float32)
    nodes = np.flatnonzero(sources.any(axis=-1))[:, None]
    given = NodeSources.scattered(shape, np.ones(4), nodes, np.ones(nodes.shape), sources.reshape(-1, 4)[nodes[:, 0]])
    swept = diffuse_by_sweeps(given, np.ones(given.places.shape, dtype=bool), ratios, rounds=40)
    matrix = eye(np.prod(shape))
    for axis in range(4):
        factors = [path_laplacian(n) if k == axis else eye(n) for k, n in enumerate(shape)]
        matrix = matrix + ratios[axis] * kron(kron(kron(factors[0], factors[1]), factors[2]), factors[3])
    exact = spsolve(matrix.tocsc(), sources.reshape(-1, 4).astype(float)).reshape(sources.shape)
    # componentwise: every value is right relative to itself, not to the largest
    np.testing.assert_allclose(swept, exact, rtol=2e-5)


def test_sweeps_do_not_depend_on_the_number_of_threads(monkeypatch):
    shape = sphere(500)
    one, many = [], []
    for threads, results in (("1", one), ("7", many)):
        monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
        field = sh.SignedHeatSolver(box(40)).distance(shape)
        results += [field.values, sh.sharpen(field).values]
    assert all(np.array_equal(a, b) for a, b in zip(one, many, strict=True))


def test_poisson_inverts_the_laplacian_and_is_adjoint_to_the_divergence():
    rng = np.random.default_rng(1)
    h = np.array([0.5, 1.0, 2.0])
    phi = rng.normal(size=(6, 7, 8))
    phi -= phi.mean()
    np.testing.assert_allclose(solve_poisson(laplacian(phi, h), h), phi, atol=1e-12)
    directions = rng.normal(size=(6, 7, 8, 3))
    by_parts = 0.0
    for axis in range(3):
        y = np.moveaxis(directions[..., axis], axis, 0)
        by_parts += (0.5 * (y[1:] + y[:-1]) * np.diff(np.moveaxis(phi, axis, 0), axis=0)).sum() / h[axis]
    assert (divergence(directions, h) * phi).sum() == pytest.approx(by_parts)


def test_directions_agree_with_the_closed_form_kernel_sum():
    # MATH: X(x) = Σ A N exp(−r/√t) / (4π t r); the stencil's kernel is anisotropic by a few degrees near the source
    shape, grid = sphere(1500), box(24)
    discretization = discretize(grid)
    source = discretization.lower([shape], 1.0)
    directions = discretization.to_cells(discretization.diffuse(source)).reshape(-1, 3)
    points = grid.points.reshape(-1, 3)
    centers = shape.vertices[shape.faces].mean(axis=1)
    exact = np.zeros_like(points)
    for begin in range(0, len(points), 500):
        r = np.linalg.norm(points[begin : begin + 500, None] - centers, axis=-1)
        kernel = np.exp((r.min(axis=1, keepdims=True) - r) / np.sqrt(source.time)) / r
        exact[begin : begin + 500] = kernel @ shape.face_area_vectors
    exact /= np.linalg.norm(exact, axis=1)[:, None]
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", directions, exact), -1, 1)))
    radius = np.linalg.norm(points, axis=1)
    away = (np.abs(radius - 1) > grid.spacing[0]) & (radius > 0.4)
    assert rms(angle[away]) < 2.0

    # the same Y integrated the same way: φ within the few hundredths of a cell that the two kernels differ by
    constraint = sh.constraints.Free()
    phi = [
        constraint.integrate(discretization.integration, divergence(y.reshape(*grid.shape, 3), grid.spacing), source)
        for y in (directions, exact)
    ]
    assert rms(phi[0] - phi[1]) < 0.08 * grid.spacing[0]


@njit
def sweep_to_convergence(sources, degrees, ratio, rounds):
    """Plain Gauss–Seidel in all eight directions, in double precision, on the whole grid, padded with zeros."""
    values = np.zeros_like(sources)
    n = sources.shape[0] - 2
    for direction in range(8 * rounds):
        for a in range(1, n + 1):
            i = a if direction & 1 else n + 1 - a
            for b in range(1, n + 1):
                j = b if direction & 2 else n + 1 - b
                for c in range(1, n + 1):
                    k = c if direction & 4 else n + 1 - c
                    for q in range(3):
                        total = values[i - 1, j, k, q] + values[i + 1, j, k, q] + values[i, j - 1, k, q]
                        total += values[i, j + 1, k, q] + values[i, j, k - 1, q] + values[i, j, k + 1, q]
                        values[i, j, k, q] = (sources[i, j, k, q] + ratio * total) / (1 + ratio * degrees[i, j, k])
    return values[1:-1, 1:-1, 1:-1].copy()


def test_far_field_points_the_right_way_in_the_farthest_corner():
    n = 64
    grid = sh.Grid((0.0, 0.0, 0.0), 1.0, (n, n, n))
    shape = sphere(400, radius=4.0, center=(7.0, 8.0, 9.0))
    discretization = discretize(grid)
    source = discretization.lower([shape], 1.0)
    directions = discretization.to_cells(discretization.diffuse(source))
    assert np.isfinite(directions).all()
    lengths = np.linalg.norm(directions, axis=-1)
    assert lengths.min() > 0.5  # interpolated unit vectors; nothing is lost on the way
    spread = (source.interpolation.T @ source.samples.vectors).reshape(n, n, n, 3)
    walls = np.isin(np.arange(-1, n + 1), [0, n - 1]).astype(float)
    degrees = 6 - walls[:, None, None] - walls[:, None] - walls
    exact = unit(sweep_to_convergence(np.pad(spread, [(1, 1)] * 3 + [(0, 0)]), degrees, source.time, rounds=12))
    cosine = np.einsum("...i,...i->...", directions, exact) / lengths
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    assert angle[-8:, -8:, -8:].max() < 1.0
    assert angle[n // 2 :, n // 2 :, n // 2 :].mean() < 1.0


def test_a_long_thin_grid_does_not_underflow():
    grid = sh.Grid((0.0, 0.0, 0.0), 1.0, (3000, 9, 9))
    shape = sphere(200, radius=2.0, center=(5.0, 4.0, 4.0))
    discretization = discretize(grid)
    directions = discretization.to_cells(discretization.diffuse(discretization.lower([shape], 1.0)))
    assert (directions[40:, :, :, 0] > 0.9).all()


def test_both_sides_of_a_sheet_thinner_than_a_cell_are_seen_from_afar():
    grid = box(40)
    side = np.array([[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]])
    z = 0.1 * grid.spacing[0]
    vertices = np.concatenate([np.c_[side, np.full(4, z)], np.c_[side, np.full(4, -z)]])
    plate = sh.TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    discretization = discretize(grid)
    directions = discretization.to_cells(discretization.diffuse(discretization.lower([plate], 1.0)))
    up = directions[15:25, 15:25, :, 2]
    assert (up[:, :, 24:] > 0.9).all() and (up[:, :, :16] < -0.9).all()
