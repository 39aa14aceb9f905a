"""What the paper compares with, by its own formulas: none of these is part of the library."""

from __future__ import annotations

import heapq

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import factorized

import signedheat as sh
from signedheat.discretization import discretize
from signedheat.geodesics.exact_distance import distance_to_segments
from signedheat.geodesics.geodesic_sources import PlacedSegments

from .shapes import mean_edge

Array = NDArray[np.float64]


def error(values: Array, exact: Array, weights: Array | None = None) -> float:
    """ε of Sec. 9.1, in per cent: root mean square difference over the range of the exact distance."""
    known = np.isfinite(values) & np.isfinite(exact)
    share = np.ones(len(values)) if weights is None else weights
    mean = np.average((values[known] - exact[known]) ** 2, weights=share[known])
    return float(100 * np.sqrt(mean) / np.ptp(exact[known]))


def cotan_laplacian(mesh: sh.TriangleMesh) -> tuple[sparse.csr_matrix, Array]:
    """Positive semidefinite cotan matrix, and the area at each vertex."""
    n, corners = mesh.n_vertices, mesh.vertices[mesh.faces]
    matrix = sparse.csr_matrix((n, n))
    for k in range(3):
        i, j = mesh.faces[:, (k + 1) % 3], mesh.faces[:, (k + 2) % 3]
        u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        half = 0.5 * (u * v).sum(1) / np.linalg.norm(np.cross(u, v), axis=1)
        matrix += sparse.csr_matrix((np.r_[-half, -half, half, half], (np.r_[i, j, i, j], np.r_[j, i, i, j])), (n, n))
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), n)
    return matrix, area


def curve_weights(mesh: sh.TriangleMesh, curves: list[sh.Curve]) -> Array:
    """Integral along the curves of each vertex's hat function."""
    weights = np.zeros(mesh.n_vertices)
    for curve in curves:
        points = np.einsum("ij,ijk->ik", curve.barycentric, mesh.vertices[mesh.faces[curve.faces]])
        steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
        if not curve.closed:
            steps[-1] = 0
        share = (steps + np.roll(steps, 1)) / 2
        np.add.at(weights, mesh.faces[curve.faces], share[:, None] * curve.barycentric)
    return weights


def unsigned_heat(mesh: sh.TriangleMesh, curves: list[sh.Curve], diffusion: float = 1.0) -> Array:
    """The heat method of Crane et al. 2013: unsigned, the mean of Neumann and Dirichlet conditions at the boundary."""
    matrix, area = cotan_laplacian(mesh)
    start = curve_weights(mesh, curves)
    time = diffusion * mean_edge(mesh) ** 2
    system = (sparse.diags(area) + time * matrix).tocsc()
    heat = factorized(system)(start)
    rim = np.unique(mesh.edges.vertices[mesh.edges.face_counts == 1])
    if len(rim):
        inner = np.setdiff1d(np.arange(mesh.n_vertices), rim)
        fixed = np.zeros(mesh.n_vertices)
        fixed[inner] = factorized(system[inner][:, inner].tocsc())(start[inner])
        heat = (heat + fixed) / 2
    corners, normal = mesh.vertices[mesh.faces], mesh.face_area_vectors / mesh.face_areas[:, None]
    opposite = [corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3] for k in range(3)]
    gradient = sum(heat[mesh.faces[:, k], None] * np.cross(normal, opposite[k]) for k in range(3))
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    unit = -gradient / np.where(length > 0, length, 1)
    divergence = np.zeros(mesh.n_vertices)
    for k in range(3):
        np.add.at(divergence, mesh.faces[:, k], -0.5 * (np.cross(normal, opposite[k]) * unit).sum(1))
    grounded = (matrix + 1e-9 * matrix.diagonal().mean() * sparse.diags(area / area.sum())).tocsc()
    values = factorized(grounded)(-divergence)
    values = values if np.corrcoef(values, start)[0, 1] < 0 else -values
    return values - np.average(values, weights=start)


