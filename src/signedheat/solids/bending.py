"""How a surface bends towards its rim: whether it would continue over the opening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..arrays import Floats, Ints
from ..mesh.box_tree import BoxTree
from ..mesh.components import connected_components, sums_of
from ..mesh.edges import edge_table
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.unit_vectors import unit
from .lids import Lid, running_mean, vertex_normals

REACH = 0.25
"""Share of an opening's width in which the surface behind its rim is looked at."""
SHARP = 0.7
"""Cosine between the normals of two faces below which the edge between them is sharp."""
SAMPLES = 16
"""Samples across that strip."""
MOST = 32768
"""Samples around a rim at most, or nearly."""
DIVIDED = 1 << 20
"""Triangles behind a rim that are made by division at most, of which `MOST` are taken: those of a flat side behind
slots .0012 to .1 as wide as they are long are 430,000 to 140,000."""
STIFF = 0.03
"""Depth of a wall, over that strip's, whose bending counts by half."""
AGREEMENT = 0.35
"""Ratio of how far a surface bends and how far it would have to, or of the latter and the former, up to which its lid
does not bend; from twice that on it is clamped. 1 on a ball."""
NARROWEST = 1e-9
"""Least width of an opening, over the length of its rim: about what rounding leaves of one."""
UNBENT = 1e-6
"""Turn of a surface, in radians, that rounding makes of none."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Places on faces near a rim: (k, 3) positions, (k, 3) unit normals, (k,) areas and smooth patches they are of."""

    positions: Floats
    normals: Floats
    areas: Floats
    patches: Ints


def width_of(lid: Lid) -> float:
    """Four areas over the length of the rim, the diameter of a circle; of slits without area not nothing."""
    rim = lid.vertices[: lid.n_rim]
    length = float(np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1).sum())
    return max(4.0 * float(face_areas(lid.vertices[lid.faces]).sum()) / length, NARROWEST * length)


def smooth_patches(triangles: Floats, ids: Ints) -> Ints:
    """(m,) which faces hang together across edges that are not sharp."""
    table = edge_table(ids)
    normals, (one, other) = unit(area_vectors(triangles)), table.pairs.T // 3
    smooth = (normals[one] * normals[other]).sum(axis=1) > SHARP
    return connected_components(len(ids), one[smooth], other[smooth])


def samples_near(triangles: Floats, tree: BoxTree, patches: Ints, rim: scipy.spatial.cKDTree, reach: float) -> Samples:
    """Sample triangles in a tree within reach of a rim, at most reach / `SAMPLES` apart, unless too many are."""
    size = reach / SAMPLES
    some = np.sort(tree.meeting(np.stack([rim.mins, rim.maxes, rim.maxes])[None], reach)[1])
    triangles, patches = triangles[some], patches[some]
    near, labels, divided = [np.zeros((0, 3, 3))], [np.zeros(0, dtype=np.int64)], 0
    while len(triangles):
        centres = triangles.mean(axis=1)
        radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
        away = rim.query(centres)[0]
        triangles, patches, radii, away = (each[away < reach + radii] for each in (triangles, patches, radii, away))
        fine = radii <= size
        divided += 4 * int((~fine).sum())
        fine |= divided > DIVIDED
        chosen = fine & (away < reach)
        near.append(triangles[chosen])
        labels.append(patches[chosen])
        a, b, c = triangles[~fine].transpose(1, 0, 2)
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
        patches = np.tile(patches[~fine], 4)
    found = np.concatenate(near)
    vectors, areas = area_vectors(found), face_areas(found)
    proper = np.flatnonzero(areas > 0)
    proper = proper[:: max(1, len(proper) // MOST)]
    normals = vectors[proper] / areas[proper, None]
    return Samples(found.mean(axis=1)[proper], normals, areas[proper], np.concatenate(labels)[proper])


def continuation(lid: Lid, samples: Samples, patches: Ints, width: float) -> tuple[Floats, Floats, Floats]:
    """Return normals and curvatures with which the surface would continue over its rim, and how much that counts.

    Across an opening of width W a surface that meets the flat lid at angle β must turn by 2 sin β, the chord of a
    circle; if its curvature towards the rim is k, it would turn by k W. On a ball both are the same, on a box k is 0.
    The samples are of the surface behind the flat lid; at each place of the rim the smooth patch `patches` ends.

    Returns
    -------
    normals : (n, 3) float
        Unit normals of the surface at the rim.
    curvatures : (n,) float
        Sums of its principal curvatures there, positive on a ball.
    held : (n,) float
        1 where the surface bends as it must, 0 where it does not.
    """
    n, loop = lid.n_rim, lid.vertices[: lid.n_rim]
    reach = REACH * width
    steps = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)
    m = max(1, min(n // 4, round(reach / steps.mean())))
    along = unit(np.roll(loop, -m, axis=0) - np.roll(loop, m, axis=0))
    rows, near = _within(samples, loop, patches, reach)

    def means(values: Floats) -> Floats:
        """Over the samples near each place."""
        return sums_of(np.einsum("k,k...->k...", weights, values), rows, n)

    x, normals, areas = samples.positions[near] - loop[rows], samples.normals[near], samples.areas[near]
    weights = areas * (1.0 - (x * x).sum(axis=1) / reach**2)  # what comes into reach weighs nothing yet
    weights /= np.maximum(np.bincount(rows, weights, n), 1e-300)[rows]
    middle = means(normals)
    way = np.cross(middle, along)
    enough = (np.bincount(rows, minlength=n) >= 3) & (np.linalg.norm(way, axis=1) > 1e-6)
    way = unit(way)
    frame = np.stack([way, unit(np.cross(middle, way))], axis=1)
    at = np.einsum("kij,kj->ki", frame[rows], x)
    mean = means(at)
    at = at - mean[rows]
    spread = means(at[:, :, None] * at[:, None, :]) + (STIFF * reach) ** 2 * np.eye(2)
    slopes = np.linalg.solve(spread, means(at[:, :, None] * (normals - middle[rows])[:, None, :]))
    at_rim = unit(middle - np.einsum("ni,nij->nj", mean, slopes)) * enough[:, None]
    outwards = unit(np.cross(at_rim, along))
    bends, must = width * (slopes[:, 0] * outwards).sum(axis=1), 2.0 * (outwards * vertex_normals(lid)[:n]).sum(axis=1)
    least, most = np.minimum(np.abs(bends), np.abs(must)), np.maximum(np.abs(bends), np.abs(must))
    ratio = np.sign(bends * must) * least / np.maximum(most, UNBENT)
    held = enough * np.clip(ratio / AGREEMENT - 1.0, 0.0, 1.0)
    fits = np.minimum(1.0, np.abs(must) / np.maximum(np.abs(bends), UNBENT))  # more curved, it would not come round
    curvatures = np.where(enough, fits * (slopes * frame).sum(axis=(1, 2)), 0.0)
    return at_rim, running_mean(curvatures, m), np.where(at_rim.any(axis=1), running_mean(held, m), 0.0)


def _within(samples: Samples, loop: Floats, patches: Ints, reach: float) -> tuple[Ints, Ints]:
    """Pairs of a place of a rim and a sample within reach of it, of the patch that ends there."""
    if not len(samples.positions):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    found = scipy.spatial.cKDTree(samples.positions).query_ball_point(loop, reach, return_sorted=True)
    rows = np.repeat(np.arange(len(loop)), [len(each) for each in found])
    near = np.concatenate([np.asarray(each, dtype=np.int64) for each in found])
    own = samples.patches[near] == patches[rows]
    return rows[own], near[own]
