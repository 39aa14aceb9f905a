"""Read and write shapes, curves and fields."""

from .budgets import Budget
from .curve_files import CURVE_FORMATS, read_curves, write_curves
from .drawing_files import POLYLINE_FORMATS, read_polylines, write_polylines
from .field_files import (
    FIELD_FORMATS,
    VALUE_FORMATS,
    VERTEX_FIELD_FORMATS,
    ensure_field_writable,
    read_field,
    save_field,
)
from .files import ensure_writable
from .scenes import read_step
from .shape_files import SAMPLE_FORMATS, SHAPE_FORMATS, read, save
from .tet_files import TET_FIELD_FORMATS
from .vdb import write_vdb
from .voxel_files import LabelImage, read_labels, read_volume

__all__ = [
    "CURVE_FORMATS",
    "FIELD_FORMATS",
    "POLYLINE_FORMATS",
    "SAMPLE_FORMATS",
    "SHAPE_FORMATS",
    "TET_FIELD_FORMATS",
    "VALUE_FORMATS",
    "VERTEX_FIELD_FORMATS",
    "Budget",
    "LabelImage",
    "ensure_field_writable",
    "ensure_writable",
    "read",
    "read_curves",
    "read_field",
    "read_labels",
    "read_polylines",
    "read_step",
    "read_volume",
    "save",
    "save_field",
    "write_curves",
    "write_polylines",
    "write_vdb",
]  # fmt: skip
