"""All public names. Since importing them takes long, `signedheat` imports this module when one is first used."""

from . import batches, errors, io, morphology, results, samples, torch, view  # noqa: F401  makes them sh.batches and so on
from .constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
from .curves.curve_completion import close_curves
from .curves.jumping_distance import piecewise_distance
from .curves.piecewise_field import PiecewiseField
from .curves.stroke_directions import curve_orientation
from .distances import signed_distance
from .errors import (
    CancellingNormalsError,
    ConstraintError,
    FactorizationError,
    FileFormatError,
    GeometryError,
    InexactWarning,
    MemoryLimitError,
    MissingPackageError,
    OutsideError,
    SignedHeatError,
    SourceError,
    UnreachedWarning,
    UnsupportedTypeError,
)
from .foreign import as_shape
from .grids.grid import Grid
from .grids.grid_field import GridField
from .grids.polyline import Polyline
from .grids.redistancing import redistance
from .io import load_field, read, save
from .morphology import offset
from .sharpening import sharpen
from .sharpening_methods import Convex, Geodesic
from .solids.completion import complete
from .solids.deviations import deviation
from .solids.holes import fill_holes
from .solids.implicit_surfaces import contour
from .solids.mesh_orientation import orient, orientation
from .solids.sampling import sample
from .solids.solid import Solid
from .solids.thickness import thickness
from .solver import SignedHeatSolver
from .surfaces.digital_surface import DigitalSurface
from .surfaces.extrapolation import Extrapolated
from .surfaces.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from .surfaces.point_cloud import PointCloud
from .surfaces.polygon_mesh import PolygonMesh
from .surfaces.subdivision import common_subdivision
from .surfaces.surface_curves import Curve, SurfacePoints
from .surfaces.triangle_mesh import TriangleMesh
from .surfaces.vertex_field import VertexField
from .tets.lattice import tetrahedralize
from .tets.tet_field import TetField
from .tets.tet_mesh import TetMesh
from .transforms import transform

MODULES = ("batches", "errors", "io", "morphology", "results", "samples", "torch", "view")
"""Modules whose contents are used by the name of the module; ``from signedheat import *`` does not import them."""

__all__ = [
    "CancellingNormalsError", "ConstraintError", "Convex", "Curve", "DigitalSurface", "EachComponent", "Extrapolated",
    "FactorizationError", "FileFormatError", "Free", "Geodesic", "GeometryError", "Grid", "GridField",
    "InexactWarning", "IntrinsicTriangulation", "LevelValues", "MemoryLimitError", "MissingPackageError",
    "OutsideError", "PiecewiseField", "PointCloud", "PolygonMesh", "Polyline", "SignedHeatError", "SignedHeatSolver",
    "Soft", "Solid", "SourceError", "SurfacePoints", "TetField", "TetMesh", "TriangleMesh", "UnreachedWarning",
    "UnsupportedTypeError", "VertexField", "ZeroSet", "as_shape", "close_curves", "common_subdivision", "complete",
    "contour", "curve_orientation", "deviation", "fill_holes", "intrinsic_delaunay", "load_field", "offset", "orient",
    "orientation", "piecewise_distance", "read", "redistance", "sample", "save", "sharpen", "signed_distance",
    "tetrahedralize", "thickness", "transform",
]  # fmt: skip
