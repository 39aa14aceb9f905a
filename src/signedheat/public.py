"""All public names. Since importing them takes long, `signedheat` imports this module when one is first used."""

from . import batches, constraints, errors, io, methods, morphology, results, samples, torch, view
from .curves.curve_completion import close_curves
from .curves.jumping_distance import piecewise_distance
from .distances import signed_distance
from .errors import SignedHeatError
from .fields.field import Field
from .fields.sharpening import sharpen
from .grids.grid import Grid
from .grids.polyline import Polyline
from .grids.redistancing import redistance
from .io import read, read_field, save
from .morphology import offset
from .shapes.foreign import as_shape
from .shapes.geometries import to_shapely
from .shapes.transforms import transform
from .solids.completion import complete
from .solids.deviations import deviation
from .solids.holes import fill_holes
from .solids.implicit_surfaces import contour
from .solids.mesh_orientation import orient, orientation
from .solids.sampling import sample_distances
from .solids.solid import Solid
from .solids.thickness import wall_thickness
from .solver import SignedHeatSolver
from .surfaces.digital_surface import DigitalSurface
from .surfaces.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from .surfaces.point_cloud import PointCloud
from .surfaces.polygon_mesh import PolygonMesh
from .surfaces.subdivision import common_subdivision
from .surfaces.surface_curves import Curve, SurfacePoints
from .surfaces.triangle_mesh import TriangleMesh
from .tets.lattice import tetrahedralize
from .tets.tet_mesh import TetMesh

MODULES = (batches, constraints, errors, io, methods, morphology, results, samples, torch, view)
"""Modules whose contents are used by the name of the module; ``from signedheat import *`` does not import them."""

__all__ = [
    "Curve", "DigitalSurface", "Field", "Grid", "IntrinsicTriangulation", "PointCloud",
    "PolygonMesh", "Polyline", "SignedHeatError", "SignedHeatSolver", "Solid", "SurfacePoints",
    "TetMesh", "TriangleMesh", "as_shape", "close_curves", "common_subdivision", "complete",
    "contour", "deviation", "fill_holes", "intrinsic_delaunay", "offset", "orient", "orientation",
    "piecewise_distance", "read", "read_field", "redistance", "sample_distances", "save", "sharpen",
    "signed_distance", "tetrahedralize", "to_shapely", "transform", "wall_thickness",
]  # fmt: skip

for _module in MODULES:  # completion in notebooks offers public names only
    _module.__dir__ = sorted(_module.__all__).copy  # type: ignore[method-assign]
