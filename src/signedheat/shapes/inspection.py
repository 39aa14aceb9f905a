"""Counts of a shape's elements and defects, such as open, nonmanifold and inconsistent edges or duplicate faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, mask_of, read_only
from ..mesh.components import connected_components
from ..mesh.edges import HalfedgePairs, following_corners, may_coincide, pair_halfedges
from ..mesh.tet_shapes import FLAT_TET
from ..mesh.triangles import areas_of_polygons
from ..mesh.welding import ONE_PLACE, coincident_faces, joined_rims, parts_by_place, same_positions
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import used_bounds
from .foreign import Shape

SMALL_PART = 0.01
"""Diagonal of the box around a part, relative to that of the largest part, below which the part counts as small."""


@dataclass(frozen=True)
class SurfaceReport:
    """Numbers of elements and defects of a surface. None of the defects is an error for signed distance."""

    n_vertices: int
    n_faces: int
    n_edges: int  # edges between two different vertices
    corners_per_face: tuple[int, int]  # the least and the greatest number of corners of a face
    components: int  # sets of faces that are connected through shared vertices
    small_parts: int  # components whose box has a diagonal below `SMALL_PART` of that of the largest
    largest_part: float  # diagonal of the box around the largest component
    open_edges: int  # edges with a single face
    borders: int  # connected sets of open edges
    nonmanifold_edges: int  # edges with more than two faces
    nonmanifold_vertices: int  # vertices at which the faces do not form a single fan or disk
    inconsistent_edges: int  # edges along which two faces run in the same direction, so that one of them is flipped
    degenerate_faces: int  # faces without area, or with a repeated vertex
    duplicate_faces: int  # faces with the same vertices as an earlier one, in the same or in the opposite order
    duplicate_vertices: int  # vertices at exactly the position of an earlier one
    unreferenced_vertices: int  # vertices without a face
    area: float
    lower: tuple[float, ...]  # corners of the bounding box of the faces
    upper: tuple[float, ...]

    @property
    def is_closed(self) -> bool:
        """Whether no edge is open."""
        return self.open_edges == 0

    @property
    def is_manifold(self) -> bool:
        """Whether every edge has at most two faces, and the faces at every vertex form a single fan or disk."""
        return self.nonmanifold_edges == 0 and self.nonmanifold_vertices == 0


@dataclass(frozen=True)
class CloudReport:
    """Numbers of points of a cloud, and whether it has normals and areas."""

    n_points: int
    has_normals: bool
    has_areas: bool
    duplicate_points: int  # points at exactly the position of an earlier one
    lower: tuple[float, ...]  # corners of the bounding box
    upper: tuple[float, ...]


@dataclass(frozen=True)
class TetReport:
    """Numbers of elements and defects of a tet mesh."""

    n_vertices: int
    n_tets: int
    parts: int  # sets of tets that are connected through shared faces
    inside_out_tets: int  # tets that were given with negative volume, and that `TetMesh` has flipped
    flat_tets: int  # tets with nearly zero volume
    nonmanifold_faces: int  # faces with more than two tets
    boundary_faces: int  # faces with a single tet
    volume: float
    lower: tuple[float, ...]  # corners of the bounding box
    upper: tuple[float, ...]


def inspect(shape: Shape) -> SurfaceReport | CloudReport | TetReport:
    """Count the elements and defects of a shape, in O(n) time.

    Edges between vertices that only rounding separates do not count as open.
    """
    if isinstance(shape, PointCloud):
        return CloudReport(
            n_points=shape.n_points,
            has_normals=shape.normals is not None,
            has_areas=shape.areas is not None,
            duplicate_points=_n_repeated(shape.points),
            lower=_tuple(shape.bounds[0]),
            upper=_tuple(shape.bounds[1]),
        )
    if isinstance(shape, TetMesh):
        return _inspect_tets(shape)
    return _inspect_surface(shape.squares if isinstance(shape, DigitalSurface) else shape)


def _inspect_tets(mesh: TetMesh) -> TetReport:
    """Count the elements and defects of a tet mesh."""
    counts = mesh.faces.tet_counts
    return TetReport(
        n_vertices=mesh.n_vertices,
        n_tets=mesh.n_tets,
        parts=int(mesh.parts.max()) + 1,
        inside_out_tets=len(mesh.reoriented),
        flat_tets=int((mesh.geometry.thickness < FLAT_TET).sum()),
        nonmanifold_faces=int((counts > 2).sum()),
        boundary_faces=int((counts == 1).sum()),
        volume=float(mesh.tet_volumes.sum()),
        lower=_tuple(mesh.bounds[0]),
        upper=_tuple(mesh.bounds[1]),
    )


def _inspect_surface(mesh: TriangleMesh | PolygonMesh) -> SurfaceReport:
    """Count the elements and defects of a mesh, such as open edges, edges of several faces, and duplicate faces."""
    if isinstance(mesh, TriangleMesh):
        corners, offsets = mesh.faces.ravel(), np.arange(0, 3 * mesh.n_faces + 1, 3)
    else:
        corners, offsets = mesh.corners, mesh.offsets
    following = following_corners(offsets)
    used, sides = _n_marked(mesh.n_vertices, corners), np.diff(offsets)
    corners = joined_rims(mesh.vertices, corners, corners[following], ONE_PLACE)[corners]
    heads = corners[following]
    pairs = pair_halfedges(corners, heads, mesh.n_vertices)
    duplicates = 0
    if may_coincide(pairs, corners, following):
        first, _ = coincident_faces(corners, offsets)
        duplicates = int(((first >= 0) & (first != np.arange(len(sides)))).sum())
    lonely, sizes = pairs.around == 1, parts_by_place(mesh.vertices, corners, heads)[1]
    areas, degenerate = areas_of_polygons(mesh.vertices, read_only(corners), read_only(offsets))
    lower, upper = used_bounds(mesh.vertices, corners)
    two = pairs.counts == 2
    return SurfaceReport(
        n_vertices=mesh.n_vertices,
        n_faces=len(sides),
        n_edges=len(pairs.counts),
        corners_per_face=(int(sides.min()), int(sides.max())),
        components=len(sizes),
        largest_part=float(sizes.max(initial=0.0)),
        small_parts=int((sizes < SMALL_PART * sizes.max(initial=0.0)).sum()),
        open_edges=int((pairs.counts == 1).sum()),
        borders=_n_components(mesh.n_vertices, corners[lonely], heads[lonely]),
        nonmanifold_edges=int((pairs.counts > 2).sum()),
        nonmanifold_vertices=_n_nonmanifold(mesh.n_vertices, corners, following, pairs),
        inconsistent_edges=int((corners[pairs.first[two]] == corners[pairs.second[two]]).sum()),
        degenerate_faces=int(degenerate.sum()),
        duplicate_faces=duplicates,
        duplicate_vertices=_n_repeated(mesh.vertices),
        unreferenced_vertices=mesh.n_vertices - used,
        area=float(areas.sum()),
        lower=_tuple(lower),
        upper=_tuple(upper),
    )


def _n_marked(n: int, ids: Ints) -> int:
    """Count the distinct ids, which are below n."""
    return int(mask_of(n, ids).sum())


def _n_components(n: int, tails: Ints, heads: Ints) -> int:
    """Count the connected components of halfedges, given by their tails and heads among n vertices."""
    return _n_marked(n, connected_components(n, tails, heads)[tails])


def _n_nonmanifold(n: int, tails: Ints, following: NDArray[np.int32], pairs: HalfedgePairs) -> int:
    """Count vertices whose faces do not form a single fan, or that lie on an edge of more than two faces."""
    two = pairs.counts == 2
    first, second = pairs.first[two], pairs.second[two]
    same_way = tails[first] == tails[second]
    after_first, after_second = following[first], following[second]
    links = np.where(same_way, second, after_second), np.where(same_way, after_second, second)
    fans = connected_components(len(tails), np.concatenate([first, after_first]), np.concatenate(links))
    fan = np.empty(n, dtype=np.int64)
    fan[tails] = fans
    crowded = np.flatnonzero(pairs.around > 2)
    bad = [tails[fans != fan[tails]], tails[crowded], tails[following[crowded]]]
    return _n_marked(n, np.concatenate(bad))


def _n_repeated(points: Floats) -> int:
    """Count points at exactly the position of an earlier one."""
    return int(np.count_nonzero(same_positions(points) != np.arange(len(points))))


def _tuple(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
