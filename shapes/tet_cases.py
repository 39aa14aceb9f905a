"""Tet meshes and exact distances that the tet suites measure on."""

from __future__ import annotations

import itertools

import numpy as np
from scipy import sparse

import signedheat as sh
from signedheat.linear import factorize


def boxes(counts: tuple[int, int, int], size: float, keep=None, jitter: float = 0.0) -> sh.TetMesh:
    """Cubes of a given size from the origin on, six tets in each, those whose centre `keep` accepts."""
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    if keep is not None:
        cells = cells[keep((cells + 0.5) * size)]
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    tets = []
    for order in itertools.permutations(range(3)):
        steps = np.cumsum([np.zeros(3, dtype=int), *np.eye(3, dtype=int)[list(order)]], axis=0)
        tets.append((cells[:, None] + steps) @ stride)
    ids, corners = np.unique(np.concatenate(tets), return_inverse=True)
    lattice = np.stack([ids // stride[0], ids % stride[0] // stride[1], ids % stride[1]], axis=1)
    tets = corners.reshape(-1, 4)
    vertices = lattice * size
    inner = np.ones(len(vertices), dtype=bool)
    inner[sh.TetMesh(vertices, tets).boundary.faces] = False
    vertices[inner] += np.random.default_rng(0).uniform(-jitter, jitter, (inner.sum(), 3)) * size
    return sh.TetMesh(vertices, tets)


def lattice(resolution: int, half: float = 1.6) -> sh.TetMesh:
    """A uniform body-centred cubic lattice in a cube around the origin."""
    diagonal = sh.TriangleMesh(half * np.array([[-1, -1, -1], [1, 1, 1], [-1, 1, 0]]), [[0, 1, 2]])
    return sh.tetrahedralize(diagonal, resolution=resolution, padding=0, grading=np.inf)


def rectangle(origin, u, v) -> sh.TriangleMesh:
    """Two triangles with normal u × v."""
    origin, u, v = (np.asarray(x, dtype=float) for x in (origin, u, v))
    return sh.TriangleMesh([origin, origin + u, origin + u + v, origin + v], [[0, 1, 2], [0, 2, 3]])


def sphere(subdivisions: int = 4, radius: float = 1.0) -> sh.TriangleMesh:
    """A sphere around the origin, facing outward."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return sh.TriangleMesh(ball.vertices, ball.faces)


def round_ball(subdivisions: int = 4) -> sh.TriangleMesh:
    """A polyhedron with the volume of the unit ball, so that its faces lie as much outside of it as inside."""
    ball = sphere(subdivisions)
    volume = np.einsum("ij,ij->", ball.vertices[ball.faces[:, 0]], ball.face_area_vectors) / 3
    return sh.TriangleMesh(ball.vertices * (4 / 3 * np.pi / volume) ** (1 / 3), ball.faces)


def ell(n: int) -> tuple[sh.TetMesh, sh.TriangleMesh, np.ndarray]:
    """An L of jittered tets, n to the unit; a wall across one arm, and the distance from it, round the corner."""
    mesh = boxes((2 * n, 2 * n, n // 2), 1 / n, keep=lambda c: ~((c[:, 0] > 1) & (c[:, 1] > 1)), jitter=0.1)
    x, y, _ = mesh.vertices.T
    wall = rectangle([1.55, -0.5, -0.5], [0, 3, 0], [0, 0, 3])
    exact = np.where((x <= 1) & (y > 1), -(0.55 + np.hypot(x - 1, y - 1)), x - 1.55)
    return mesh, wall, exact * np.sign(wall.face_area_vectors[0, 0])


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def plain_recipe(mesh: sh.TetMesh, shape: sh.TriangleMesh) -> np.ndarray:
    """φ at the vertices by Sec. 8.1 and App. B, on its own, step by step.

    The faces of the shape, which are some of the mesh, name their vertices by the same ids. Its mean over them is zero.
    """
    vertices, tets = mesh.vertices, mesh.tets
    corners = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]]
    p = vertices[corners]
    normals = np.cross(p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0]) / 2
    volumes = mesh.tet_volumes
    triples, tet_faces = np.unique(np.sort(corners.reshape(-1, 3)), axis=0, return_inverse=True)
    tet_faces = tet_faces.reshape(-1, 4)
    centers = vertices[triples].mean(axis=1)
    products = np.einsum("mai,mbi->mab", normals, normals)

    def assembled(ids, n, factors):
        entries = (products * factors[:, None, None]).ravel()
        return sparse.csr_matrix((entries, (np.repeat(ids, 4), np.tile(ids, 4).ravel())), shape=(n, n))

    pairs = [(a, b) for a in range(4) for b in range(a)]
    h = np.mean([np.linalg.norm(centers[tet_faces[:, a]] - centers[tet_faces[:, b]], axis=1) for a, b in pairs])
    facing = {tuple(sorted(face)): face for face in shape.faces.tolist()}
    on = np.array([tuple(triple) in facing for triple in triples.tolist()])
    faces = np.array([facing[tuple(triple)] for triple in triples[on].tolist()])
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    sources = np.zeros((len(triples), 3))
    sources[on] = np.cross(b - a, c - a) / 2
    mass = sparse.diags_array(np.bincount(tet_faces.ravel(), np.repeat(volumes / 4, 4)))
    heat = sparse.csr_matrix(mass + h**2 * assembled(tet_faces, len(triples), 1 / volumes))
    y = factorize(heat).solve(sources)[tet_faces].mean(axis=1)
    y /= np.abs(y).max(axis=1, keepdims=True)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    right = -np.bincount(tets.ravel(), np.einsum("mai,mi->ma", normals, y).ravel() / 3, len(vertices))
    laplacian = assembled(tets, len(vertices), 1 / (9 * volumes))
    laplacian += sparse.csr_matrix(([1.0], ([0], [0])), shape=laplacian.shape)  # one vertex held
    phi = factorize(sparse.csr_matrix(laplacian)).solve(right)
    return phi - phi[np.unique(faces)].mean()
