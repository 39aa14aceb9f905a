"""What shapes and fields look like in a notebook, and in a window of PyVista."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..slots import Slot

if TYPE_CHECKING:
    import pyvista

html_of: Slot[[object], str] = Slot("html_of")
"""HTML with a small picture of a shape or a field."""
plotter_of: Slot[[object], Any] = Slot("plotter_of")
"""A `pyvista.Plotter` in which a shape or a field is drawn."""

NAME = "signed_distance"
"""Of the values of a field, in objects of PyVista and in files."""


def with_values(thing: Any, values: NDArray[np.floating]) -> Any:
    """An object of PyVista with the values of a field at its points."""
    thing.point_data[NAME] = np.array(values)
    thing.set_active_scalars(NAME)
    return thing


class Displayed:
    """A shape or a field that can be looked at."""

    def plotter(self) -> pyvista.Plotter:
        """A `pyvista.Plotter` in which this is drawn, to add more to it, or to make a file of it.

        Fields have the colours of all pictures here: blue for negative distance, orange for positive, light at zero;
        the surface or line of distance zero is drawn too. Of shapes, outer sides are light and inner sides red.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed (``pip install pyvista``).
        """
        plotter: pyvista.Plotter = plotter_of(self)
        return plotter

    def plot(self) -> object:
        """Show this in a window, or in the notebook, by PyVista; with trame installed, notebooks can turn it.

        Returns
        -------
        object
            What `pyvista.Plotter.show` returns: nothing after a window, what is displayed in a notebook.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed (``pip install pyvista``).
        """
        return self.plotter().show()

    def _repr_html_(self) -> str:
        return html_of(self)
