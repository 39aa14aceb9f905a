"""The public names, all of which importing this module imports; `signedheat` imports it at the first use of one."""

from . import batches, errors, io, morphology, results, torch, view  # noqa: F401  makes them sh.batches and so on
from .constraints import EachComponent, Free, LevelValues, Soft, ZeroSet
from .curves.close import close_curves
from .curves.orientation import curve_orientation
from .curves.piecewise import piecewise_distance
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
from .extrapolation import Extrapolated
from .fields.grid_field import GridField
from .fields.piecewise_field import PiecewiseField
from .fields.redistancing import redistance
from .fields.tet_field import TetField
from .fields.vertex_field import VertexField
from .io import load_field, read, save
from .morphology import offset
from .orientation.meshes import orientation
from .orientation.orient import orient
from .sharpening.methods import Convex, Geodesic
from .sharpening.sharpen import sharpen
from .signed_distance import signed_distance
from .solids.complete import complete
from .solids.deviation import deviation
from .solids.sampling import sample
from .solids.solid import Solid
from .solver import SignedHeatSolver
from .tets.tetrahedralize import tetrahedralize

__all__ = [
    "Convex",
    "Curve",
    "DigitalSurface",
    "EachComponent",
    "Extrapolated",
    "Free",
    "Geodesic",
    "Grid",
    "GridField",
    "IntrinsicTriangulation",
    "LevelValues",
    "PiecewiseField",
    "PointCloud",
    "PolygonMesh",
    "Polyline",
    "SignedHeatSolver",
    "Soft",
    "Solid",
    "SurfacePoints",
    "TetField",
    "TetMesh",
    "TriangleMesh",
    "VertexField",
    "ZeroSet",
    "as_shape",
    "close_curves",
    "common_subdivision",
    "complete",
    "curve_orientation",
    "deviation",
    "globe_curve",
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
