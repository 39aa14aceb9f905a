"""What shapes and fields look like in a notebook, in a window of PyVista, and in Polyscope."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..slots import Slot

if TYPE_CHECKING:
    import pyvista

to_pyvista: Slot[[object], Any] = Slot("to_pyvista")
"""An object of PyVista that holds a domain or a field."""
html_of: Slot[[object], str] = Slot("html_of")
"""HTML with a small picture of a shape or a field."""
plotter_of: Slot[[object], Any] = Slot("plotter_of")
"""A `pyvista.Plotter` in which a shape or a field is drawn."""
register_in_polyscope: Slot[[object, str], object] = Slot("register_in_polyscope")
"""Arguments: a shape or a field, a name. Returns the structure of Polyscope."""


class Displayed:
    """A shape or a field that can be looked at."""

    def plotter(self) -> pyvista.Plotter:
        """A `pyvista.Plotter` in which this is drawn, to add more to it, or to make a file of it.

        Fields have the colours of all pictures here: blue for negative distance, orange for positive, light at zero;
        the surface or line of distance zero is drawn too. Of shapes, outer sides are light and inner sides red.

        Raises
        ------
        MissingPackageError
            If PyVista is not installed (``pip install signedheat[plot]``).
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
            If PyVista is not installed (``pip install signedheat[plot]``).
        """
        return self.plotter().show()

    def to_polyscope(self, name: str = "signedheat") -> object:
        """Register this with Polyscope, which has to be initialised; ``polyscope.show()`` then shows it.

        Parameters
        ----------
        name : str
            What Polyscope calls it. The values of a field are a scalar quantity ``signed distance``.

        Returns
        -------
        object
            The structure of Polyscope, for further settings.

        Raises
        ------
        MissingPackageError
            If Polyscope is not installed (``pip install polyscope``).
        UnsupportedTypeError
            If Polyscope has no structure of this kind, such as for fields in the plane.
        """
        return register_in_polyscope(self, name)

    def _repr_html_(self) -> str:
        return html_of(self)
