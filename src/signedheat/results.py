"""Classes of the objects that functions and methods return, for use in annotations."""

from .curves.cut_surface import Cut, CutSurface
from .curves.stroke_directions import CurveOrientation
from .diagnostics import Diagnostics
from .fields.solid_queries import Closest
from .grids.band import Band
from .solids.deviations import Deviation
from .solids.holes import FilledMesh, FilledPolygonMesh
from .solids.mesh_orientation import Orientation
from .solids.sample_set import Samples
from .solids.sections import Section
from .solids.thickness import Thickness

__all__ = [
    "Band", "Closest", "CurveOrientation", "Cut", "CutSurface", "Deviation", "Diagnostics", "FilledMesh",
    "FilledPolygonMesh", "Orientation", "Samples", "Section", "Thickness",
]  # fmt: skip
