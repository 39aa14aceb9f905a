"""Close the boundary of a chain of triangles by lids.

Of a small hole that lost no vertices, only the diagonals are unknown. Of all triangulations of its loop, the one whose
edges bend least, ``Σ length · angle`` with the rim's edges included (twice the total absolute mean curvature),
continues the faces around it; dynamic programming over the loop finds it (Barequet and Sharir 1995, Liepa 2003).
Larger holes get lids that bend as the surface does towards its rim (`continuation`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Frozen, Ints, mask_of
from ..compiled import compiled
from ..linear.threads import one_blas_thread
from ..mesh.box_tree import BoxTree
from ..mesh.components import connected_components, element_components, first_members, next_in_groups
from ..mesh.edges import EdgeTable, edge_keys, edge_table
from ..mesh.triangles import area_vectors, face_areas, side_lengths
from ..mesh.unit_vectors import ANGLE_ROUNDING, unit
from ..parallel import PointTree
from ..search.face_tree import FaceTree
from . import lids, walls
from .lids import Frame, Lid, frame_of, running_mean, vertex_normals
from .rims import boundary, corners_of, loops, open_edges, turning

STRIP_WIDTH = 0.25
"""Width of the strip of surface around an opening that is sampled, relative to the width of the opening."""
SMOOTH_COSINE = 0.7
"""Edges are sharp if the cosine between the normals of their faces is below this. With 0.75 lids of ducks that were cut
in two bulge farther, by a tenth of what they differ from flat ones."""
STRIP_SAMPLES = 16
"""Number of samples across the strip around an opening."""
MOST_RIM_SAMPLES = 16384
"""Faces around a rim are divided into no more samples than this. If there are more faces, only every second, third and
so on is sampled."""
HALF_BENDING_DEPTH = 0.03
"""Slopes of the surface count half if samples spread only this far across the rim, relative to the width of the strip,
and less if they spread less far."""
BEND_RATIO = 0.35
"""Ratio between how far a surface bends and how far it must bend to close its opening. A lid does not bend below this
ratio, and is clamped above twice this ratio. On a ball the ratio is 1."""
COVERED_DISTANCE = 0.25
"""Faces count as running along a bent lid if they are nearer to it than this, relative to its distance from the flat
lid."""


@dataclass(frozen=True, eq=False)
class RimSamples:
    """Samples of faces near a rim."""

    positions: Floats  # (k, 3)
    normals: Floats  # (k, 3) unit normals of their faces
    areas: Floats  # (k,) area that each stands for
    patches: Ints  # (k,) smooth patch of each


def width_of(lid: Lid) -> float:
    """Return the width of an opening, never 0: four times its area over the length of its rim, as of a circle."""
    rim = lid.vertices[: lid.n_rim]
    length = float(side_lengths(rim).sum())
    # less than 1e-9 of its length is rounding error
    return max(4.0 * float(face_areas(lid.vertices[lid.faces]).sum()) / length, 1e-9 * length)


def samples_near(triangles: Floats, tree: BoxTree, patches: Ints, rim: PointTree, reach: float) -> RimSamples:
    """Sample (m, 3, 3) triangles within reach of a rim, at most reach / `STRIP_SAMPLES` apart unless that are too many.

    `patches` are the (m,) patches of triangles, `tree` is one of their boxes, and `rim` one of points on the rim.
    """
    size = reach / STRIP_SAMPLES
    near_rim = np.sort(tree.meeting(np.stack([rim.mins, rim.maxes, rim.maxes])[None], reach)[1])
    triangles, patches = triangles[near_rim], patches[near_rim]
    # triangles that are not small enough are divided in four, until all are, or there are too many
    parts, labels, count = [np.zeros((0, 3, 3))], [np.zeros(0, dtype=np.int64)], 0
    while len(triangles):
        centres = triangles.mean(axis=1)
        radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
        away = rim.query(centres)[0]
        triangles, patches, radii, away = (values[away < reach + radii] for values in (triangles, patches, radii, away))
        fine = radii <= size
        fine |= count + 4 * int((~fine).sum()) > MOST_RIM_SAMPLES
        chosen = fine & (away < reach)
        count += int(chosen.sum())
        parts.append(triangles[chosen])
        labels.append(patches[chosen])
        a, b, c = triangles[~fine].transpose(1, 0, 2)
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2  # middles of the sides
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
        patches = np.tile(patches[~fine], 4)
    pieces = np.concatenate(parts)
    vectors, areas = area_vectors(pieces), face_areas(pieces)
    proper = np.flatnonzero(areas > 0)
    proper = proper[:: max(1, len(proper) // MOST_RIM_SAMPLES)]
    normals = vectors[proper] / areas[proper, None]
    return RimSamples(pieces.mean(axis=1)[proper], normals, areas[proper], np.concatenate(labels)[proper])


def continuation(lid: Lid, samples: RimSamples, patches: Ints, width: float) -> tuple[Floats, Floats, Floats]:
    """Estimate how a surface continues beyond its rim: (n, 3) normals, (n,) curvatures, and (n,) weights of both.

    `lid` is the flat lid, `patches` are the (n,) patches that end at the edges of its rim, and `width` is that of the
    opening. A surface that meets the flat lid of an opening of width W at angle β must bend by 2 sin β to cross the
    opening. With its curvature k it would bend by k W. On a ball the two are equal, on a box k is 0. Weights rise with
    their ratio from 0 to 1.
    """
    n, loop = lid.n_rim, lid.vertices[: lid.n_rim]
    reach = STRIP_WIDTH * width
    window = max(1, min(n // 4, round(reach / side_lengths(loop).mean())))  # points on each side over which to smooth
    tangents = unit(np.roll(loop, -window, axis=0) - np.roll(loop, window, axis=0))
    normals, slopes, frames, enough = _normals_at_rim(samples, loop, tangents, patches, reach)
    outwards = unit(np.cross(normals, tangents))  # across the rim, in the surface
    bends = width * (slopes[:, 0] * outwards).sum(axis=1)  # k W
    needed = 2.0 * (outwards * vertex_normals(lid)[:n]).sum(axis=1)  # 2 sin β
    less, more = np.minimum(np.abs(bends), np.abs(needed)), np.maximum(np.abs(bends), np.abs(needed))
    ratio = np.sign(bends * needed) * less / np.maximum(more, ANGLE_ROUNDING)
    ratio *= enough
    # 0 on threads, which bend both ways
    consistency = max(float(ratio.sum()), 0.0) / max(float(np.abs(ratio).sum()), 1e-300)
    weights = consistency * np.clip(ratio / BEND_RATIO - 1.0, 0.0, 1.0)
    # no more curvature than the lid needs to cross the opening
    fits = np.minimum(1.0, np.abs(needed) / np.maximum(np.abs(bends), ANGLE_ROUNDING))
    curvatures = np.where(enough, fits * (slopes * frames).sum(axis=(1, 2)), 0.0)
    smooth_weights = np.where(normals.any(axis=1), running_mean(weights, window), 0.0)
    return normals, running_mean(curvatures, window), smooth_weights


def _normals_at_rim(
    samples: RimSamples, loop: Floats, tangents: Floats, patches: Ints, reach: float
) -> tuple[Floats, Floats, Floats, Bools]:
    """Fit a linear function of position to the normals of the samples near each of the (n, 3) points of a rim.

    `tangents`, (n, 3), are those of the rim, and `patches`, (n,), end there. Return (n, 3) unit normals at the points,
    (n, 2, 3) derivatives of the normal along two directions, (n, 2, 3) these directions, across and along the rim, and
    (n,) whether there are enough samples; without, normals are 0.
    """
    # weighted means over the samples near each point
    n = len(loop)
    rows, near, distances = _within(samples, loop, patches, reach)
    weights = samples.areas[near] * (1.0 - (distances / reach) ** 2)  # falls to 0 at the reach
    weights /= np.maximum(np.bincount(rows, weights, n), 1e-300)[rows]
    means = sparse.csr_array((weights, (rows, near)), shape=(n, len(samples.areas)))
    positions, corners = samples.positions - loop[0], loop - loop[0]
    mean_normals, mean_positions = means @ samples.normals, means @ positions

    def covariance(values: Floats) -> Floats:
        """(n, 3, 3) covariances of positions and (k, 3) values over the samples near each point of the rim."""
        products = means @ (positions[:, :, None] * values[:, None]).reshape(-1, 9)
        return products.reshape(-1, 3, 3) - mean_positions[:, :, None] * (means @ values)[:, None]

    across = np.cross(mean_normals, tangents)
    enough = (np.bincount(rows, minlength=n) >= 3) & (np.linalg.norm(across, axis=1) > 1e-6)
    across = unit(across)
    frames = np.stack([across, unit(np.cross(mean_normals, across))], axis=1)
    offsets = np.einsum("nij,nj->ni", frames, mean_positions - corners)
    # least squares with a ridge: the covariance of normals over that of positions in the frame
    spread = frames @ covariance(positions) @ frames.transpose(0, 2, 1) + (HALF_BENDING_DEPTH * reach) ** 2 * np.eye(2)
    slopes = np.linalg.solve(spread, frames @ covariance(samples.normals))
    normals = unit(mean_normals - np.einsum("ni,nij->nj", offsets, slopes)) * enough[:, None]
    return normals, slopes, frames, enough


def _within(samples: RimSamples, loop: Floats, patches: Ints, reach: float) -> tuple[Ints, Ints, Floats]:
    """Pair the (n, 3) points of a loop with the samples within reach that are on the patch, (n,), of the point.

    Return (p,) indices of points, (p,) indices of samples, and (p,) distances.
    """
    rim, near = PointTree(loop), PointTree(samples.positions)
    pairs = rim.sparse_distance_matrix(near, reach, output_type="ndarray")
    pairs = pairs[samples.patches[pairs["j"]] == patches[pairs["i"]]]
    return pairs["i"], pairs["j"], pairs["v"]


LOST_FACE_SIDES = 16
"""Holes with up to this many sides are closed by triangles between their vertices. Larger ones may have lost vertices,
too."""
LARGEST_BEND = np.deg2rad(70.0)
"""Triangles continue the surface if the root mean square of the angles at the rim is below this. At the end of a tube
it is 90°."""


def least_bent(vertices: Floats, loops: list[Ints], normals: Floats, taken: Ints, most: float) -> list[Ints]:
    """Fill each loop of n vertices by (n − 2, 3) triangles of least bend, or by none if it bends too much.

    `most` is the largest bend at the rim, see `LARGEST_BEND`. Loops run counterclockwise as seen from outside.
    `normals` are those of the faces behind their edges, loop by loop. Diagonals must not be edges of the mesh, whose
    sorted `edge_keys` are `taken`.
    """
    starts = np.concatenate([[0], np.cumsum([len(loop) for loop in loops], dtype=np.int64)])
    if not len(loops):
        return []
    all_vertices = np.concatenate(loops)
    faces, closed = _least_bent(
        vertices[all_vertices], all_vertices, np.ascontiguousarray(normals), starts, taken, most
    )
    begins = starts - 2 * np.arange(len(starts))
    return [
        all_vertices[a + faces[b:c]] if closes else np.empty((0, 3), dtype=np.int64)
        for a, b, c, closes in zip(starts[:-1], begins[:-1], begins[1:], closed.tolist(), strict=True)
    ]


@compiled
def _least_bent(
    corners: Floats, ids: Ints, normals: Floats, starts: Ints, taken: Ints, most: float
) -> tuple[Ints, Bools]:
    """Return (m, 3) triangles of h loops, as indices into their loops, and (h,) whether each bends at most `most`.

    The (n, 3) corners, (n,) ids of vertices and (n, 3) normals are given loop by loop, from (h + 1,) `starts` on. No
    diagonal may have one of the sorted keys `taken`. In the body, `cost[i, j]` is the bend of the best lid between
    corners i and j, and `rims[i, j]` the sum of lengths times squared angles where this lid meets the rim. Such a lid
    is a triangle i, k, j and the best lids between i and k and between k and j.
    """
    n_loops = len(starts) - 1
    faces, closed = np.empty((len(corners) - 2 * n_loops, 3), dtype=np.int64), np.zeros(n_loops, dtype=np.bool_)
    size = 0
    for h in range(n_loops):
        size = max(size, starts[h + 1] - starts[h])
    # `across[i, j]` is the normal of that lid's triangle at the diagonal, and `split[i, j]` its third corner
    cost, rims, across = np.empty((size, size)), np.empty((size, size)), np.empty((size, size, 3))
    split, stack, normal = np.empty((size, size), dtype=np.int64), np.empty((size, 2), dtype=np.int64), np.empty(3)
    count = 0
    for h in range(n_loops):
        begin, n = starts[h], starts[h + 1] - starts[h]
        points = corners[begin : begin + n]
        perimeter = 0.0
        for i in range(n):
            perimeter += _length(points[i], points[(i + 1) % n])
            if i < n - 1:
                cost[i, i + 1] = rims[i, i + 1] = 0.0
                across[i, i + 1] = normals[begin + i]
        # the best lids between corners that are farther and farther apart
        for span in range(2, n):
            for i in range(n - span):
                j = i + span
                cost[i, j], split[i, j] = np.inf, i + 1
                key = (min(ids[begin + i], ids[begin + j]) << 32) | max(ids[begin + i], ids[begin + j])
                place = np.searchsorted(taken, key)
                if span < n - 1 and place < len(taken) and taken[place] == key:
                    continue
                for k in range(i + 1, j):
                    if not cost[i, k] + cost[k, j] < cost[i, j]:
                        continue
                    _normal(points[i], points[k], points[j], normal)
                    before, behind = _angle(normal, across[i, k]), _angle(normal, across[k, j])
                    length_before, length_behind = _length(points[i], points[k]), _length(points[k], points[j])
                    total = cost[i, k] + cost[k, j] + length_before * before + length_behind * behind
                    if not normal.any():  # triangles without area are the last choice
                        total += np.pi * (length_before + length_behind)
                    if total < cost[i, j]:
                        cost[i, j], split[i, j], across[i, j] = total, k, normal
                        rims[i, j] = rims[i, k] + rims[k, j]
                        if k == i + 1:
                            rims[i, j] += length_before * before**2
                        if k == j - 1:
                            rims[i, j] += length_behind * behind**2
        # the whole loop, whose last edge is from corner n − 1 to 0, and its triangles
        last = _length(points[n - 1], points[0])
        bend = rims[0, n - 1] + last * _angle(across[0, n - 1], normals[begin + n - 1]) ** 2
        closed[h] = cost[0, n - 1] < np.inf and bend <= most**2 * perimeter
        stack[0, 0], stack[0, 1], depth = 0, n - 1, 1
        while depth > 0:
            depth -= 1
            i, j = stack[depth]
            if j - i > 1:
                k = split[i, j]
                faces[count, 0], faces[count, 1], faces[count, 2] = i, k, j
                count += 1
                stack[depth, 0], stack[depth, 1], stack[depth + 1, 0], stack[depth + 1, 1] = i, k, k, j
                depth += 2
    return faces, closed


@compiled
def _length(a: Floats, b: Floats) -> float:
    """Distance between two points, (3,) each."""
    return float(np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2))


@compiled
def _normal(a: Floats, b: Floats, c: Floats, normal: Floats) -> None:
    """Write the unit normal of the triangle with corners a, b and c to `normal`; 0 if it has no area."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    size = np.sqrt(x * x + y * y + z * z)
    scale = 1.0 / size if size > 0 else 0.0
    normal[0], normal[1], normal[2] = x * scale, y * scale, z * scale


