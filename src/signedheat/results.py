"""Classes of what functions and methods return, for annotations; users make none of them."""

from .curves.orientation import CurveOrientation
from .diagnostics import Diagnostics
from .fields.solid_queries import Closest
from .solids.deviation import Deviation
from .solids.orientation import Orientation
from .solids.sample_set import Samples

__all__ = ["Closest", "CurveOrientation", "Deviation", "Diagnostics", "Orientation", "Samples"]
