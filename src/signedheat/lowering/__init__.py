"""Every domain and every source, lowered to its discretisation; importing this registers them all."""

from . import polylines
from .grid import discretization as grids
from .surface import digital_surfaces, intrinsic, point_clouds, polygons
from .surface import discretization as surfaces
from .tets import discretization as tets

__all__ = ["digital_surfaces", "grids", "intrinsic", "point_clouds", "polygons", "polylines", "surfaces", "tets"]
