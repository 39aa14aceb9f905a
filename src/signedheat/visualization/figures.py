"""Figures that need no screen and no global state, and files for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..io.files import PathLike, extension, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_FORMATS = frozenset({".png", ".pdf", ".svg", ".jpg"})


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, path: PathLike, dpi: int = 130) -> None:
    """Write a figure in the format that the file's name ends with."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format=extension(path)[1:])
