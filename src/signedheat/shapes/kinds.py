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
"""Surfaces whose points have positions in space, on which curves and points can lie."""
SurfaceDomain: TypeAlias = EmbeddedSurface | IntrinsicTriangulation
"""Surfaces as domains of fields."""
Domain: TypeAlias = SurfaceDomain | TetMesh | Grid[int]
"""All domains on which distance can be computed."""
AnySurface = TypeVar("AnySurface", bound=SurfaceDomain)
"""A type of surface, for functions whose result lies on a surface of the same type as an argument."""
ShapeLike: TypeAlias = Shape | ForeignShape
"""Shapes, including objects of trimesh, PyVista, meshio and Open3D, and pairs (vertices, faces)."""
Shapes: TypeAlias = ShapeLike | Sequence[ShapeLike]
"""A shape in space, or a sequence of several."""
PlanarGeometry: TypeAlias = HasGeoInterface | Mapping[str, object]
"""Geometries of shapely and GeoPandas, and GeoJSON."""
Polylines: TypeAlias = Polyline | PlanarGeometry | Sequence[Polyline | PlanarGeometry]
"""A line in the plane, or a sequence of several."""
SpaceSource: TypeAlias = ShapeLike | Polyline | PlanarGeometry
"""Objects to which distance on a grid can be computed."""
SpaceSources: TypeAlias = SpaceSource | Sequence[SpaceSource]
"""A source of distance on grids, or a sequence of several."""
Source: TypeAlias = SpaceSource | CurveOrPoints
"""Objects to which distance can be computed on some domain."""
Sources: TypeAlias = Source | Sequence[Source | Sequence[CurveOrPoints]]
"""A source, or a sequence of several, in which curves and points may be grouped."""
