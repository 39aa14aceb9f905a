"""Figures without display or global state, and their files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..io.files import PathLike, ensure_writable, extension, replacing
from ..packages import lazy_module, require

if TYPE_CHECKING:
    from matplotlib.figure import Figure

backend_agg = lazy_module("matplotlib.backends.backend_agg", "pictures")
mpl_figure = lazy_module("matplotlib.figure", "pictures")

PICTURE_FORMATS = frozenset({".png", ".pdf", ".svg", ".jpg"})


def ensure_picture_writable(path: PathLike) -> None:
    """Find out before a long computation whether a picture of its result can be written.

    Raises
    ------
    FileFormatError
        If the format is unknown, or no file can be made there.
    MissingPackageError
        If matplotlib is not installed.
    """
    ensure_writable(path, PICTURE_FORMATS, "a picture")
    require("matplotlib", "pictures")


def new_figure(width: float, height: float) -> Figure:
    """An empty figure; width and height in inches."""
    figure: Figure = mpl_figure.Figure(figsize=(width, height), layout="constrained", facecolor="white")
    backend_agg.FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, path: PathLike, dpi: int = 130) -> None:
    """Write a figure in the format given by the extension."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format=extension(path)[1:])
