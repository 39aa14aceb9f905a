"""Rows of pictures in one style: shapes, and fields with colours centred on zero, isolines and both signs."""

from __future__ import annotations

from typing import Any

from ..io.files import PathLike
from .figures import ensure_picture_writable, new_figure, write_figure
from .notebook import draw

PANEL = 4.3
"""Side of a panel, in inches."""


def save_row(path: PathLike, *panels: tuple[Any, ...]) -> None:
    """Write a picture of several shapes and fields, side by side, each with its title.

    Parameters
    ----------
    path : str or path
        The picture: ``.png``, ``.pdf``, ``.svg`` or ``.jpg``.
    panels : tuples of (title, thing) or (title, thing, options)
        A shape or a field, and a dictionary of options for it: ``view`` (elevation and azimuth) of shapes; ``shape``,
        ``levels`` and ``across`` of fields on grids, as in `draw_slices`; ``sources`` and ``view`` of fields on
        surfaces, as in `draw_surface`.

    Raises
    ------
    FileFormatError
        If the picture cannot be written.
    """
    ensure_picture_writable(path)
    figure = new_figure(PANEL * len(panels), PANEL)
    for k, (title, thing, *options) in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), k + 1)
        draw(thing, axes, **(options[0] if options else {}))
        axes.set_title(title, fontsize=11)
    write_figure(figure, path, dpi=110)
