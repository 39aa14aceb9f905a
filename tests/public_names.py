"""All public names: those of the package, and those of the modules that it shows."""

from __future__ import annotations

import functools
import inspect

import signedheat as sh

READERS = [name for name in sh.io.__all__ if name.startswith(("read_", "write_", "Label"))]
MODULES = {
    "batches": None,
    "constraints": None,
    "errors": None,
    "io": READERS,
    "methods": None,
    "morphology": None,
    "results": None,
    "torch": None,
}

PUBLIC = [(name, getattr(sh, name)) for name in sh.__all__]
PUBLIC += [
    (f"{module}.{name}", getattr(getattr(sh, module), name))
    for module, names in MODULES.items()
    for name in names or getattr(sh, module).__all__
    if name not in sh.__all__
]


def methods() -> list[tuple[str, object]]:
    """Every public method and class method of the public classes, by its full name; those of base classes, too."""
    found = []
    for name, thing in PUBLIC:
        for method, function in inspect.getmembers(thing) if isinstance(thing, type) else ():
            is_ours = (getattr(function, "__module__", None) or "").startswith("signedheat.")
            if inspect.isroutine(function) and is_ours and not method.startswith("_"):
                found.append((f"{name}.{method}", function))
    return found


def properties() -> list[tuple[str, object]]:
    """Every public property of the public classes, by its full name; those of base classes, too."""
    return [
        (f"{name}.{attribute}", value)
        for name, thing in PUBLIC
        for attribute, value in (inspect.getmembers(thing) if isinstance(thing, type) else ())
        if isinstance(value, property | functools.cached_property) and not attribute.startswith("_")
    ]
