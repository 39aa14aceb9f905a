"""What goes beyond the three steps; uses the core through its public face."""

from . import grid_sharpening, tet_sharpening, vertex_sharpening

__all__ = ["grid_sharpening", "tet_sharpening", "vertex_sharpening"]  # each registers how its fields are sharpened
