"""Classes of what functions and methods return, for annotations."""

from .curves.stroke_directions import CurveOrientation
from .diagnostics import Diagnostics
from .grids.solid_queries import Closest
from .solids.deviations import Deviation
from .solids.holes import FilledMesh, FilledPolygonMesh
from .solids.mesh_orientation import Orientation
from .solids.sample_set import Samples
from .solids.sections import Section
from .solids.thickness import Thickness

__all__ = [
    "Closest", "CurveOrientation", "Deviation", "Diagnostics", "FilledMesh", "FilledPolygonMesh", "Orientation",
    "Samples", "Section", "Thickness",
]  # fmt: skip
