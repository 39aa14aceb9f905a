"""Extensions beyond the three steps: sharpening, piecewise distance, completion of curves, morphology, tet meshing."""

from . import grid_sharpening, tet_sharpening, vertex_sharpening

__all__ = ["grid_sharpening", "tet_sharpening", "vertex_sharpening"]  # each registers how its fields are sharpened
