"""The public names, all of which importing this module imports; `signedheat` does when one is first asked for."""

from . import batches, errors, torch  # noqa: F401  sh.batches, sh.errors, sh.torch
from .constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
from .curves.close import close_curves
from .curves.orientation import CurveOrientation, curve_orientation
from .diagnostics import Diagnostics
from .domains.common_subdivision import common_subdivision
from .domains.curves import Curve, SurfacePoints
from .domains.digital_surface import DigitalSurface
from .domains.foreign import as_shape
from .domains.globe import globe_curve
from .domains.grid import Grid
from .domains.intrinsic_triangulation import IntrinsicTriangulation, intrinsic_delaunay
from .domains.point_cloud import PointCloud
from .domains.polygon_mesh import PolygonMesh
from .domains.polyline import Polyline
from .domains.tet_mesh import TetMesh
from .domains.transforms import transform
from .domains.triangle_mesh import TriangleMesh
from .errors import (
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
from .extensions.morphology import closing, dilate, erode, opening, shell, thicken
from .extensions.piecewise import piecewise_distance
from .extrapolation import Extrapolated
from .fields.booleans import smooth_difference, smooth_intersection, smooth_union
from .fields.grid_field import GridField
from .fields.known_solid import Closest
from .fields.piecewise_field import PiecewiseField
from .fields.redistancing import redistance
from .fields.tet_field import TetField
from .fields.vertex_field import VertexField
from .io import (
    LabelImage,
    load,
    load_field,
    read,
    read_curves,
    read_globe_curves,
    read_labels,
    read_mask,
    read_polylines,
    read_volume,
    save,
    write_curves,
    write_polylines,
    write_vdb,
)
from .orientation.meshes import Orientation, orientation
from .orientation.orient import orient
from .sharpening.methods import Convex, Geodesic
from .sharpening.sharpen import sharpen
from .signed_distance import signed_distance
from .solids.complete import complete
from .solids.deviation import Deviation, deviation
from .solids.sampling import Samples, sample
from .solids.solid import Solid
from .solver import SignedHeatSolver
from .tets.tetrahedralize import tetrahedralize
from .view import new_figure as _new_figure  # noqa: F401  provides notebooks and windows

__all__ = [
    "Closest",
    "ConstraintError",
    "Convex",
    "Curve",
    "CurveOrientation",
    "Deviation",
    "Diagnostics",
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
    "LabelImage",
    "LevelValues",
    "MemoryLimitError",
    "MissingPackageError",
    "Orientation",
    "OutsideError",
    "PiecewiseField",
    "PointCloud",
    "PolygonMesh",
    "Polyline",
    "Samples",
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
    "closing",
    "common_subdivision",
    "complete",
    "curve_orientation",
    "deviation",
    "dilate",
    "erode",
    "globe_curve",
    "intrinsic_delaunay",
    "load",
    "load_field",
    "opening",
    "orient",
    "orientation",
    "piecewise_distance",
    "read",
    "read_curves",
    "read_globe_curves",
    "read_labels",
    "read_mask",
    "read_polylines",
    "read_volume",
    "redistance",
    "sample",
    "save",
    "sharpen",
    "shell",
    "signed_distance",
    "smooth_difference",
    "smooth_intersection",
    "smooth_union",
    "tetrahedralize",
    "thicken",
    "transform",
    "write_curves",
    "write_polylines",
    "write_vdb",
]
