"""Shapes in space as sources on a tet mesh: X₀ of Eq. 12 (Sec. 8.1), and the rows A of Eq. 14 that average φ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Frozen, Ints
from ..diagnostics import Note, OutsideMesh
from ..errors import SourceError
from ..mesh.components import sums_of
from ..mesh.unit_vectors import unit
from ..shapes.area_elements import AreaElements, area_elements
from .tet_clipping import ClippedPolygons, Planes, barycentric, clip_triangles, containing_tets
from .tet_mesh import TetMesh


@dataclass(frozen=True, eq=False)
class TetSource(Frozen):
    """Sources lowered to a tet mesh: what the signed heat method needs of them.

    φ is averaged over patches. A patch belongs to one vertex of the mesh and one component of the sources. It consists
    of the clipped polygons nearest to the vertex, and of a third of each face at the vertex that the component covers.
    """

    vectors: Floats  # (f, 3) X₀ at the faces
    strengths: Floats  # (f,) the scalar source: areas without their normals, as for an unsigned distance
    centers: Floats  # (p, 3) centroids of the clipped polygons
    time: float  # t of Eq. 12
    interpolation: sparse.csr_matrix  # (s, n) row i averages φ over patch i
    # (s, 3n) maps gradients of φ at the unknowns (x, y, z of each in turn) to the difference, averaged over patches,
    # between a quadratic φ and its linear interpolant
    quadratic_correction: sparse.csr_matrix
    weights: Floats  # (s,) area of each patch
    components: Ints  # (s,) connected component that each patch belongs to
    source_ids: Ints  # (s,) source that each patch belongs to
    notes: tuple[Note, ...]  # the parts of the sources that lie outside the mesh


def tet_source(
    mesh: TetMesh, planes: Planes, unknowns: Ints, sources: Sequence[Any], diffusion: float, spacing: float
) -> TetSource:
    """Clip sources against a tet mesh, and lower them; ``t = diffusion · max(spacing, h_source)²``.

    `unknowns` are the (m, 4) unknowns of φ at the corners of tets.
    """
    cuts, components, outside, n_components, n_unknowns = [], [], np.zeros(len(sources)), 0, int(unknowns.max()) + 1
    for number, source in enumerate(sources):
        elements = area_elements(source)
        if elements.corners.shape[2] != 3:
            raise SourceError(
                f"source {number} ({source!r}) does not lie in space of three dimensions, as tets do",
                element=f"source {number}",
            )
        if not elements.vectors.any():
            raise SourceError(
                f"source {number} ({source!r}) has no area at all: its faces are degenerate", element=f"source {number}"
            )
        polygons = _cut(mesh, planes, elements)
        if len(polygons.tets) == 0:
            raise SourceError(
                f"source {number} ({source!r}) lies outside the tet mesh, which spans {_box(mesh)}",
                remedy="move it into the mesh, or check that both have the same units",
                element=f"source {number}",
            )
        outside[number] = 1 - polygons.areas.sum() / elements.weights.sum()
        spacing = max(spacing, elements.spacing)
        cuts.append(polygons)
        components.append(elements.components[polygons.parents] + n_components)
        n_components = int(components[-1].max()) + 1
    time = diffusion * spacing**2
    loads = np.sum([_loads(mesh, polygons, np.sqrt(time)) for polygons in cuts], axis=0)
    if not np.abs(loads[:, :3]).max() > 1e-12 * np.abs(loads[:, 3]).max():
        raise SourceError(
            "the normals of the source cancel each other everywhere", remedy="flip one of its coinciding sides"
        )
    leaving = np.flatnonzero(outside > 1e-9)
    patches = [_patches(mesh, unknowns, n_unknowns, *part) for part in zip(cuts, components, strict=True)]
    rows, corrections, weights, members = zip(*patches, strict=True)
    return TetSource(
        vectors=loads[:, :3],
        strengths=loads[:, 3],
        centers=np.concatenate([_centers(mesh, polygons) for polygons in cuts]),
        time=time,
        interpolation=sparse.vstack(rows, format="csr"),
        quadratic_correction=sparse.vstack(corrections, format="csr"),
        weights=np.concatenate(weights),
        components=np.unique(np.concatenate(members), return_inverse=True)[1],
        source_ids=np.repeat(np.arange(len(weights)), [len(areas) for areas in weights]),
        notes=(OutsideMesh(leaving.tolist(), outside[leaving].tolist()),) if len(leaving) else (),
    )


def _cut(mesh: TetMesh, planes: Planes, elements: AreaElements) -> ClippedPolygons:
    """Clip the triangles of a source against the tets, or find the tets that contain its points if it has no faces."""
    if elements.corners.shape[1] == 3:
        polygons = clip_triangles(mesh.geometry, planes, elements.corners)
        sizes = np.linalg.norm(elements.vectors, axis=1)
        counted = elements.weights / np.where(sizes > 0, sizes, 1)  # −1 for fan triangles outside their polygon
        return replace(polygons, areas=polygons.areas * counted[polygons.parents])
    tets = containing_tets(mesh.geometry, planes, elements.corners[:, 0])
    k = np.flatnonzero(tets >= 0)
    centers = barycentric(mesh.geometry, tets[k], elements.corners[k, 0])
    return ClippedPolygons(tets[k], k, elements.vectors[k], elements.weights[k], centers, np.full(len(k), -1))


def _loads(mesh: TetMesh, polygons: ClippedPolygons, width: float) -> Floats:
    """(f, 4) X₀ at the faces (Sec. 8.1) in three columns, and the scalar source in the last; `width` is √t.

    A polygon is shared out to the faces of its tet by ψ = 1 − 3λ, where that is positive, since negative shares emit
    waves of the wrong sign. A plane wave decays by e^(−r/√t), so a face δ √t ahead of the polygon emits e^δ times too
    much forward, and e^−δ times backward. Weights that are a mean of e^−δ and e^δ correct both.
    """
    shares = np.maximum(1 - 3 * polygons.barycentric, 0)
    corners = mesh.vertices[mesh.tets[polygons.tets]]
    face_centers = (corners.sum(axis=1, keepdims=True) - corners) / 3
    away = np.einsum("pki,pi->pk", face_centers - _centers(mesh, polygons)[:, None], unit(polygons.area_vectors))
    ahead = np.exp(np.clip(away / width, -20, 20))
    sent = [(shares * weight * (ahead - 1 / ahead)).sum(axis=1) for weight in (1 / ahead, ahead)]
    mean = [np.maximum(sign * excess, 1e-300)[:, None] for sign, excess in zip((1, -1), sent[::-1], strict=True)]
    shares *= mean[0] / ahead + mean[1] * ahead
    shares /= (shares * (ahead + 1 / ahead)).sum(axis=1, keepdims=True) / 2
    faces, n = mesh.faces.tet_faces[polygons.tets].ravel(), len(mesh.faces.vertices)
    vectors = np.column_stack([polygons.area_vectors, polygons.areas])
    return sums_of((shares[:, :, None] * vectors[:, None]).reshape(-1, 4), faces, n)


def _patches(
    mesh: TetMesh, unknowns: Ints, n_unknowns: int, polygons: ClippedPolygons, components: Ints
) -> tuple[sparse.csr_matrix, sparse.csr_matrix, Floats, Ints]:
    """Group the polygons of one source to s patches, see `TetSource`.

    Return (s, n) interpolation rows, (s, 3n) quadratic corrections, (s,) areas and (s,) components. There is no row for
    each polygon, since functions that are linear in tets could not satisfy them. A quadratic φ at x is
    ``Σ λᵢ (φ(vᵢ) + ½ ∇φ(vᵢ)·(x − vᵢ))``.
    """
    corners = unknowns[polygons.tets]
    conforming = _on_whole_faces(mesh, polygons, components)
    k = np.flatnonzero(conforming)
    of_face = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[polygons.in_face[k]]
    at_vertices = corners[k[:, None], of_face].ravel()
    inside = np.flatnonzero(~conforming)
    nearest = corners[inside, polygons.barycentric[inside].argmax(axis=1)]

    keys = np.concatenate([np.repeat(components[k], 3), components[inside]]) * n_unknowns
    keys += np.concatenate([at_vertices, nearest])
    areas = np.concatenate([np.repeat(polygons.areas[k] / 3, 3), polygons.areas[inside]])
    patch_keys, patch = np.unique(keys, return_inverse=True)
    weights: Floats = np.bincount(patch, weights=areas).astype(np.float64)
    real = weights > 1e-9 * np.bincount(patch, weights=np.abs(areas))  # drop fan triangles that cancel
    n_on = len(at_vertices)
    columns = np.concatenate([at_vertices, corners[inside].ravel()])
    entries = np.concatenate([areas[:n_on], (areas[n_on:, None] * polygons.barycentric[inside]).ravel()])
    index = np.concatenate([patch[:n_on], np.repeat(patch[n_on:], 4)])
    rows = sparse.csr_matrix(
        (entries / np.where(real, weights, 1)[index], (index, columns)), shape=(len(patch_keys), n_unknowns)
    )
    rows.eliminate_zeros()
    away = (_centers(mesh, polygons)[:, None] - mesh.vertices[mesh.tets[polygons.tets]])[inside].reshape(-1, 3)
    steps = (entries / np.where(real, weights, 1)[index])[n_on:, None] * away / 2
    rows_and_columns = np.repeat(index[n_on:], 3), (3 * columns[n_on:, None] + np.arange(3)).ravel()
    corrections = sparse.csr_matrix((steps.ravel(), rows_and_columns), shape=(len(patch_keys), 3 * n_unknowns))
    return rows[real], corrections[real], weights[real], patch_keys[real] // n_unknowns


def _centers(mesh: TetMesh, polygons: ClippedPolygons) -> Floats:
    """(p, 3) centroids of the polygons."""
    return np.einsum("pk,pki->pi", polygons.barycentric, mesh.vertices[mesh.tets[polygons.tets]])


def _on_whole_faces(mesh: TetMesh, polygons: ClippedPolygons, components: Ints) -> Bools:
    """(p,) whether each polygon lies in a face of the mesh that its component, (p,), covers entirely."""
    on = polygons.in_face >= 0
    covered = np.zeros(len(on), dtype=bool)
    if on.any():
        n_faces = len(mesh.faces.vertices)
        face = mesh.faces.tet_faces[polygons.tets[on], polygons.in_face[on]]
        _, groups = np.unique(components[on] * n_faces + face, return_inverse=True)
        area = np.linalg.norm(mesh.geometry.area_vectors[polygons.tets[on], polygons.in_face[on]], axis=1)
        covered[on] = np.bincount(groups, weights=polygons.areas[on])[groups] >= (1 - 1e-6) * area
    return covered


def _box(mesh: TetMesh) -> str:
    """Return the box around a mesh as text, an interval for each axis."""
    return " × ".join(f"[{a:.4g}, {b:.4g}]" for a, b in mesh.bounds.T)
