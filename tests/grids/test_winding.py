"""Winding numbers on grids: against solid angles, and what they must do under symmetries."""

import numpy as np
import pytest

from signedheat import Grid, TriangleMesh, samples
from signedheat.shapes.area_elements import sample_on_grid
from signedheat.solids.heat_surfaces import blocks_of_dipoles, winding_numbers


def winding_on(shape, grid):
    return winding_numbers(sample_on_grid([shape], grid))


def solid_angles(mesh, points):
    """Exact winding numbers: sums of solid angles (Van Oosterom & Strackee 1983)."""
    total = np.zeros(len(points))
    for face in mesh.vertices[mesh.faces]:
        a, b, c = (corner - points for corner in face)
        la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        up = np.einsum("ij,ij->i", a, np.cross(b, c))
        down = la * lb * lc + np.sum(a * b, 1) * lc + np.sum(b * c, 1) * la + np.sum(c * a, 1) * lb
        total += 2 * np.arctan2(up, down)
    return total / (4 * np.pi)


def half(mesh):
    return TriangleMesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 0].mean(axis=1) < 0])


SHEET = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0.1]], [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("padding", [None, 0.05])
@pytest.mark.parametrize("shape", [samples.sphere(3), half(samples.sphere(3)), SHEET], ids=["sphere", "half", "sheet"])
def test_solid_angles(shape, padding):
    """Two routes. Splatting blurs over two cells; beyond, second differences leave about 1/(8 r²) at r cells: < .02."""
    grid = Grid.around(shape.bounds, 48, padding)
    nodes = grid.points.reshape(-1, 3)[:: 97 if shape is SHEET else 331]
    dense = shape.vertices[shape.faces].reshape(-1, 3)
    corners = np.concatenate([dense, shape.vertices[shape.faces].mean(axis=1)])
    if shape is SHEET:
        u, v = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
        corners = np.stack([u.ravel(), v.ravel(), 0.1 * v.ravel()], axis=1)
    far = np.min(np.linalg.norm(nodes[:, None] - corners, axis=2), axis=1) > 3 * grid.spacing[0]
    found = winding_on(shape, grid).reshape(-1)[:: 97 if shape is SHEET else 331]
    assert np.abs(found - solid_angles(shape, nodes))[far].max() < 0.02


def test_turned_shapes_wind_backwards():
    shape, grid = half(samples.sphere(3)), Grid.around([[-1, -1, -1], [1, 1, 1]], 32)
    turned = TriangleMesh(shape.vertices, shape.faces[:, ::-1])
    # sums in single precision
    assert np.allclose(winding_on(turned, grid), -winding_on(shape, grid), atol=1e-5)


def test_bodies_add_up():
    one, other = samples.sphere(3), samples.sphere(3, center=(1.0, 0, 0))
    grid = Grid.around([[-1, -1, -1], [2, 1, 1]], 40)
    both = winding_on(samples.union(one, other), grid)
    # up to what one dipole for each block of cells does at the walls
    assert np.allclose(both, winding_on(one, grid) + winding_on(other, grid), atol=1e-3)
    assert abs(both[tuple(np.array(grid.shape) // 2)] - 2) < 0.02


@pytest.mark.parametrize("reach", [1e3, 1e9, 1e18])
def test_blocks_of_shapes_that_are_far_larger_than_the_grid(reach):
    rng = np.random.default_rng(0)
    positions = rng.uniform(-reach, reach, (40, 3))
    vectors = rng.normal(size=(40, 3))
    means, sums = blocks_of_dipoles(np.repeat(positions, 2, axis=0), np.repeat(vectors, 2, axis=0))
    order, wanted = np.lexsort(means.T[::-1]), np.lexsort(positions.T[::-1])
    np.testing.assert_allclose(means[order], positions[wanted], rtol=1e-12)
    np.testing.assert_allclose(sums[order], 2 * vectors[wanted], rtol=1e-12)
