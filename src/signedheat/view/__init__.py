"""Fields and shapes as pictures, by Matplotlib, and in windows and notebooks, by PyVista."""

from .drawing import save_row
from .figures import PICTURE_FORMATS, ensure_picture_writable, new_figure
from .slice_pictures import draw_plane, draw_slices, save_slices
from .surface_pictures import DEVIATION_FORMATS, THICKNESS_FORMATS, draw_shape, draw_surface, save_scene, save_surface

__all__ = [
    "DEVIATION_FORMATS", "PICTURE_FORMATS", "THICKNESS_FORMATS", "draw_plane", "draw_shape", "draw_slices",
    "draw_surface", "ensure_picture_writable", "new_figure", "save_row", "save_scene", "save_slices", "save_surface",
]  # fmt: skip