def fast_marching(mesh: sh.TriangleMesh, start: dict[int, float]) -> Array:
    """Fast marching of Kimmel and Sethian 1998, first order, without unfolding of obtuse triangles."""
    values = np.full(mesh.n_vertices, np.inf)
    done = np.zeros(mesh.n_vertices, dtype=bool)
    around: list[list[tuple[int, int]]] = [[] for _ in range(mesh.n_vertices)]
    for face in mesh.faces.tolist():
        for k in range(3):
            around[face[k]].append((face[(k + 1) % 3], face[(k + 2) % 3]))
    heap = [(value, vertex) for vertex, value in start.items()]
    for value, vertex in heap:
        values[vertex] = value
    heapq.heapify(heap)
    points = mesh.vertices
    while heap:
        value, a = heapq.heappop(heap)
        if done[a] or value > values[a]:
            continue
        done[a] = True
        for b, c in around[a]:
            for here, other in ((b, c), (c, b)):
                if done[here]:
                    continue
                best = value + float(np.linalg.norm(points[here] - points[a]))
                if done[other]:
                    best = min(best, _front(points[here], points[a], points[other], value, float(values[other])))
                if best < values[here]:
                    values[here] = best
                    heapq.heappush(heap, (best, here))
    return values


def _front(x: Array, a: Array, b: Array, at_a: float, at_b: float) -> float:
    """Arrival at x of the plane front that arrives at a and b at these times; infinite if it comes from elsewhere."""
    sides = np.stack([a - x, b - x])
    inverse = np.linalg.pinv(sides @ sides.T)
    times, ones = np.array([at_a, at_b]), np.ones(2)
    p, q, r = ones @ inverse @ ones, ones @ inverse @ times, times @ inverse @ times - 1
    root = q * q - p * r
    if p <= 0 or root < 0:
        return np.inf
    arrival = (q + np.sqrt(root)) / p
    return float(arrival) if (inverse @ (times - arrival * ones) >= 0).all() else np.inf


def to_curves(mesh: sh.TriangleMesh, curves: list[sh.Curve]) -> Array:
    """Exact unsigned distance along a surface to the segments of curves, by our own search."""
    surface = discretize(mesh)
    parts = [part for group in surface.segments(curves) for part in group]
    return distance_to_segments(surface.triangles, PlacedSegments.of(surface.triangles, parts))[0]


def to_segments(points: Array, lines: list[sh.Polyline]) -> tuple[Array, NDArray[np.int64], Array]:
    """Distance to the nearest segment in the plane, which segment it is, and all segments (m, 2, 2)."""
    segments = np.concatenate([line.segments for line in lines])
    best, which = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    for k, (a, b) in enumerate(segments):
        along = np.clip(((points - a) @ (b - a)) / max((b - a) @ (b - a), 1e-300), 0, 1)
        distance = np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)
        nearer = distance < best
        best[nearer], which[nearer] = distance[nearer], k
    return best, which, segments


def pseudonormal_distance(points: Array, lines: list[sh.Polyline]) -> Array:
    """Distance with the side of the nearest segment as sign, negative to its right (Bærentzen and Aanæs 2005)."""
    best, which, segments = to_segments(points, lines)
    normal = (segments[:, 1] - segments[:, 0])[:, ::-1] * [-1, 1]
    closest = segments[which].mean(axis=1)
    return best * np.where(((points - closest) * normal[which]).sum(axis=1) >= 0, 1.0, -1.0)


def planar_winding(points: Array, lines: list[sh.Polyline]) -> Array:
    """Generalized winding number in the plane (Jacobson et al. 2013): 1 inside a clockwise loop."""
    total = np.zeros(len(points))
    for a, b in np.concatenate([line.segments for line in lines]):
        u, v = a - points, b - points
        total -= np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
    return total / (2 * np.pi)


def solid_winding(points: Array, mesh: sh.TriangleMesh) -> Array:
    """Generalized winding number in space (Jacobson et al. 2013), by libigl's fast evaluation."""
    import igl

    return igl.fast_winding_number(np.array(mesh.vertices), np.array(mesh.faces), np.ascontiguousarray(points))


def to_faces(points: Array, mesh: sh.TriangleMesh) -> Array:
    """Exact unsigned distance to the faces of a mesh, by libigl."""
    import igl

    return np.sqrt(igl.point_mesh_squared_distance(points, np.array(mesh.vertices), np.array(mesh.faces))[0])
