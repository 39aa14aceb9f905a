"""Reading and writing of shapes, curves and fields."""

from . import streamed_meshes as _streamed_meshes  # noqa: F401  provides the writing of large contours
from .curves import CURVE_FORMATS, read_curves, write_curves
from .fields import FIELD_FORMATS, ensure_field_writable, load_field, save_field
from .files import ensure_writable
from .globe import read_globe_curves
from .labels import LabelImage, read_labels
from .polylines import POLYLINE_FORMATS, read_polylines, write_polylines
from .samples import SAMPLE_FORMATS
from .shapes import SHAPE_FORMATS, read, save
from .solids import load
from .step import read_step
from .surface_fields import VALUE_FORMATS, VERTEX_FIELD_FORMATS
from .tets import TET_FIELD_FORMATS
from .vdb import write_vdb
from .volumes import read_mask, read_volume

__all__ = [
    "CURVE_FORMATS",
    "FIELD_FORMATS",
    "POLYLINE_FORMATS",
    "SAMPLE_FORMATS",
    "SHAPE_FORMATS",
    "TET_FIELD_FORMATS",
    "VALUE_FORMATS",
    "VERTEX_FIELD_FORMATS",
    "LabelImage",
    "ensure_field_writable",
    "ensure_writable",
    "load",
    "load_field",
    "read",
    "read_curves",
    "read_globe_curves",
    "read_labels",
    "read_mask",
    "read_polylines",
    "read_step",
    "read_volume",
    "save",
    "save_field",
    "write_curves",
    "write_polylines",
    "write_vdb",
]
