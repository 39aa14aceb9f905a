"""Reading and writing: shapes, and the fields computed from them."""

from .fields import FIELD_FORMATS, load_field, save_field
from .files import ensure_writable
from .shapes import SHAPE_FORMATS, read, save

__all__ = ["FIELD_FORMATS", "SHAPE_FORMATS", "ensure_writable", "load_field", "read", "save", "save_field"]
