"""Reading and writing of shapes, curves and fields."""

from . import interop as _interop  # noqa: F401  provides the exchange with other packages
from . import pyvista_objects as _pyvista_objects  # noqa: F401  provides objects of PyVista
from . import samples as _samples  # noqa: F401  provides the writing of samples
from . import streamed_meshes as _streamed_meshes  # noqa: F401  provides the writing of large contours
from .bands import ensure_band_writable
from .curves import CURVE_FORMATS, read_curves, write_curves
from .fields import FIELD_FORMATS, ensure_field_writable, load_field, save_field
from .files import ensure_writable
from .globe import read_globe_curves
from .labels import LabelImage, read_labels
from .polylines import POLYLINE_FORMATS, read_polylines, write_polylines
from .shapes import SHAPE_FORMATS, read, save
from .vdb import write_vdb
from .volumes import read_mask, read_volume

__all__ = [
    "CURVE_FORMATS",
    "FIELD_FORMATS",
    "POLYLINE_FORMATS",
    "SHAPE_FORMATS",
    "LabelImage",
    "ensure_band_writable",
    "ensure_field_writable",
    "ensure_writable",
    "load_field",
    "read",
    "read_curves",
    "read_globe_curves",
    "read_labels",
    "read_mask",
    "read_polylines",
    "read_volume",
    "save",
    "save_field",
    "write_curves",
    "write_polylines",
    "write_vdb",
]
