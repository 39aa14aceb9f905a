import numpy as np

from shapes.grid_cases import sphere
from signedheat.grids.blocks import BLOCK, BLOCK_NODES, Blocks, BlockValues
from signedheat.grids.marching import closed_surface, contour_parts
from signedheat.search.face_tree import FaceFeatures, FaceTree


def scattered(shape, share, seed=0):
    """Some blocks of a grid with random values, and all values of it with NaN where there are none."""
    rng = np.random.default_rng(seed)
    limit = -(-np.array(shape) // BLOCK)
    places = np.argwhere(rng.random(limit) < share)
    blocks = Blocks.of(places[rng.permutation(len(places))], shape)
    values = rng.normal(size=(len(blocks), BLOCK, BLOCK, BLOCK)).astype(np.float32)
    dense = np.full(limit * BLOCK, np.nan, dtype=np.float32)
    for place, block in zip(blocks.places * BLOCK, values, strict=True):
        dense[tuple(slice(p, p + BLOCK) for p in place)] = block
    return blocks, values, dense[tuple(slice(0, n) for n in shape)]


def test_blocks_find_their_nodes_on_any_grid():
    for shape in ((37, 300, 140), (9, 8, 1000)):
        blocks, values, dense = scattered(shape, 0.3)
        rng = np.random.default_rng(1)
        nodes = rng.integers(-20, np.array(shape) + 20, (5000, 3))
        expected = np.full(len(nodes), np.nan)
        inside = ((nodes >= 0) & (nodes < shape)).all(axis=1)
        expected[inside] = dense[tuple(nodes[inside].T)]
        found = BlockValues(blocks, values)[tuple(nodes.T)]
        on_grid = inside | np.isnan(found)  # the last blocks reach beyond the grid
        np.testing.assert_array_equal(found[on_grid], expected[on_grid])
        first, size = np.array([-3, 5, 100]), np.array([50, 60, 70])
        window = BlockValues(blocks, values).window(first, (50, 60, 70))
        low, high = np.maximum(first, 0), np.minimum(first + size, shape)
        padded = np.full((50, 60, 70), np.nan, dtype=np.float32)
        padded[tuple(slice(a, b) for a, b in zip(low - first, high - first, strict=True))] = dense[
            tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        ]
        np.testing.assert_array_equal(window, padded)


def test_interpolation_needs_the_nodes_around_and_no_others():
    blocks, values, dense = scattered((40, 40, 40), 0.7)
    rng = np.random.default_rng(2)
    points = np.concatenate([rng.uniform(-1, 40, (3000, 3)), rng.integers(0, 40, (500, 3)).astype(float)])
    expected = np.full(len(points), np.nan)
    for row, point in enumerate(points):
        if (point >= 0).all() and (point <= 39).all():
            base = np.minimum(point.astype(int), 38)
            f = point - base
            total = 0.0
            for corner in np.ndindex(2, 2, 2):
                weight = np.prod(np.where(corner, f, 1 - f))
                if weight > 0:
                    total += weight * float(dense[tuple(base + corner)])
            expected[row] = total
    np.testing.assert_allclose(BlockValues(blocks, values).interpolated(points), expected, atol=1e-6)


def test_contour_is_that_of_the_whole_grid():
    shape, spacing = (70, 83, 66), np.array([0.1, 0.08, 0.11])
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1) * spacing
    dense = (np.sin(1.3 * nodes).sum(axis=-1) + 0.2).astype(np.float32)  # leaves the grid, in many parts
    blocks = Blocks.of(np.argwhere(np.ones(-(-np.array(shape) // BLOCK), dtype=bool)), shape)
    values = np.full((len(blocks), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
    for row, place in enumerate(blocks.places * BLOCK):
        part = dense[tuple(slice(p, p + BLOCK) for p in place)]
        values[row][tuple(slice(0, n) for n in part.shape)] = part
    parts = contour_parts(BlockValues(blocks, values), spacing, 0.3)
    vertices, faces = (np.concatenate(part) for part in zip(*parts, strict=True))
    whole, others = closed_surface(dense.astype(np.float64), spacing, 0.3)
    assert faces.shape == others.shape
    one, two = (np.sort(v.round(4).view([("", v.dtype)] * 3).ravel()) for v in (vertices * spacing, whole * spacing))
    np.testing.assert_allclose(one.view(np.float64), two.view(np.float64), atol=2e-4)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_distances_are_exact_and_those_of_a_block_of_points_know_nothing_of_others():
    mesh = sphere(800)
    tree = FaceTree.of(FaceFeatures.of(mesh.vertices + 2.0, mesh.faces))
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 4, (6 * BLOCK_NODES, 3))
    found = tree.search(points)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] + 2.0 for k in range(3))
    some = rng.choice(len(points), 200)
    u, v = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12))
    u, v = u[u + v <= 1], v[u + v <= 1]
    sampled = (a[:, None] + u[:, None] * (b - a)[:, None] + v[:, None] * (c - a)[:, None]).reshape(-1, 3)
    for p in some:
        nearest = np.linalg.norm(sampled - points[p], axis=1).min()
        assert found.distances[p] <= nearest + 1e-12
        assert found.distances[p] >= nearest - 0.02
    np.testing.assert_allclose(np.linalg.norm(points - found.places, axis=1), found.distances, atol=1e-12)
    alone = tree.search(points[3 * BLOCK_NODES : 4 * BLOCK_NODES])
    np.testing.assert_array_equal(alone.distances, found.distances[3 * BLOCK_NODES : 4 * BLOCK_NODES])
    np.testing.assert_array_equal(alone.faces, found.faces[3 * 512 : 4 * 512])
    np.testing.assert_allclose(tree.distances(points), found.distances, atol=1e-12)
