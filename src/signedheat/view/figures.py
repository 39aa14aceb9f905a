"""Figures without display or global state, their files, and the colours and isolines of distance.

Blue is inside, orange outside; both sides have one scale.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from ..errors import GeometryError
from ..io.files import PathLike, ensure_writable, extension, replacing
from ..packages import lazy_module, require
from ..validation import positive_number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure, SubFigure

backend_agg: Any = lazy_module("matplotlib.backends.backend_agg", "pictures")
mpl_cm: Any = lazy_module("matplotlib.cm", "pictures")
mpl_colors: Any = lazy_module("matplotlib.colors", "pictures")
mpl_figure: Any = lazy_module("matplotlib.figure", "pictures")

PICTURE_FORMATS = frozenset({".png", ".pdf", ".svg", ".jpg"})
"""Extensions of files to which pictures can be written."""
INSIDE_TO_OUTSIDE = ["#0b3c5d", "#3f7fae", "#a9cce3", "#fbfaf5", "#f6c9a0", "#d9793a", "#8c2d04"]
"""Colours from far inside to far outside: blue, light at the surface, orange."""


def ensure_picture_writable(path: PathLike) -> None:
    """Raise an error if a picture cannot be written to a file, before a long computation.

    Parameters
    ----------
    path : str or path
        The file, in one of the formats `PICTURE_FORMATS`.

    Raises
    ------
    FileFormatError
        If the format is unknown, or the folder is not writable.
    MissingPackageError
        If Matplotlib is not installed.
    """
    ensure_writable(path, PICTURE_FORMATS, "a picture")
    require("matplotlib", "pictures")


def new_figure(width: float, height: float) -> Figure:
    """Make an empty Matplotlib figure, without a window.

    Parameters
    ----------
    width, height : float
        Its size in inches.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, into whose axes functions such as `draw_slices` draw.
    """
    size = positive_number(width, "width"), positive_number(height, "height")
    figure: Figure = mpl_figure.Figure(figsize=size, layout="constrained", facecolor="white")
    backend_agg.FigureCanvasAgg(figure)
    return figure


@contextmanager
def picture(path: PathLike, width: float, height: float, dpi: int = 130) -> Iterator[Figure]:
    """Yield an empty figure to draw into; at the end of the ``with`` block, write it to a file.

    `width` and `height` are in inches, and `dpi` is pixels per inch.
    """
    ensure_picture_writable(path)
    figure = new_figure(width, height)
    yield figure
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format=extension(path)[1:])


def distance_colors(low: float, high: float) -> ScalarMappable:
    """Make a colour scale for distances between two values, light at zero.

    It follows the root of distance, so that a thin inside is visible beside a wide outside.
    """
    reach = max(abs(low), abs(high), 1e-300)
    return _scale_of(mpl_colors.FuncNorm((signed_root, lambda x: x * np.abs(x)), -reach, reach))


def even_colors(reach: float) -> ScalarMappable:
    """Make a scale of the colours of `distance_colors`, linear from −reach to reach, and constant beyond."""
    return _scale_of(mpl_colors.Normalize(-reach, reach))


def _scale_of(norm: Any) -> ScalarMappable:
    """Make a scale of the colours `INSIDE_TO_OUTSIDE`; a Matplotlib norm maps values to positions on it."""
    colors = mpl_colors.LinearSegmentedColormap.from_list("inside to outside", INSIDE_TO_OUTSIDE)
    return mpl_cm.ScalarMappable(norm, colors)


def signed_root(values: Any) -> Any:
    """Return √|x| with the sign of x."""
    return np.sign(values) * np.sqrt(np.abs(values))


def range_of(values: Floats) -> tuple[float, float]:
    """Return the least and the greatest value of a field; raise `GeometryError` if it has none, or infinite ones."""
    if np.isnan(values).all():
        raise GeometryError("the field has no value anywhere", remedy="compute it anew", element="field")
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if not (np.isfinite(low) and np.isfinite(high)):
        raise GeometryError("the field has infinite values", remedy="replace them by NaN", element="field")
    return low, high


def isolines_between(low: float, high: float, most: int = 16) -> tuple[Floats, float]:
    """Return about `most` levels between two values, without zero, and the step between them, a round number."""
    step = round_step((high - low) / max(most, 1))
    levels = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return levels[np.abs(levels) > 0.5 * step], step


def round_step(width: float) -> float:
    """Return 1, 2 or 5 times a power of ten, close to `width`."""
    if not width > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(width))
    return float(power * min((1, 2, 5, 10), key=lambda digit: abs(np.log(width / power / digit))))


def legible(ticks: Floats, low: float, high: float) -> list[float]:
    """Return zero and those ticks of a colour bar from `low` to `high` whose labels do not overlap, in ascending order.

    The length of the bar follows the root of distance.
    """
    least = 0.07 * float(signed_root(high) - signed_root(low))  # least step between ticks on the bar
    result = [0.0]
    for outwards in (ticks[ticks > 0], ticks[ticks < 0][::-1]):
        last = 0.0
        for tick in outwards.tolist():
            if abs(signed_root(tick) - signed_root(last)) >= least:
                result.append(tick)
                last = tick
    return sorted(result)


def add_color_bar(
    figure: Figure | SubFigure, axes: Sequence[Axes], colors: ScalarMappable, isolines: Floats, step: float
) -> None:
    """Add a colour bar beside axes, which spans the values of the isolines, with round numbers on both sides of zero.

    `step` is the difference between isolines, which the label states.
    """
    bar = figure.colorbar(colors, ax=list(axes), shrink=0.85, pad=0.015)
    kind = "signed distance" if not len(isolines) or isolines[0] < 0 else "distance"
    bar.set_label(f"{kind}, a line every {step:g}")
    if len(isolines):
        tick_step = round_step((isolines[-1] - isolines[0]) / 7)  # about seven labels
        ticks = tick_step * np.arange(np.ceil(isolines[0] / tick_step), np.floor(isolines[-1] / tick_step) + 1)
        reach = float(np.max(colors.norm.vmax or 0.0))
        first, last = isolines[0], isolines[-1]
        low = 0.0 if abs(first) < 1e-9 * reach else max(min(first - step, 0.0), -reach)  # no colours beyond the values
        high = 0.0 if abs(last) < 1e-9 * reach else min(max(last + step, 0.0), reach)
        bar.ax.set_ylim(low, high)
        bar.set_ticks(legible(ticks, low, high))
        bar.ax.yaxis.set_major_formatter("{x:g}")
