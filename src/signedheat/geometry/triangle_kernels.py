"""Kernels on triangles: edges, assembly of sparse matrices, fluxes, connected components."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled


@compiled
def find_edges(faces, degrees):
    """Edges of faces, by one list per vertex: an edge is in that of its end with fewer faces, so lists stay short."""
    first = np.full(len(degrees), -1)
    following = np.empty(faces.size, dtype=np.int64)
    vertices = np.empty((faces.size, 2), dtype=np.int64)
    face_edges = np.empty(faces.shape, dtype=np.int64)
    forward = np.empty(faces.shape, dtype=np.bool_)
    count = 0
    for f in range(len(faces)):
        for k in range(3):
            tail, head = faces[f, k], faces[f, (k + 1) % 3]
            keeper, other = tail, head
            if degrees[head] < degrees[tail] or (degrees[head] == degrees[tail] and head < tail):
                keeper, other = head, tail
            edge = first[keeper]
            while edge >= 0 and vertices[edge, 0] + vertices[edge, 1] - keeper != other:
                edge = following[edge]
            if edge < 0:
                edge = count
                vertices[edge, 0], vertices[edge, 1] = tail, head
                following[edge] = first[keeper]
                first[keeper] = edge
                count += 1
            face_edges[f, k] = edge
            forward[f, k] = vertices[edge, 0] == tail
    return vertices[:count].copy(), face_edges, forward


@compiled
def add_up(unknowns, diagonal, coupling, n):
    starts = np.zeros(n + 1, dtype=np.int64)
    for f in range(len(unknowns)):
        for k in range(3):
            i, j = unknowns[f, k], unknowns[f, (k + 1) % 3]
            starts[min(i, j) + 1] += i != j
    for i in range(n):
        starts[i + 1] += starts[i] + 1
    columns = np.empty(starts[n], dtype=np.int32)
    values = np.zeros(starts[n], dtype=coupling.dtype)
    ends = starts[:-1].copy()
    for i in range(n):
        columns[ends[i]] = i
        ends[i] += 1
    for f in range(len(unknowns)):
        for k in range(3):
            i, j, value = unknowns[f, k], unknowns[f, (k + 1) % 3], coupling[f, k]
            values[starts[i]] += diagonal[f, k]
            if i == j:
                values[starts[i]] += 2.0 * value.real
                continue
            if j < i:
                i, j, value = j, i, np.conj(value)
            columns[ends[i]] = j
            values[ends[i]] = value
            ends[i] += 1
    return _merge(starts, columns, values)


@compiled
def _merge(starts, columns, values):
    """Sort every row by column and sum entries with the same column, in place."""
    n, total = len(starts) - 1, 0
    merged = np.zeros(n + 1, dtype=np.int32)
    for i in range(n):
        begin, end = starts[i], starts[i + 1]
        gap = 1
        while end - begin > 64 and 9 * gap < end - begin:
            gap = 3 * gap + 1
        while gap > 0:  # Shell's sort, on short rows by insertion alone: Numba's own sorts take a second to compile
            for p in range(begin + gap, end):
                column, value, q = columns[p], values[p], p
                while q >= begin + gap and columns[q - gap] > column:
                    columns[q], values[q] = columns[q - gap], values[q - gap]
                    q -= gap
                columns[q], values[q] = column, value
            gap //= 3
        last = total
        for p in range(begin, end):
            if total > last and columns[p] == columns[total - 1]:
                values[total - 1] += values[p]
            else:
                columns[total], values[total] = columns[p], values[p]
                total += 1
        merged[i + 1] = total
    return merged, columns[:total].copy(), values[:total].copy()


@compiled
def gather(face_edges, directions, reflected, vectors):
    """Sum of the vectors at the three edges of each face, in its layout."""
    sums = np.empty(len(face_edges), dtype=np.complex128)
    for f in range(len(face_edges)):
        total = 0j
        for k in range(3):
            vector = vectors[face_edges[f, k]]
            total += directions[f, k] * (np.conj(vector) if reflected[f, k] else vector)
        sums[f] = total
    return sums


@compiled
def add_fluxes(corners, positions, directions, n):
    """``Σ ⟨½ opposite edge turned inward by 90°, Y⟩`` over the faces at every vertex, Y the direction of the face."""
    sums = np.zeros(n)
    for f in range(len(corners)):
        for k in range(3):
            opposite = positions[f, (k + 2) % 3] - positions[f, (k + 1) % 3]
            sums[corners[f, k]] += 0.5 * (opposite.real * directions[f].imag - opposite.imag * directions[f].real)
    return sums


@compiled
def areas_and_volumes(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], center: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(m,) areas of triangles, and volumes of the tetrahedra they make with a center: positive if it is behind them."""
    areas, volumes = np.empty(len(triangles)), np.empty(len(triangles))
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        wx, wy, wz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        areas[t] = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
        px, py, pz = vertices[a, 0] - center[0], vertices[a, 1] - center[1], vertices[a, 2] - center[2]
        volumes[t] = (px * nx + py * ny + pz * nz) / 6.0
    return areas, volumes
