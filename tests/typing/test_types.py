"""The type check that CI runs, and that no public name is of any type."""

from __future__ import annotations

import inspect
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

from public_names import PUBLIC

ROOT = Path(__file__).parents[2]


def tool() -> dict[str, object]:
    return runpy.run_path(str(ROOT / "tools" / "check_types.py"))


def test_code_of_the_first_pages_is_checked(tmp_path):
    """One file for each page, whose lines are all Python."""
    check = tool()
    for page in check["PAGES"]:
        code = check["write_code"](page, tmp_path).read_text(encoding="utf-8")
        assert "signedheat" in code
        compile(code, page, "exec")


def annotations(thing: object) -> dict[str, str]:
    """Parameters and result of a function, fields, properties and methods of a class, as they are written."""
    if not isinstance(thing, type):
        return dict(inspect.get_annotations(thing)) if callable(thing) else {}
    found = {}
    for base in thing.__mro__[:-1]:
        if base.__module__.startswith("signedheat"):
            found |= {f"{base.__name__}.{name}": kind for name, kind in inspect.get_annotations(base).items()}
            for name, member in vars(base).items():
                function = getattr(member, "fget", None) or getattr(member, "func", None) or member
                function = getattr(function, "__func__", function)
                if inspect.isfunction(function) and (not name.startswith("_") or name in ("__init__", "__call__")):
                    found |= {f"{name}.{k}": kind for k, kind in inspect.get_annotations(function).items()}
    return {name: kind for name, kind in found.items() if not name.partition(".")[2].startswith("_")}


@pytest.mark.parametrize("thing", [thing for _, thing in PUBLIC], ids=[name for name, _ in PUBLIC])
def test_nothing_public_is_of_any_type(thing):
    kinds = annotations(thing)
    assert {where: kind for where, kind in kinds.items() if re.search(r"\bAny\b", str(kind))} == {}


def test_any_types_would_be_found():
    class Public:
        """Stands in for a class of the package."""

        field: Any

        def method(self, argument: Any) -> None: ...

    Public.__module__ = "signedheat.test"
    assert set(annotations(Public)) >= {"Public.field", "method.argument"}
