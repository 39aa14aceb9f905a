"""Small surfaces with known distances."""

import numpy as np

import signedheat as sh
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh

from .triangulated import angles, flat


def split_quads(a, b, c, d, rng):
    """Two triangles for each quad abcd, along either diagonal."""
    a, b, c, d = (q.ravel() for q in (a, b, c, d))
    swap = rng.random(len(a)) < 0.5
    first = np.where(swap[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(swap[:, None], np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    return np.concatenate([first, second])


def surface_of_revolution(radius, length, around, along, seed=0, amount=0.2):
    """Side of a cylinder or frustum about the z axis, z from 0 to `length`; `radius` is a function of z."""
    rng = np.random.default_rng(seed)
    angle, z = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(0, length, along + 1), indexing="ij")
    angle = angle + rng.uniform(-amount, amount, angle.shape) * 2 * np.pi / around
    z[:, 1:-1] += rng.uniform(-amount, amount, (around, along - 1)) * length / along
    r = radius(z)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1).reshape(-1, 3)
    ids = np.arange(around * (along + 1)).reshape(around, along + 1)
    right = np.roll(ids, -1, axis=0)
    return sh.TriangleMesh(points, split_quads(ids[:, :-1], right[:, :-1], right[:, 1:], ids[:, 1:], rng))


def disk(rings, seed=0):
    """Unit disk: a jittered Delaunay triangulation."""
    rng = np.random.default_rng(seed)
    radii = np.arange(rings + 1) / rings
    polar = [(r, a + 0.5 * k) for k, r in enumerate(radii) for a in angles(max(1, round(2 * np.pi * r * rings)))]
    r, angle = np.array(polar).T
    points = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    points[r < 1] += rng.uniform(-0.15, 0.15, ((r < 1).sum(), 2)) / rings
    return flat(points, least=1e-6 / rings**2)


class FlatGluing:
    """A flat strip of n × m squares, jittered, whose ends are glued with a flip: a Möbius strip or a Klein bottle.

    Vertex (i, j) has id i·m + j. The orientable double cover runs through the strip twice, the second time mirrored,
    and its faces keep the corner order, and so the layout, of those that they cover.
    """

    def __init__(self, n, m, closed, seed=0):
        rng = np.random.default_rng(seed)
        self.n, self.m = n, m
        self.moved = rng.uniform(-0.2, 0.2, (n, m, 2))
        rows = np.arange(m if closed else m - 1)
        corner = np.stack(np.meshgrid(np.arange(n), rows, indexing="ij"), axis=-1).reshape(-1, 2)
        halves = [np.array([[0, 0], [1, 0], [0, 1]]), np.array([[1, 0], [1, 1], [0, 1]])]
        self.corners = np.concatenate([corner[:, None] + half for half in halves])  # unrolled (i, j)
        points = self.position(self.corners)
        self.lengths = np.abs(np.roll(points, -1, axis=1) - points)

    def position(self, ij):
        i, j = ij[..., 0], ij[..., 1]
        turned, row = i == self.n, j % self.m
        own = np.where(turned, self.m - 1 - row, row)
        moved = self.moved[i % self.n, own]
        return i + moved[..., 0] + 1j * (j + np.where(turned, -1, 1) * moved[..., 1])

    def vertices(self, lap=None):
        """Ids of the corners: on the surface itself, or on one lap of its cover."""
        i, j = self.corners[..., 0], self.corners[..., 1] % self.m
        if lap is None:
            return (i % self.n) * self.m + np.where(i == self.n, self.m - 1 - j, j)
        return (i + lap * self.n) % (2 * self.n) * self.m + (self.m - 1 - j if lap else j)

    @property
    def surface(self):
        return IntrinsicMesh.from_lengths(self.vertices(), self.lengths, self.n * self.m)

    @property
    def cover(self):
        both = np.concatenate([self.vertices(0), self.vertices(1)])
        return IntrinsicMesh.from_lengths(both, np.concatenate([self.lengths] * 2), 2 * self.n * self.m)

    @property
    def below(self):
        """Vertex of the surface that each vertex of the cover lies over."""
        over = np.empty(2 * self.n * self.m, dtype=int)
        for lap in range(2):
            over[self.vertices(lap)] = self.vertices()
        return over
