"""``signedheat warmup``: compile everything now."""

from __future__ import annotations

from typing import Any

from .options import add_command


def add_to(commands: Any) -> None:
    """Register the command."""
    add_command(
        commands,
        "warmup",
        help="compile everything now, instead of at its first use",
        description="Runs everything once on small shapes. What is compiled is kept in the folder that NUMBA_CACHE_DIR "
        "names, or else in the cache of the user; run it again after an update.",
    )