@compiled
def _angle(a: Floats, b: Floats) -> float:
    """Return the angle between two unit vectors; 0 where one of them is 0."""
    if (a[0] == 0 and a[1] == 0 and a[2] == 0) or (b[0] == 0 and b[1] == 0 and b[2] == 0):
        return 0.0
    return float(np.arccos(min(max(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], -1.0), 1.0)))


NO_EDGES = np.empty((0, 2), dtype=np.int64)
"""An empty array of edges."""


def closed_by(vertices: Floats, faces: Ints, *, bent: bool = True, outlines: Ints = NO_EDGES) -> tuple[Floats, Ints]:
    """Close the boundary of (m, 3) triangles; return all vertices, given and new, and (p, 3) new triangles.

    Small holes are filled by triangles between their corners, and rims that run along each other are joined by strips.
    Other loops get lids that continue the curvature of the surface if `bent`, or else lids of flat faces or of nearly
    least area. Boundary edges among `outlines`, (k, 2), stay open.
    """
    faces = np.asarray(faces, dtype=np.int64)
    if len(boundary(faces)) == len(outlines):
        return vertices, np.empty((0, 3), dtype=np.int64)
    centre = vertices[np.unique(faces)].mean(axis=0)
    positions = vertices - centre
    chain = np.concatenate([faces, small_lids(positions, faces, bent, outlines)])
    chain = np.concatenate([chain, strips(positions, chain, outlines)])
    surface = _Surface(positions, chain, outlines)
    with one_blas_thread():  # systems of a few hundred unknowns: threads would only wait
        new, count = [vertices], len(vertices)
        triangles = [chain]
        for loop in surface.loops:
            points, lid = _lid(surface, loop, bent)
            names = np.concatenate([loop, count + np.arange(len(points))])
            triangles.append(names[lid])
            new.append(points + centre)
            count += len(points)
    closed = np.concatenate(triangles)
    assert len(boundary(closed)) == len(outlines), "lids balance each directed edge"
    return np.concatenate(new), closed[len(faces) :]


