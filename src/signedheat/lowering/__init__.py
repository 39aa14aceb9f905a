"""Every domain and every source, lowered to its discretisation; importing this registers them all."""

from .grid import discretization as grids
from .surface import discretization as surfaces
from .surface import intrinsic
from .tets import discretization as tets

__all__ = ["grids", "intrinsic", "surfaces", "tets"]
