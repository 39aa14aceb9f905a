"""Sample shapes, functions that damage them, and the broken duck of `signedheat demo`.

All shapes are computed. Functions with a `seed` give the same result for the same seed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .errors import SignedHeatError, counted
from .fields.field import Field
from .grids.grid import Grid
from .memory import refuse_beyond_memory
from .shapes.transforms import joined_triangles
from .surfaces.point_cloud import PointCloud
from .surfaces.triangle_mesh import TriangleMesh
from .validation import coordinates, finite_number, positive_number, whole_number

__all__ = [
    "broken_duck", "duck", "oriented_points", "soup", "sphere", "torus", "union", "with_duplicate_faces",
    "with_flipped_faces", "with_noise", "without_faces", "without_patches",
]  # fmt: skip

BYTES_PER_FACE, BYTES_PER_DUCK_CELL = 130, 103
"""Memory for each face of a sphere or a torus, and for each cell of a cube around a duck, as measured."""


def sphere(subdivisions: int = 4, radius: float = 1.0, center: ArrayLike = (0, 0, 0)) -> TriangleMesh:
    """Make a sphere from an icosahedron, whose faces are split into four and moved to the sphere.

    Parameters
    ----------
    subdivisions : int
        How often faces are split, so that there are ``20 · 4**subdivisions`` faces.
    radius : float
        Radius of the sphere.
    center : (3,) float
        Center of the sphere.

    Returns
    -------
    TriangleMesh
        A closed mesh with outward normals, whose vertices lie on the sphere.

    Examples
    --------
    >>> sphere(2)
    TriangleMesh(162 vertices, 320 faces)
    """
    subdivisions, position = whole_number(subdivisions, "subdivisions", 0), coordinates([center], "center", 3)
    refuse_beyond_memory(
        f"a sphere of {subdivisions} subdivisions",
        subdivisions,
        lambda n: BYTES_PER_FACE * 20 * 4.0 ** min(n, 500),
        lambda n: f"divide its faces at most {counted(n, 'time')}",
    )
    golden = (1 + 5**0.5) / 2
    points = np.array([[s, t * golden, 0] for s in (-1, 1) for t in (-1, 1)], dtype=float)
    points = np.concatenate([np.roll(points, k, axis=1) for k in range(3)])
    triples = np.array([(i, j, k) for i in range(12) for j in range(i + 1, 12) for k in range(j + 1, 12)])
    a, b, c = points[triples].transpose(1, 0, 2)
    longest = np.max(
        [np.linalg.norm(a - b, axis=1), np.linalg.norm(b - c, axis=1), np.linalg.norm(c - a, axis=1)], axis=0
    )
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0
    faces = np.where(outward[:, None], triples, triples[:, ::-1])[longest < 2.1]
    for _ in range(subdivisions):
        edges = TriangleMesh(points, faces).edges
        middle = len(points) + edges.face_edges
        points = np.concatenate([points, points[edges.vertices].mean(axis=1)])
        corner, (ab, bc, ca) = faces, middle.T
        faces = np.concatenate(
            [
                np.stack([corner[:, 0], ab, ca], axis=1),
                np.stack([corner[:, 1], bc, ab], axis=1),
                np.stack([corner[:, 2], ca, bc], axis=1),
                np.stack([ab, bc, ca], axis=1),
            ]
        )
    points *= positive_number(radius, "radius") / np.linalg.norm(points, axis=1, keepdims=True)
    return TriangleMesh(points + position, faces)


def torus(major: float = 1.0, minor: float = 0.4, n_around: int = 96, n_across: int = 48) -> TriangleMesh:
    """Make a torus around the z axis.

    Parameters
    ----------
    major : float
        Radius of the circle in the plane z = 0 around which the tube runs.
    minor : float
        Radius of the tube.
    n_around, n_across : int
        Number of vertices around the z axis, and around the tube.

    Returns
    -------
    TriangleMesh
        A closed mesh with outward normals.

    Examples
    --------
    >>> torus(n_around=6, n_across=4)
    TriangleMesh(24 vertices, 48 faces)
    """
    major, minor = positive_number(major, "major"), positive_number(minor, "minor")
    n_around, n_across = whole_number(n_around, "n_around", 3), whole_number(n_across, "n_across", 3)
    refuse_beyond_memory(
        f"a torus of {n_around} × {n_across} vertices",
        n_around * n_across,
        lambda n: 2 * BYTES_PER_FACE * float(n),
        lambda n: f"take {counted(n, 'vertex')} at most",
    )
    u, v = np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij")
    around, across = 2 * np.pi * u / n_around, 2 * np.pi * v / n_across
    ring = major + minor * np.cos(across)
    points = np.stack([ring * np.cos(around), ring * np.sin(around), minor * np.sin(across)], axis=-1)
    index = u * n_across + v
    right, up = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    diagonal = np.roll(right, -1, axis=1)
    faces = np.concatenate([np.stack([index, right, diagonal], axis=-1), np.stack([index, diagonal, up], axis=-1)])
    return TriangleMesh(points.reshape(-1, 3), faces.reshape(-1, 3))


def duck(n: int = 56) -> TriangleMesh:
    """Make a rubber duck about 2 long, whose beak is a separate body that intersects the head.

    Parameters
    ----------
    n : int
        Number of grid cells along the duck with which its body is computed.

    Returns
    -------
    TriangleMesh
        Two closed bodies with outward normals.
    """
    lower, upper = np.array([-1.15, -0.8, -0.75]), np.array([1.0, 0.8, 1.15])
    n = whole_number(n, "n", 8)
    refuse_beyond_memory(
        f"a duck of {n} cells", n, lambda k: BYTES_PER_DUCK_CELL * float(k) ** 3, lambda k: f"take {k} cells at most"
    )
    spacing = 2.15 / n
    grid = Grid(lower, spacing, np.ceil((upper - lower) / spacing).astype(int) + 1)
    x = grid.points
    lumps = [
        ((0.0, 0.0, -0.2), (0.82, 0.6, 0.46)),  # body
        ((-0.72, 0.0, 0.12), (0.3, 0.26, 0.24)),  # tail
        ((0.38, 0.0, 0.62), (0.4, 0.38, 0.38)),  # head
        ((-0.05, 0.5, -0.12), (0.42, 0.14, 0.22)),  # wings
        ((-0.05, -0.5, -0.12), (0.42, 0.14, 0.22)),
    ]
    depth = [(np.linalg.norm((x - center) / np.array(axes), axis=-1) - 1) * min(axes) for center, axes in lumps]
    softness = 0.05
    blend = -softness * np.logaddexp.reduce([-d / softness for d in depth], axis=0)
    body = Field(grid, blend).contour(0.0)
    beak = sphere(3)
    beak = TriangleMesh(beak.vertices * (0.2, 0.15, 0.07) + (0.88, 0.0, 0.6), beak.faces)
    return union(body, beak)


def broken_duck() -> TriangleMesh:
    """Make a damaged `duck`, with holes, noise, flipped faces and duplicate faces.

    Returns
    -------
    TriangleMesh
        The mesh, which is the same in every call.
    """
    mesh = without_patches(duck(), n_patches=7, radius=0.26, seed=3)
    mesh = with_noise(mesh, 0.006, seed=1)
    return with_duplicate_faces(with_flipped_faces(mesh, 0.05, seed=2), 0.02, seed=5)


def union(*meshes: TriangleMesh) -> TriangleMesh:
    """Put all faces of several meshes into one mesh, without merging vertices or cutting faces.

    Parameters
    ----------
    *meshes : TriangleMesh
        The meshes.

    Returns
    -------
    TriangleMesh
        Vertices and faces of the meshes, in order.
    """
    return TriangleMesh(*joined_triangles(meshes))


def without_patches(mesh: TriangleMesh, n_patches: int, radius: float, seed: int = 0) -> TriangleMesh:
    """Cut holes into a mesh, by removing the faces near some vertices that are far from each other.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    n_patches : int
        Number of these vertices.
    radius : float
        Distance from the vertices, in the units of the mesh, within which the centroids of removed faces lie.
    seed : int
        Seed of the random generator, which chooses the first vertex.

    Returns
    -------
    TriangleMesh
        All vertices, and the remaining faces.
    """
    n_patches, radius = whole_number(n_patches, "n_patches", 1), finite_number(radius, "radius", 0)
    picked = [int(_random(seed).integers(mesh.n_vertices))]
    nearest = np.linalg.norm(mesh.vertices - mesh.vertices[picked[0]], axis=1)
    while len(picked) < min(n_patches, mesh.n_vertices):
        picked.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(mesh.vertices - mesh.vertices[picked[-1]], axis=1))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    distance = np.min([np.linalg.norm(middles - mesh.vertices[k], axis=1) for k in picked], axis=0)
    return TriangleMesh(mesh.vertices, mesh.faces[distance > radius])


def without_faces(mesh: TriangleMesh, fraction: float, seed: int = 0) -> TriangleMesh:
    """Remove random faces of a mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    fraction : float
        Probability of each face to be removed, from 0 to 1.
    seed : int
        Seed of the random generator.

    Returns
    -------
    TriangleMesh
        All vertices, and the remaining faces.
    """
    return TriangleMesh(mesh.vertices, mesh.faces[_random(seed).random(mesh.n_faces) >= _share(fraction)])


def with_noise(mesh: TriangleMesh, amplitude: float, seed: int = 0) -> TriangleMesh:
    """Move the vertices of a mesh at random.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    amplitude : float
        Standard deviation of the moves along each axis, in the units of the mesh.
    seed : int
        Seed of the random generator.

    Returns
    -------
    TriangleMesh
        The same faces, with moved vertices.
    """
    moves = _random(seed).normal(scale=finite_number(amplitude, "amplitude", 0), size=mesh.vertices.shape)
    return TriangleMesh(mesh.vertices + moves, mesh.faces)


def with_flipped_faces(mesh: TriangleMesh, fraction: float, seed: int = 0) -> TriangleMesh:
    """Reverse the orientation of random faces of a mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    fraction : float
        Probability of each face to be flipped, from 0 to 1.
    seed : int
        Seed of the random generator.

    Returns
    -------
    TriangleMesh
        The same vertices and faces, some of which have their corners in reverse order.
    """
    flipped = _random(seed).random(mesh.n_faces) < _share(fraction)
    return TriangleMesh(mesh.vertices, np.where(flipped[:, None], mesh.faces[:, ::-1], mesh.faces))


def with_duplicate_faces(mesh: TriangleMesh, fraction: float, seed: int = 0) -> TriangleMesh:
    """Append copies of random faces to a mesh.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    fraction : float
        Probability of each face to be copied, from 0 to 1.
    seed : int
        Seed of the random generator.

    Returns
    -------
    TriangleMesh
        All faces, followed by the copies, which have the same vertices.
    """
    doubled = _random(seed).random(mesh.n_faces) < _share(fraction)
    return TriangleMesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[doubled]]))


def soup(mesh: TriangleMesh, jitter: float = 0.0, seed: int = 0) -> TriangleMesh:
    """Make a triangle soup of a mesh, in which no triangle shares a vertex with another, and move triangles at random.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    jitter : float
        Standard deviation of the random move of each triangle along each axis, in the units of the mesh.
    seed : int
        Seed of the random generator.

    Returns
    -------
    TriangleMesh
        The same triangles, in order, with three vertices for each.
    """
    corners = mesh.vertices[mesh.faces]
    corners = corners + _random(seed).normal(scale=finite_number(jitter, "jitter", 0), size=(mesh.n_faces, 1, 3))
    return TriangleMesh(corners.reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3))


def oriented_points(mesh: TriangleMesh, n_points: int, seed: int = 0) -> PointCloud:
    """Draw random points on a mesh, uniformly by area, with the normals of their faces.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
    n_points : int
        Number of points.
    seed : int
        Seed of the random generator.

    Returns
    -------
    PointCloud
        The points, with normals.
    """
    rng, n_points = _random(seed), whole_number(n_points, "n_points", 1)
    face = rng.choice(mesh.n_faces, size=n_points, p=mesh.face_areas / mesh.face_areas.sum())
    root, share = np.sqrt(rng.random(n_points)), rng.random(n_points)
    weights = np.stack([1 - root, root * (1 - share), root * share], axis=1)
    points = np.einsum("ij,ijk->ik", weights, mesh.vertices[mesh.faces[face]])
    return PointCloud(points, mesh.face_area_vectors[face])


def _random(seed: int) -> np.random.Generator:
    """Return a generator of random numbers for a seed, which must not be negative."""
    return np.random.default_rng(whole_number(seed, "seed", 0))


def _share(fraction: float) -> float:
    """Return a fraction as a float; raise an error unless it is from 0 to 1."""
    share = finite_number(fraction, "fraction", 0)
    if share > 1:
        raise SignedHeatError(f"fraction must be from 0 to 1, not {share:g}", element="fraction")
    return share
