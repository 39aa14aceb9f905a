"""Tets in space: their faces, areas, volumes, and operators on them (Sec. 8.1, App. B).

Diffusion uses Crouzeix–Raviart functions on faces, and integration uses linear functions at vertices. All operators
follow from the outward area vectors N_k of the face opposite corner k of a tet T. The barycentric coordinate λ_k has
gradient ``−N_k / (3|T|)``, and the Crouzeix–Raviart function ``ψ_k = 1 − 3λ_k`` has gradient ``N_k / |T|``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from .box_tree import BoxTree
from .components import connected_components, grouped, sums_of
from .triangles import area_vectors
from .welding import distinct_rows

FACE_CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the face opposite each corner, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class FaceTable:
    """f faces of m tets, and their incidence."""

    vertices: Ints  # (f, 3) vertex ids, counter-clockwise as seen from outside the first tet at the face
    tet_faces: Ints  # (m, 4) face opposite each corner of each tet

    @cached_property
    def tet_counts(self) -> Ints:
        """Number of tets at each face, (f,) int: 1 on the boundary, more than 2 where nonmanifold."""
        return np.bincount(self.tet_faces.ravel(), minlength=len(self.vertices))

    @cached_property
    def neighbors(self) -> Ints:
        """The tet beyond the face opposite each corner, (m, 4) int; −1 at the boundary."""
        flat = self.tet_faces.ravel()
        _, order = grouped(flat, len(self.vertices))
        same = flat[order[1:]] == flat[order[:-1]]
        beyond = np.full(len(flat), -1, dtype=np.int64)
        beyond[order[1:][same]] = order[:-1][same] // 4
        beyond[order[:-1][same]] = order[1:][same] // 4
        return beyond.reshape(-1, 4)


def face_table(tets: Ints) -> FaceTable:
    """Find the faces of (m, 4) tets, numbered by first appearance, in linear time."""
    corners = tets[:, FACE_CORNERS].reshape(-1, 3)
    number, first = distinct_rows(np.sort(corners, axis=1))
    return FaceTable(corners[first], number.reshape(-1, 4))


@dataclass(frozen=True, eq=False)
class TetShapes:
    """m tets in space, with quantities that depend on their shapes."""

    vertices: Floats  # (n, 3) positions
    tets: Ints  # (m, 4) vertex ids of the corners; volumes are positive, or tets degenerate

    @cached_property
    def area_vectors(self) -> Floats:
        """Area times outward normal of the face opposite each corner, N_k, (m, 4, 3) float."""
        return np.stack([area_vectors(self.vertices[self.tets[:, face]]) for face in FACE_CORNERS], axis=1)

    @cached_property
    def volumes(self) -> Floats:
        """Signed volume of each tet, (m,) float."""
        return signed_volumes(self.vertices, self.tets)

    @cached_property
    def longest_edges(self) -> Floats:
        """Length of the longest edge of each tet, (m,) float."""
        points = [self.vertices[self.tets[:, k]] for k in range(4)]
        squares = [np.square(points[i] - points[j]).sum(axis=1) for i in range(4) for j in range(i)]
        return np.sqrt(np.max(squares, axis=0))

    @cached_property
    def thickness(self) -> Floats:
        """Volume divided by the cube of the longest edge, (m,) float; 0 for inverted tets and coinciding corners."""
        cubes = self.longest_edges**3
        return np.maximum(self.volumes, 0) / np.where(cubes > 0, cubes, 1)

    @cached_property
    def faces(self) -> FaceTable:
        """The triangular faces of the tets."""
        return face_table(self.tets)

    @cached_property
    def search_tree(self) -> BoxTree:
        """Tree of the bounding boxes of the tets."""
        corners = self.vertices[self.tets]
        return BoxTree.around(corners)


def inside_out(mesh: TetShapes) -> Bools:
    """Return (m,) bool, true for tets that rounding has inverted, so that a neighbour is on the same side of a face.

    Of two consistent orientations of each connected part, the one with the larger sum of volumes counts as right.
    """
    faces, m = mesh.faces, len(mesh.tets)
    a, b, c = np.moveaxis(mesh.tets[:, FACE_CORNERS], 2, 0)
    way = np.sign(a - b) * np.sign(b - c) * np.sign(c - a)  # parity of the corners' order, as seen from outside
    disagree = np.bincount(faces.tet_faces.ravel(), way.ravel(), len(faces.vertices)) != 0
    tet, k = np.nonzero(faces.tet_counts[faces.tet_faces] == 2)
    other = np.where(disagree[faces.tet_faces[tet, k]], m, 0) + faces.neighbors[tet, k]
    # the graph has each tet k twice, as it is, k, and inverted, k + m: tets that agree are connected
    as_given, turned = connected_components(
        2 * m, np.append(tet, tet + m), np.append(other, (other + m) % (2 * m))
    ).reshape(2, m)
    volumes = np.bincount(as_given, mesh.volumes, 2 * m) - np.bincount(turned, mesh.volumes, 2 * m)
    return np.asarray(volumes[as_given] < 0)


def signed_volumes(vertices: Floats, tets: Ints) -> Floats:
    """Return (m,) volumes, negative for inverted tets."""
    a, b, c, d = (vertices[tets[:, k]] for k in range(4))
    return np.einsum("mi,mi->m", np.cross(b - a, c - a), d - a) / 6


THIN_TET = 1e-2
"""Thickness, the volume relative to the cube of the longest edge, below which a tet has a reduced weight. Regular tets
have 0.118."""
FLAT_TET = 1e-6
"""Thickness below which a tet counts as flat, and gets an extra stiffness (`Tetrahedra.ties`)."""
FLAT_STIFFNESS = 1e-4
"""Extra stiffness between the faces or vertices of flat tets, relative to the longest edge."""


@dataclass(frozen=True, eq=False)
class Tetrahedra(TetShapes):
    """Tets with the finite-element operators on their faces and vertices."""

    @cached_property
    def stiffness_factors(self) -> Floats:
        """Factor w / |T| of each tet, with w the `weights`, (m,) float; the stiffness of thin tets stays bounded."""
        thick = self.thickness >= THIN_TET
        cubes = np.where(self.longest_edges > 0, self.longest_edges, 1) ** 3
        return 1 / np.where(thick, np.maximum(self.volumes, np.finfo(float).tiny), THIN_TET * cubes)

    @cached_property
    def weights(self) -> Floats:
        """Weight w of each tet, (m,) float: 1, or less for tets thinner than `THIN_TET`, down to 0."""
        return np.minimum(self.thickness / THIN_TET, 1)

    @cached_property
    def fading(self) -> Floats:
        """Further factor of each tet in step 3, (m,) float, w²; a curved φ has unbounded gradients in flat tets."""
        return self.weights**2

    @cached_property
    def ties(self) -> Floats:
        """Extra stiffness between faces or vertices of each flat tet, (m,) float; some belong to no other tet."""
        lengths = np.maximum(self.longest_edges, 1e-3 * self.longest_edges.mean())
        return FLAT_STIFFNESS * lengths * (1 - np.minimum(self.thickness / FLAT_TET, 1))

    def face_mass(self) -> Floats:
        """Return (f,) the diagonal of M in Eq. 12, row sums of Eq. 23, made positive so that M + tL is definite."""
        quarter = np.repeat(self.weights * self.volumes / 4, 4)
        mass = np.bincount(self.faces.tet_faces.ravel(), quarter, len(self.faces.vertices)).astype(np.float64)
        return np.maximum(mass, 1e-9 * mass.mean())  # from 1e-12 to 1e-4 no test of tets changes

    def face_laplacian(self) -> sparse.csr_matrix:
        """Return the sparse (f, f) Laplacian of faces, L_ab = Σ_T N_a·N_b / |T|, plus `ties` (Eq. 20, Eq. 21)."""
        faces = self.faces
        return _assemble(self.area_vectors, self.stiffness_factors, self.ties, faces.tet_faces, len(faces.vertices))

    def vertex_laplacian(self, corners: Ints, n: int) -> sparse.csr_matrix:
        """Return the sparse (n, n) cotan Laplacian C_ij = Σ_T N_i·N_j / (9|T|), plus `ties` (Eq. 10 in tets).

        `corners` are the ids, below n, of the unknowns at corners, (m, 4).
        """
        return _assemble(self.area_vectors, self.fading * self.stiffness_factors / 9, self.ties, corners, n)

    def divergence(self, directions: Floats, corners: Ints, n: int) -> Floats:
        """Return (n,) b of Eq. 13, ``∫ ∇λ_i · Y = −⅓ Σ_T N_i·Y_T``, for (m, 3) vectors Y (Eq. 22 lacks the ⅓).

        `corners` are the ids, below n, of the unknowns at corners, (m, 4).
        """
        parts = np.einsum("mki,mi->mk", self.area_vectors, directions) * (self.fading * self.weights / -3)[:, None]
        return np.asarray(np.bincount(corners.ravel(), parts.ravel(), n), np.float64)

    def gradients(self, corner_values: Floats) -> Floats:
        """Return (m, 3) gradients of the linear interpolant of (m, 4) corner values; zero on flat tets."""
        flat = self.thickness < 1e-10
        sums = np.einsum("mki,mk->mi", self.area_vectors, corner_values)
        return np.where(flat[:, None], 0.0, sums / (-3 * np.where(flat, 1.0, self.volumes))[:, None])

    def mean_gradients(self, values: Floats, corners: Ints, n: int) -> Floats:
        """Return (n, 3) gradients at n unknowns, volume-weighted means over the tets around each.

        `values` are (n,), and `corners` the ids of unknowns at corners, (m, 4). Tets with NaN do not count. The result
        is NaN where none is left.
        """
        sums = np.einsum("mki,mk->mi", self.area_vectors, values[corners]) * (self.weights / -3)[:, None]
        finite = np.isfinite(sums).all(axis=1)
        ids, volumes = corners[finite].ravel(), (self.weights * self.volumes)[finite]
        total = np.bincount(ids, np.repeat(volumes, 4), n)
        totals = sums_of(np.repeat(sums[finite], 4, axis=0), ids, n)
        return totals / np.where(total > 0, total, np.nan)[:, None]


def _assemble(vectors: Floats, factors: Floats, ties: Floats, ids: Ints, n: int) -> sparse.csr_matrix:
    """Return the sparse (n, n) matrix with ``Σ_T factor · N_a·N_b`` at entry (ids of a, b), plus the ties.

    Shapes are (m, 4, 3) for the area vectors N, (m,) for factors and ties, and (m, 4) for ids.
    """
    entries = np.einsum("mai,mbi->mab", vectors, vectors) * factors[:, None, None]
    entries += ties[:, None, None] * (4.0 * np.eye(4) - 1.0)
    corners = ids.astype(np.int32)
    rows, columns = np.repeat(corners, 4, axis=1), np.tile(corners, 4)
    return sparse.coo_matrix((entries.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()
