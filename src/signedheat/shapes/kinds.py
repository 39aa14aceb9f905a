"""Type aliases for domains and sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias, TypeVar

from ..grids.grid import Grid
from ..grids.polyline import Polyline
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.intrinsic_triangulation import IntrinsicTriangulation
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface_curves import CurveOrPoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from .foreign import ForeignShape
from .foreign import Shape as Shape
from .geometries import HasGeoInterface

EmbeddedSurface: TypeAlias = TriangleMesh | PolygonMesh | PointCloud | DigitalSurface
"""Surfaces with positions in space, on which curves and points can lie."""
SurfaceDomain: TypeAlias = EmbeddedSurface | IntrinsicTriangulation
"""Domains of distance along a surface."""
Domain: TypeAlias = SurfaceDomain | TetMesh | Grid[int]
"""All domains of distance."""
AnySurface = TypeVar("AnySurface", bound=SurfaceDomain)
"""One kind of surface, for functions whose result lies on a surface of the same kind."""
ShapeLike: TypeAlias = Shape | ForeignShape
"""Shapes, including objects of trimesh, PyVista, meshio and Open3D, and pairs (vertices, faces)."""
Shapes: TypeAlias = ShapeLike | Sequence[ShapeLike]
"""One shape in space or several."""
PlanarGeometry: TypeAlias = HasGeoInterface | Mapping[str, object]
"""Geometries of shapely and GeoPandas, and GeoJSON."""
Polylines: TypeAlias = Polyline | PlanarGeometry | Sequence[Polyline | PlanarGeometry]
"""One line in the plane or several."""
SpaceSource: TypeAlias = ShapeLike | Polyline | PlanarGeometry
"""Sources of distance on grids."""
SpaceSources: TypeAlias = SpaceSource | Sequence[SpaceSource]
"""One source of distance on grids or several."""
Source: TypeAlias = SpaceSource | CurveOrPoints
"""Sources of distance on any domain."""
Sources: TypeAlias = Source | Sequence[Source | Sequence[CurveOrPoints]]
"""One source or several."""
