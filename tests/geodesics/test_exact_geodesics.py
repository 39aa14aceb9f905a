"""The search for exact distance on faces that share edges at random: it ends, is right, and can be ended."""

from __future__ import annotations

import _thread
import threading
import time

import numpy as np
import pytest

import signedheat as sh
from signedheat.discretization import discretize
from signedheat.geodesics.exact_distance import distance_to_zero_line, window_limit
from signedheat.jobs import reporting
from signedheat.mesh.intrinsic_mesh import IntrinsicMesh


def random_faces(seed: int, n_vertices: int, n_faces: int) -> tuple[IntrinsicMesh, np.ndarray]:
    """Faces between random vertices, many to an edge, and random values at the vertices."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(n_vertices, 3))
    faces = np.array([rng.choice(n_vertices, 3, replace=False) for _ in range(n_faces)])
    return discretize(sh.TriangleMesh(vertices, faces)).triangles, rng.normal(size=n_vertices)


def by_small_steps(triangles: IntrinsicMesh, values: np.ndarray, n: int) -> np.ndarray:
    """Upper bounds of distance: paths through n points on every edge, from those next to the zero line."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    weights = [np.eye(3)]
    for k in range(3):
        t = np.arange(1, n + 1)[:, None] / (n + 1)
        weights.append((1 - t) * np.eye(3)[k] + t * np.eye(3)[(k + 1) % 3])
    weights = np.concatenate(weights)
    rows, columns, lengths, start = [], [], [], np.full(triangles.n_vertices + n * triangles.n_edges, np.inf)
    for f in range(triangles.n_faces):
        inner = [
            triangles.n_vertices + n * e + (np.arange(n) if ahead else np.arange(n)[::-1])
            for e, ahead in zip(triangles.edges.face_edges[f], triangles.edges.forward[f], strict=True)
        ]
        ids = np.concatenate([triangles.corner_vertices[f], *inner])
        places = weights @ triangles.corner_positions[f]
        rows.append(np.repeat(ids, len(ids)))
        columns.append(np.tile(ids, len(ids)))
        lengths.append(np.abs(places[:, None] - places).ravel())
        at = values[triangles.corner_vertices[f]]
        ends = [
            triangles.corner_positions[f, k] + at[k] / (at[k] - at[k - 2]) * triangles.edge_vectors[f, k]
            for k in range(3)
            if at[k] * at[k - 2] < 0
        ]
        if ends:
            along = ends[1] - ends[0]
            t = np.clip(((places - ends[0]) * np.conj(along)).real / abs(along) ** 2, 0, 1)
            np.minimum.at(start, ids, np.abs(places - ends[0] - t * along))
    root = len(start)
    known = np.flatnonzero(np.isfinite(start))
    rows, columns, lengths = (np.concatenate(a) for a in (rows, columns, lengths))
    _, first = np.unique(rows * root + columns, return_index=True)
    graph = csr_matrix((lengths[first], (rows[first], columns[first])), shape=(root, root))
    graph = csr_matrix(graph.maximum(graph.T))
    from scipy.sparse import bmat

    row = csr_matrix((start[known] + 1e-300, (np.zeros(len(known), int), known)), shape=(1, root))
    whole = bmat([[graph, None], [row, None]], format="csr")
    whole.resize((root + 1, root + 1))
    return dijkstra(whole, indices=root)[: triangles.n_vertices]


@pytest.mark.parametrize("tolerance", [0.0, 1e-4])
@pytest.mark.parametrize(
    ("seed", "n_vertices", "n_faces"), [(1, 12, 47), (3, 8, 47), (4, 8, 47), (5, 12, 80), (6, 12, 80), (11, 12, 80)]
)
def test_random_faces_end_with_the_right_distance(seed, n_vertices, n_faces, tolerance):
    """All but the first never ended: waves multiplied where they met again; the first had negative distances."""
    triangles, values = random_faces(seed, n_vertices, n_faces)
    distance, windows = distance_to_zero_line(triangles, values, tolerance)
    bound = by_small_steps(triangles, values, 12)
    assert windows < window_limit(triangles)
    assert (distance >= 0).all()
    assert (distance <= bound + 1e-9).all()  # a path through points on edges is never shorter
    assert np.abs(distance - bound).max() < 0.02 * triangles.edge_lengths.mean()  # and not much longer


def test_hundreds_of_faces_to_an_edge_are_cut_short():
    """60 faces share every edge: distances are still lengths of paths, and not far from the shortest."""
    triangles, values = random_faces(0, 6, 300)
    distance, windows = distance_to_zero_line(triangles, values)
    bound = by_small_steps(triangles, values, 6)
    assert windows == window_limit(triangles)
    assert np.abs(distance - bound).max() < 0.1 * bound.max()


def test_a_search_that_is_cut_short_warns():
    rng = np.random.default_rng(0)
    faces = np.array([rng.choice(6, 3, replace=False) for _ in range(300)])
    mesh = sh.TriangleMesh(rng.normal(size=(6, 3)), faces)
    with pytest.warns(sh.errors.InexactWarning):
        sharp = sh.sharpen(sh.Field(mesh, rng.normal(size=6)))
    assert sharp.diagnostics.note(sh.diagnostics.GeodesicWindows).cut_short


class Cancelled(Exception):
    pass


def test_a_report_ends_the_search():
    triangles, values = random_faces(0, 30, 2000)
    calls = []

    def report(fraction: float, step: str) -> None:
        calls.append(time.perf_counter())
        if len(calls) == 3:
            raise Cancelled

    with pytest.raises(Cancelled), reporting(report):
        distance_to_zero_line(triangles, values, 0.0)
    assert len(calls) == 3


def test_ctrl_c_ends_the_search():
    """A run of seconds ends soon after the interrupt, since kernels return every now and then."""
    triangles, values = random_faces(0, 100, 20000)
    distance_to_zero_line(*random_faces(1, 12, 47))
    threading.Timer(0.3, _thread.interrupt_main).start()
    begin = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        distance_to_zero_line(triangles, values, 0.0)
    assert time.process_time() - begin < 1.5
