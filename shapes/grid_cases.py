"""Shapes with known distance, whole and broken, and a check of closed manifold surfaces."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import signedheat as sh

from .triangulated import hull, spiral


def sphere(n_vertices, radius=1.0, center=(0.0, 0.0, 0.0)):
    """Triangles between points of a spiral on a sphere, outward."""
    points = spiral(n_vertices)
    return sh.TriangleMesh(radius * points + np.asarray(center), hull(points))


def box(n, half=1.6):
    """A grid of n³ nodes around the origin."""
    return sh.Grid([-half] * 3, 2 * half / (n - 1), (n, n, n))


def sphere_distance(grid, radius=1.0):
    return np.linalg.norm(grid.points, axis=-1) - radius


def torus_distance(grid, major=1.0, minor=0.4):
    x, y, z = np.moveaxis(grid.points, -1, 0)
    return np.hypot(np.hypot(x, y) - major, z) - minor


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def relative_error(values, exact):
    """ε of the paper's comparisons."""
    return rms(values - exact) / float(exact.max() - exact.min())


def broken_spheres():
    """The unit sphere, broken in five ways."""
    rng = np.random.default_rng(7)
    whole = sphere(8000)
    vertices, faces = whole.vertices, whole.faces
    centers = vertices[faces].mean(axis=1)
    centers /= np.linalg.norm(centers, axis=1)[:, None]
    spots = rng.normal(size=(60, 3))
    spots /= np.linalg.norm(spots, axis=1)[:, None]
    nearness = (centers @ spots.T).max(axis=1)
    flipped, some = faces.copy(), rng.random(len(faces)) < 0.1
    flipped[some] = flipped[some][:, ::-1]
    loose = vertices[faces] + 0.01 * rng.normal(size=(len(faces), 1, 3))
    return {
        "holes": sh.TriangleMesh(vertices, faces[nearness < np.quantile(nearness, 0.65)]),
        "noise": sh.TriangleMesh(vertices + 0.01 * rng.normal(size=vertices.shape), faces),
        "flipped": sh.TriangleMesh(vertices, flipped),
        "soup": sh.TriangleMesh(loose.reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)),
        "points": sh.PointCloud(vertices[::3], vertices[::3]),
    }


def assert_closed_manifold(mesh):
    """Every edge has two faces that run along it in opposite directions, and every vertex one fan of faces."""
    faces, n = mesh.faces, mesh.n_vertices
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forward, backward = tail * n + head, head * n + tail
    assert len(np.unique(forward)) == len(forward)
    order = np.argsort(forward)
    at = np.searchsorted(forward[order], backward)
    assert (forward[order][np.minimum(at, len(order) - 1)] == backward).all()
    twin = order[at]
    corner = np.arange(faces.size)
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
    links = np.concatenate([corner, following]), np.concatenate([following[twin], twin])
    fans, _ = connected_components(coo_matrix((np.ones(len(links[0])), links), (faces.size,) * 2), directed=False)
    assert fans == len(np.unique(faces))


def enclosed_volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
