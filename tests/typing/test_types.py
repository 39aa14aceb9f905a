"""The type check that CI runs: what it counts, and that it knows when there is more of it."""

from __future__ import annotations

import inspect
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from public_names import PUBLIC

ROOT = Path(__file__).parents[2]
PUBLIC_MODULES = (
    "__init__",
    "constraints",
    "discretization",
    "errors",
    "method",
    "solver",
    "domains/",
    "curves/",
    "fields/",
    "io/",
)


def tool() -> dict[str, object]:
    return runpy.run_path(str(ROOT / "tools" / "check_types.py"))


def test_the_baseline_names_no_module_of_the_public_face():
    allowed = tool()["read_baseline"]((ROOT / "tools" / "type_errors.txt").read_text(encoding="utf-8"))
    assert allowed
    assert [name for name in allowed if name.removeprefix("src/signedheat/").startswith(PUBLIC_MODULES)] == []


def test_errors_are_counted_by_file():
    output = "a.py:1: error: bad  [x]\na.py:1: note: see\na.py:4: error: bad  [x]\nb.py:7: error: worse  [y]\nFound 3"
    assert tool()["counted"](output) == {"a.py": 2, "b.py": 1}


def test_a_wrong_type_is_found_and_none_in_the_documents(tmp_path):
    """The checked user code fails where its types are not what it says; the code of the first pages has no errors."""
    code = (ROOT / "tests" / "typing" / "user_code.py").read_text(encoding="utf-8")
    wrong = tmp_path / "wrong.py"
    wrong.write_text(code + "\nassert_type(sdf.contour(0), list[sh.Polyline])\n", encoding="utf-8")
    for page in ("README.md", "docs/quickstart.md", "docs/tutorial.md"):
        blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
        (tmp_path / f"{Path(page).stem.lower()}_code.py").write_text("\n\n".join(blocks), encoding="utf-8")
    files = sorted(map(str, tmp_path.glob("*.py")))
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary", *files]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    [error] = [line for line in found.stdout.splitlines() if "error:" in line]
    assert "assert-type" in error and "wrong.py" in error


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
