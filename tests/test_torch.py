"""Distances as functions that PyTorch differentiates."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

torch = pytest.importorskip("torch")


def broken_ball():
    ball = samples.sphere(1)
    return sh.TriangleMesh(
        ball.vertices * [1.0, 0.8, 0.7], ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.6]
    )


def some_points(n):
    return np.random.default_rng(0).uniform(-1.2, 1.2, (n, 3))


def test_values_are_those_of_the_solid():
    solid, points = sh.complete(broken_ball()), some_points(200)
    tensor = torch.from_numpy(points)
    np.testing.assert_array_equal(sh.torch.distance(solid, tensor).numpy(), solid.distance(points))
    np.testing.assert_array_equal(solid.distance(tensor), solid.distance(points))  # tensors are arrays, too
    single = sh.torch.distance(solid, tensor.float())
    assert single.dtype == torch.float32
    np.testing.assert_allclose(single.numpy(), solid.distance(points), atol=1e-6)


@pytest.mark.parametrize("shape", [(), (1,), (4, 5), (0,)])
def test_batches_of_any_shape(shape):
    solid, points = sh.complete(broken_ball()), torch.from_numpy(some_points(20))
    points = points[: int(np.prod(shape))].reshape(*shape, 3).requires_grad_()
    found = sh.torch.distance(solid, points)
    assert found.shape == shape
    np.testing.assert_array_equal(found.detach().numpy(), solid.distance(points.detach().numpy()))
    found.sum().backward()
    assert points.grad.shape == points.shape


def test_gradients_by_points_are_those_of_finite_differences():
    solid = sh.complete(broken_ball())
    points = torch.from_numpy(some_points(40)).requires_grad_()
    assert torch.autograd.gradcheck(lambda x: sh.torch.distance(solid, x), (points,))


def test_gradients_by_vertices_are_those_of_finite_differences():
    mesh = samples.sphere(1)
    faces, points = mesh.faces, torch.from_numpy(some_points(60)).requires_grad_()
    vertices = torch.from_numpy(np.array(mesh.vertices)).requires_grad_()

    def distances(positions):
        return sh.torch.distance(sh.complete((positions.detach().numpy(), faces)), points, positions)

    way = torch.from_numpy(np.random.default_rng(1).normal(size=(42, 3)))
    step = 1e-6
    slopes = (distances(vertices + step * way) - distances(vertices - step * way)) / (2 * step)
    _, exact = torch.autograd.functional.jvp(distances, vertices, way)
    np.testing.assert_allclose(exact.detach().numpy(), slopes.detach().numpy(), atol=1e-8)
    assert np.abs(exact.detach().numpy()).max() > 0.1


def test_what_was_completed_does_not_depend_on_the_vertices():
    mesh = broken_ball()
    solid, vertices = sh.complete(mesh), torch.from_numpy(np.array(mesh.vertices)).requires_grad_()
    distance = sh.torch.distance(solid, torch.tensor([[0.0, 0.0, 2.0]], dtype=torch.float64), vertices)
    distance.backward()
    assert solid.closest([[0.0, 0.0, 2.0]]).completed.all()
    assert not vertices.grad.any()


def test_on_the_surface_the_gradient_is_the_normal():
    solid = sh.complete(samples.sphere(2))
    point = torch.tensor(samples.sphere(2).vertices[samples.sphere(2).faces[0]].mean(axis=0)[None]).requires_grad_()
    sh.torch.distance(solid, point).backward()
    assert torch.linalg.vector_norm(point.grad) == pytest.approx(1.0)


def test_other_vertices_are_refused():
    solid, points = sh.complete(samples.sphere(1)), torch.zeros((1, 3))
    for vertices in (torch.zeros((42, 3)), torch.zeros((3, 3))):
        with refused(sh.errors.SourceError, "vertices"):
            sh.torch.distance(solid, points, vertices)
    cloud = sh.complete(samples.oriented_points(samples.sphere(2), 500))
    with refused(sh.errors.SourceError, "solid"):
        sh.torch.distance(cloud, points, torch.zeros((42, 3)))


def test_whole_numbers_have_distances_that_are_not():
    solid = sh.complete(samples.sphere(2))
    assert sh.torch.distance(solid, torch.tensor([[0, 1, 1]])).item() == pytest.approx(0.41, abs=0.02)


def test_meshes_and_missing_vertices_are_refused():
    solid, points = sh.complete(samples.sphere(1)), torch.zeros((1, 3))
    with refused(sh.errors.UnsupportedTypeError, "solid"):
        sh.torch.distance(samples.sphere(1), points)
    with refused(sh.errors.SourceError, "vertices"):
        sh.torch.distance(solid, points, np.full((42, 3), np.nan))
