"""All public names: those of the package, and those of the modules that it shows."""

from __future__ import annotations

import signedheat as sh

ERRORS = [name for name, thing in vars(sh.errors).items() if isinstance(thing, type) and issubclass(thing, Exception)]
READERS = [name for name in sh.io.__all__ if name.startswith(("load", "read_", "write_", "Label"))]
MODULES = {"batches": None, "errors": ERRORS, "io": READERS, "morphology": None, "results": None}

PUBLIC = [(name, getattr(sh, name)) for name in sh.__all__]
PUBLIC += [
    (f"{module}.{name}", getattr(getattr(sh, module), name))
    for module, names in MODULES.items()
    for name in names or getattr(sh, module).__all__
    if name not in sh.__all__
]
