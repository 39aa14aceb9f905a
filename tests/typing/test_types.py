"""The type check that CI runs: what it counts, and that it knows when there is more of it."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PUBLIC = (
    "__init__",
    "constraints",
    "discretization",
    "errors",
    "method",
    "solver",
    "domains/",
    "extensions/",
    "fields/",
    "io/",
)


def tool() -> dict[str, object]:
    return runpy.run_path(str(ROOT / "tools" / "check_types.py"))


def test_the_baseline_names_no_module_of_the_public_face():
    allowed = tool()["read_baseline"]((ROOT / "tools" / "type_errors.txt").read_text(encoding="utf-8"))
    assert allowed
    assert [name for name in allowed if name.removeprefix("src/signedheat/").startswith(PUBLIC)] == []


def test_errors_are_counted_by_file():
    output = "a.py:1: error: bad  [x]\na.py:1: note: see\na.py:4: error: bad  [x]\nb.py:7: error: worse  [y]\nFound 3"
    assert tool()["counted"](output) == {"a.py": 2, "b.py": 1}


def test_a_wrong_type_is_found(tmp_path):
    """The checked user code fails where its types are not what it says."""
    code = (ROOT / "tests" / "typing" / "user_code.py").read_text(encoding="utf-8")
    wrong = tmp_path / "wrong.py"
    wrong.write_text(code + "\nassert_type(sdf.contour(0), list[sh.Polyline])\n", encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--follow-imports=silent", "--no-error-summary", str(wrong)]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    [error] = [line for line in found.stdout.splitlines() if "error:" in line and "wrong.py" in line]
    assert "assert-type" in error