@dataclass(frozen=True, eq=False)
class _Surface(Frozen):
    """Triangles with cached properties for closing their boundary."""

    vertices: Floats  # (n, 3)
    faces: Ints  # (m, 3)
    outlines: Ints = field(default_factory=lambda: NO_EDGES)  # (k, 2) boundary edges that stay open

    @cached_property
    def loops(self) -> list[Ints]:
        """Vertices of each closed loop of boundary edges that are not outlines."""
        edges, n = boundary(self.faces), len(self.vertices)
        # outlines are taken out one by one, since an edge may be there several times
        keys, left = edges @ [n, 1], np.sort(self.outlines @ [n, 1])
        order, copies = np.argsort(keys, kind="stable"), np.arange(len(left)) - np.searchsorted(left, left)
        edges = np.delete(edges, order[np.searchsorted(keys[order], left) + copies], axis=0)
        return loops(self.vertices, self.faces, edges)

    @cached_property
    def triangles(self) -> Floats:
        """(m, 3, 3) corners."""
        return self.vertices[self.faces]

    @cached_property
    def edges(self) -> EdgeTable:
        """Edges of the triangles."""
        return edge_table(self.faces)

    @cached_property
    def areas(self) -> Floats:
        """(m,) areas."""
        return face_areas(self.triangles)

    @cached_property
    def normals(self) -> Floats:
        """(m, 3) unit normals; triangles without area, up to rounding, get that of their largest neighbour."""
        normals = unit(area_vectors(self.triangles))
        normals[self.areas <= ANGLE_ROUNDING * side_lengths(self.triangles).max(axis=1) ** 2] = 0.0
        first, second = np.concatenate([self.edges.pairs, self.edges.pairs[:, ::-1]]).T // 3
        ascending = np.argsort(self.areas[second], kind="stable")
        first, second = first[ascending], second[ascending]
        while True:
            fills = ~normals[first].any(axis=1) & normals[second].any(axis=1)
            if not fills.any():
                return normals
            normals[first[fills]] = normals[second[fills]]

    @cached_property
    def parts(self) -> Ints:
        """(m,) component of each face, connected by shared edges."""
        return element_components(self.edges.face_edges)

    @cached_property
    def patches(self) -> Ints:
        """(m,) smooth patch of each face, connected by edges that are not sharp."""
        first, second = self.edges.pairs.T // 3
        smooth = (self.normals[first] * self.normals[second]).sum(axis=1) > SMOOTH_COSINE
        return connected_components(len(self.faces), first[smooth], second[smooth])

    @cached_property
    def bends(self) -> Bools:
        """(p,) whether each patch is curved: its normals differ by more than rounding."""
        first = self.normals[first_members(self.patches, int(self.patches.max()) + 1)]
        off = np.abs(self.normals - first[self.patches]).max(axis=1) > ANGLE_ROUNDING
        return mask_of(len(first), self.patches[off])

    @cached_property
    def tree(self) -> BoxTree:
        """Tree of the faces' boxes."""
        return BoxTree.around(self.triangles)

    @cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        """(k,) sorted keys of directed sides of faces at the loops, and (k,) these sides, 3 f + c.

        Among sides with the same key, the first is of an open piece if possible, and of the largest face.
        """
        on_rim = mask_of(len(self.vertices), np.concatenate(self.loops))
        rows = np.flatnonzero(on_rim[self.faces].any(axis=1))
        keys = (self.faces[rows] * len(self.vertices) + np.roll(self.faces[rows], -1, axis=1)).ravel()
        sides = (3 * rows[:, None] + np.arange(3)).ravel()
        if len(np.unique(keys)) == len(keys):
            order = np.argsort(keys)
        else:
            pieces = connected_components(len(self.faces), *self.edges.pairs.T // 3)
            closed = ~np.isin(pieces[rows], open_edges(self.faces, pieces)[1])
            order = np.lexsort((-np.repeat(self.areas[rows], 3), np.repeat(closed, 3), keys))
        return keys[order], sides[order]

    def behind(self, tails: Ints, heads: Ints) -> tuple[Ints, Ints]:
        """(n,) faces behind the edges of loops from (n,) tails to heads, and (n,) the third vertices of these faces."""
        keys, sides = self._sides
        face, side = np.divmod(sides[np.searchsorted(keys, heads * len(self.vertices) + tails)], 3)
        return face, self.faces[face, (side + 2) % 3]


def small_lids(vertices: Floats, faces: Ints, bent: bool = True, outlines: Ints = NO_EDGES) -> Ints:
    """(k, 3) triangles that fill gaps without area, and if `bent` small holes, between their vertices.

    Boundary edges of the (m, 3) faces among `outlines`, (k, 2), stay open.
    """
    surface = _Surface(vertices, faces, outlines)
    if not surface.loops:
        return np.empty((0, 3), dtype=np.int64)
    # loops with a corner or two enclose nothing; those with few corners are tried
    triangles, chosen, corners, normals = [np.empty((0, 3), dtype=np.int64)], [], [], []
    starts = np.cumsum([0, *map(len, surface.loops)])
    tails, following = np.concatenate([*surface.loops, starts[:0]]), next_in_groups(starts)
    of_loops = turning(surface.vertices[tails], following), surface.behind(tails, tails[following])[0]
    turns, behind = (np.split(values, starts[1:-1]) for values in of_loops)
    for loop, is_corner, faces_behind in zip(surface.loops, turns, behind, strict=True):
        corner_indices = np.flatnonzero(is_corner)
        if len(corner_indices) < 3:
            triangles.append(fan(loop))
        elif bent and len(corner_indices) <= LOST_FACE_SIDES:
            chosen.append(loop)
            corners.append(corner_indices)
            normals.append(surface.normals[faces_behind[corner_indices]])
    if not chosen:
        return np.concatenate(triangles)
    rims = [loop[corner_indices] for loop, corner_indices in zip(chosen, corners, strict=True)]
    at_corners = mask_of(len(surface.vertices), np.concatenate(rims))
    edges = surface.edges.vertices
    edges = edges[at_corners[edges].all(axis=1)]
    existing_keys = np.sort(edge_keys(edges[:, 0], edges[:, 1]))
    small = least_bent(surface.vertices, rims, np.concatenate(normals), existing_keys, LARGEST_BEND)
    for loop, corner_indices, lid in zip(chosen, corners, small, strict=True):
        if len(lid):
            triangles.append(_with_sides(loop, corner_indices, lid))
    return np.concatenate(triangles)


def _with_sides(loop: Ints, places: Ints, lid: Ints) -> Ints:
    """Divide the (k, 3) triangles of a lid between corners of a loop, at indices `places`, at its other points."""
    for begin, end in zip(places, [*places[1:], places[0] + len(loop)], strict=True):
        side = loop[np.arange(begin, end + 1) % len(loop)]
        if len(side) > 2:
            row, corner = np.argwhere((lid == side[0]) & (np.roll(lid, -1, axis=1) == side[-1]))[0]
            apex = np.full(len(side) - 1, lid[row, corner - 1])
            lid = np.concatenate([np.delete(lid, row, axis=0), np.stack([side[:-1], side[1:], apex], axis=1)])
    return lid


def fan(points: Ints) -> Ints:
    """(k − 2, 3) triangles from the first of k points to each pair of successive others."""
    return np.stack([np.full(len(points) - 2, points[0]), points[1:-1], points[2:]], axis=1)


def strips(vertices: Floats, faces: Ints, outlines: Ints = NO_EDGES) -> Ints:
    """(k, 3) triangles of strips between boundary loops that run along each other, in part or all around.

    Boundary edges of the (m, 3) faces among `outlines`, (k, 2), stay open.
    """
    surface = _Surface(vertices, faces, outlines)
    chain = np.concatenate([faces, *walls.seams(_rims(surface))])
    surface = _Surface(vertices, chain, outlines)
    rims = _rims(surface)
    areas = np.bincount(surface.parts, surface.areas).astype(np.float64) if rims else np.zeros(0)
    ends = [walls.strip(rims[i], rims[j]) for i, j in walls.facing(rims, areas)]  # as of a bowl without its lip
    return np.concatenate([chain, *ends])[len(faces) :]


def _rims(surface: _Surface) -> list[walls.Rim]:
    """List the boundary loops, except those with edges of single triangles."""
    if not surface.loops:
        return []
    counts = np.bincount(surface.parts)
    rims = []
    for loop in surface.loops:
        face, third = surface.behind(loop, np.roll(loop, -1))
        parts = surface.parts[face]
        if (counts[parts] > 1).all():
            rims.append(walls.Rim.of(loop, surface.vertices[loop], surface.vertices[third], parts))
    return rims


def _lid(surface: _Surface, loop: Ints, bent: bool) -> tuple[Floats, Ints]:
    """Make the lid of a loop of n vertices: (k, 3) added points, and (m, 3) triangles.

    Indices below n are those of the loop, and others are added points. If `bent`, the lid continues the curvature of
    the surface. Otherwise it has flat faces, or nearly the least area.
    """
    corners = surface.vertices[loop]
    if len(loop) == 3:
        return np.empty((0, 3)), np.array([[0, 1, 2]])
    behind = surface.behind(loop, np.roll(loop, -1))[0]
    bends = bent and bool(surface.bends[surface.patches[behind]].any())
    if not bends and (lid := _of_flat_faces(corners, surface.normals[behind], bent)):
        return lid
    for frame in (frame_of(corners), None):  # in the plane of the loop, else in a disc
        if lid := _spanned(surface, loop, behind, frame, bends):
            return lid
    raise AssertionError("a disc has room for every loop")


def _of_flat_faces(corners: Floats, normals: Floats, bent: bool) -> tuple[Floats, Ints] | None:
    """Make a lid of flat faces, or, if it has few corners and may be bent, of triangles between them; None if neither.

    `corners` are the (n, 3) points of the loop, `normals` those of the faces behind its edges. It returns what `_lid`
    does.
    """
    lid = lids.creased(corners, normals)
    if lid is not None:
        return lid
    ids = corners_of(corners)
    if len(ids) < 3:
        return np.empty((0, 3)), fan(np.arange(len(corners)))
    if bent and len(ids) <= LOST_FACE_SIDES:
        triangles = least_bent(corners, [ids], normals[ids], np.empty(0, dtype=np.int64), np.inf)[0]
        return np.empty((0, 3)), _with_sides(np.arange(len(corners)), ids, triangles)
    return None


def _spanned(
    surface: _Surface, loop: Ints, behind: Ints, frame: Frame | None, bends: bool
) -> tuple[Floats, Ints] | None:
    """Make the lid of a loop of n vertices, triangulated in the plane `frame`, or in a disc without one.

    Return what `_lid` does: (k, 3) added points and (m, 3) triangles; None if the loop crosses itself there. `behind`
    are the (n,) faces behind the edges of the loop. The lid is curved if `bends` and the surface tells how; otherwise
    it has nearly the least area.
    """
    corners = surface.vertices[loop]
    rim = lids.SmoothRim.of(corners)
    pattern = lids.pattern(rim, frame)
    if pattern is None:
        return None
    film = lids.film(pattern)
    plate = _plate(surface, film, behind[rim.edges_at(film.shares)]) if bends else None
    if plate is not None and _is_covered(surface, plate, film):
        plate = None
    elif bends and plate is None and (lid := _of_flat_faces(corners, surface.normals[behind], True)):
        return lid
    return lids.draped(corners, rim.starts, frame, plate or film)


def _plate(surface: _Surface, film: Lid, behind: Ints) -> Lid | None:
    """Bend the lid of least area as the surface bends towards its rim; None if that is not known or not possible.

    `behind` are the (n_rim,) faces behind the edges of its rim.
    """
    width, rim_points = width_of(film), PointTree(film.vertices[: film.n_rim])
    samples = samples_near(surface.triangles, surface.tree, surface.patches, rim_points, STRIP_WIDTH * width)
    normals, curvatures, held = continuation(film, samples, surface.patches[behind], width)
    return lids.plate(film, normals, curvatures, held, width) if held.any() else None


def _is_covered(surface: _Surface, bent: Lid, flat: Lid) -> bool:
    """Whether faces of the surface run along most of a bent lid, so that nothing is missing there."""
    lid = bent.vertices[bent.faces]
    centres, areas = lid.mean(axis=1), face_areas(lid)
    heights = np.linalg.norm(centres - flat.vertices[flat.faces].mean(axis=1), axis=1)
    low, high = centres.min(axis=0), centres.max(axis=0)
    near = surface.tree.meeting(np.stack([low, high, high])[None], COVERED_DISTANCE * float(heights.max()))[1]
    if not len(near):
        return False
    tree = FaceTree.of_triangles(surface.triangles[near])
    faces, squares = tree.nearest(centres)
    same_way = (unit(area_vectors(lid)) * surface.normals[near[tree.features.ids[faces]]]).sum(axis=1) > 0
    covered = same_way & (np.sqrt(squares) < COVERED_DISTANCE * heights)
    return bool(areas @ covered > 0.5 * areas.sum())
