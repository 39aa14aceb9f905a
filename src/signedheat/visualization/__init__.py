"""Pictures of fields and shapes; no display is needed."""

from . import interactive as _interactive  # noqa: F401  provides windows
from . import notebook as _notebook  # noqa: F401  provides what notebooks show
from . import polyscope_scenes as _polyscope_scenes  # noqa: F401  provides views in Polyscope
from .figures import PICTURE_FORMATS, ensure_picture_writable, new_figure
from .pages import PAGE_FORMATS, save_page
from .rows import save_row
from .scenes import draw_shape, save_scene
from .slices import draw_plane, draw_slices, save_slices
from .surfaces import draw_surface, save_surface

__all__ = [
    "PAGE_FORMATS",
    "PICTURE_FORMATS",
    "draw_plane",
    "draw_shape",
    "draw_slices",
    "draw_surface",
    "ensure_picture_writable",
    "new_figure",
    "save_page",
    "save_row",
    "save_scene",
    "save_slices",
    "save_surface",
]
