"""The public names, all of which importing this module imports; `signedheat` imports it at the first use of one."""

from . import batches, errors, io, morphology, results, samples, torch, view  # noqa: F401  makes them sh.batches and so on
from .constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
from .curves.close import close_curves
from .curves.orientation import curve_orientation
from .curves.piecewise import piecewise_distance
from .distances import signed_distance
from .domains.common_subdivision import common_subdivision
from .domains.curves import Curve, SurfacePoints
from .domains.digital_surface import DigitalSurface
from .domains.foreign import as_shape
from .domains.grid import Grid
from .domains.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from .domains.point_cloud import PointCloud
from .domains.polygon_mesh import PolygonMesh
from .domains.polyline import Polyline
from .domains.tet_mesh import TetMesh
from .domains.transforms import transform
from .domains.triangle_mesh import TriangleMesh
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
from .extrapolation import Extrapolated
from .fields.grid_field import GridField
from .fields.piecewise_field import PiecewiseField
from .fields.redistancing import redistance
from .fields.tet_field import TetField
from .fields.vertex_field import VertexField
from .io import load_field, read, save
from .morphology import offset
from .sharpening.methods import Convex, Geodesic
from .sharpening.sharpen import sharpen
from .solids.complete import complete
from .solids.deviation import deviation
from .solids.orient import orient
from .solids.orientation import orientation
from .solids.sampling import sample
from .solids.solid import Solid
from .solver import SignedHeatSolver
from .tets.tetrahedralize import tetrahedralize

MODULES = ("batches", "errors", "io", "morphology", "results", "samples", "torch", "view")
"""What is used by the name of its module; ``from signedheat import *`` leaves these alone."""

__all__ = [
    "CancellingNormalsError",
    "ConstraintError",
    "Convex",
    "Curve",
    "DigitalSurface",
    "EachComponent",
    "Extrapolated",
    "FactorizationError",
    "FileFormatError",
    "Free",
    "Geodesic",
    "GeometryError",
    "Grid",
    "GridField",
    "InexactWarning",
    "IntrinsicTriangulation",
    "LevelValues",
    "MemoryLimitError",
    "MissingPackageError",
    "OutsideError",
    "PiecewiseField",
    "PointCloud",
    "PolygonMesh",
    "Polyline",
    "SignedHeatError",
    "SignedHeatSolver",
    "Soft",
    "Solid",
    "SourceError",
    "SurfacePoints",
    "TetField",
    "TetMesh",
    "TriangleMesh",
    "UnreachedWarning",
    "UnsupportedTypeError",
    "VertexField",
    "ZeroSet",
    "as_shape",
    "close_curves",
    "common_subdivision",
    "complete",
    "curve_orientation",
    "deviation",
    "intrinsic_delaunay",
    "load_field",
    "offset",
    "orient",
    "orientation",
    "piecewise_distance",
    "read",
    "redistance",
    "sample",
    "save",
    "sharpen",
    "signed_distance",
    "tetrahedralize",
    "transform",
]
