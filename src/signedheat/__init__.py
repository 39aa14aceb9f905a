"""Generalized signed distance to broken geometry, by the signed heat method.

The public names are those of `public.py`. They are imported together when one of them is first used, so that the
command line can answer ``--help`` at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import batches as batches
    from . import constraints as constraints
    from . import errors as errors
    from . import io as io
    from . import methods as methods
    from . import morphology as morphology
    from . import results as results
    from . import samples as samples
    from . import torch as torch
    from . import view as view
    from .public import *  # noqa: F403
    from .public import __all__ as __all__

__version__ = "1.0.0rc1"


def __getattr__(name: str) -> Any:
    public = import_module(f"{__name__}.public")
    globals().update({name: getattr(public, name) for name in [*public.__all__, "__all__"]})
    if name in globals():
        return globals()[name]
    found = [f"{module.__name__}.{name}" for module in public.MODULES if name in module.__all__]
    where = f": it is {found[0]}" if found else ""
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{where}", name=name, obj=public)


def __dir__() -> list[str]:
    public = import_module(f"{__name__}.public")
    modules = (module.__name__.rpartition(".")[2] for module in public.MODULES)
    return sorted([*public.__all__, *modules, "__version__"])
