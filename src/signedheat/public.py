"""The public names, all of which importing this module imports; `signedheat` does when one is first asked for."""

from .batches.job import BatchJob, Sampling
from .batches.manifest import Outcome
from .batches.run import Batch, batch
from .constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
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
from .extensions.close_curves import close_curves
from .extensions.curve_distance import curve_distance
from .extensions.curve_orientation import CurveOrientation, curve_orientation
from .extensions.morphology import closing, dilate, erode, opening, shell, thicken
from .extensions.orient import orient
from .extensions.orientation import Orientation, orientation
from .extensions.phi_band import phi_in_band as _phi_in_band  # noqa: F401  provides bands of `signed_distance`
from .extensions.piecewise import piecewise_distance
from .extensions.sampling import Samples, sample
from .extensions.sharpening import sharpen
from .extensions.sharpening_methods import Convex, Geodesic
from .extensions.solid_distance import solid_distance
from .extensions.tetrahedralize import tetrahedralize
from .extensions.tiles import tiled_distance
from .extensions.uniting import unite
from .extrapolation import Extrapolated
from .fields.band_field import BandField
from .fields.booleans import smooth_difference, smooth_intersection, smooth_union
from .fields.grid_field import GridField
from .fields.piecewise_field import PiecewiseField
from .fields.tet_field import TetField
from .fields.vertex_field import VertexField
from .io import (
    LabelImage,
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
from .solver import SignedHeatSolver, signed_distance
from .visualization import new_figure as _new_figure  # noqa: F401  provides notebooks, windows and Polyscope

__all__ = [
    "BandField",
    "Batch",
    "BatchJob",
    "ConstraintError",
    "Convex",
    "Curve",
    "CurveOrientation",
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
    "Outcome",
    "OutsideError",
    "PiecewiseField",
    "PointCloud",
    "PolygonMesh",
    "Polyline",
    "Samples",
    "Sampling",
    "SignedHeatError",
    "SignedHeatSolver",
    "Soft",
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
    "batch",
    "close_curves",
    "closing",
    "common_subdivision",
    "curve_distance",
    "curve_orientation",
    "dilate",
    "erode",
    "globe_curve",
    "intrinsic_delaunay",
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
    "sample",
    "save",
    "sharpen",
    "shell",
    "signed_distance",
    "smooth_difference",
    "smooth_intersection",
    "smooth_union",
    "solid_distance",
    "tetrahedralize",
    "thicken",
    "tiled_distance",
    "transform",
    "unite",
    "write_curves",
    "write_polylines",
    "write_vdb",
]
