"""Packages that are imported at first use, because they are slow to import or optional.

NumPy and SciPy are imported as usual. For all other packages, and for modules of this one whose import would be slow
or circular, modules hold `lazy_module` handles in place of imports.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from .errors import MissingPackageError

REMEDIES = {
    "OCP": "pip install cadquery-ocp",
    "PIL": "pip install pillow",
    "collada": "pip install pycollada",
    "mpl_toolkits": "pip install matplotlib",
    "skimage": "pip install scikit-image",
}
"""Commands to install packages whose name differs from the name of the import."""


class LazyModule:
    """A handle made by `lazy_module`, which imports a module when an attribute is first used."""

    def __init__(self, name: str, purpose: str) -> None:
        self._name = name
        self._purpose = purpose

    def __getattr__(self, attribute: str) -> Any:
        if attribute.startswith("__"):  # looked up by doctest, copy and the like
            raise AttributeError(attribute)
        return getattr(require(self._name, self._purpose), attribute)

    def __repr__(self) -> str:
        return f"lazy_module({self._name!r}, {self._purpose!r})"


def lazy_module(name: str, purpose: str) -> Any:
    """Return a handle that acts as the module `name`, and imports it when an attribute is first used.

    `purpose` is a plural noun for the error message if the import fails, such as "contours" in "contours need the
    package skimage, which is not installed".

    Examples
    --------
    >>> statistics = lazy_module("statistics", "examples")
    >>> statistics.median([3, 1, 2])
    2
    """
    return LazyModule(name, purpose)


def require(name: str, purpose: str) -> ModuleType:
    """Import a module, and return it; raise `MissingPackageError` if that fails. `purpose` is as for `lazy_module`."""
    try:
        return import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        is_missing = isinstance(error, ModuleNotFoundError) and error.name == package
        cause = "is not installed" if is_missing else f"cannot be imported ({error})"
        raise missing_package(package, purpose, cause) from error


def ensure_installed(package: str, purpose: str) -> None:
    """Raise `MissingPackageError` if a package is not installed, without importing it."""
    if find_spec(package) is None:
        raise missing_package(package, purpose)


def missing_package(package: str, purpose: str, cause: str = "is not installed") -> MissingPackageError:
    """Return the error that says that a package is missing; `purpose` is as for `lazy_module`."""
    remedy = REMEDIES.get(package, f"pip install {package}")
    return MissingPackageError(f"{purpose} need the package {package}, which {cause}", remedy=remedy, element=package)
