"""The paper is findable: its equations in the source, and its sections in the table of docs/architecture.md."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import signedheat

SOURCE = Path(signedheat.__file__).parent
ARCHITECTURE = Path(__file__).parents[1] / "docs" / "architecture.md"
TABLE = ARCHITECTURE.read_text(encoding="utf-8").partition("## From the paper to the code")[2]
ROWS = [line for line in TABLE.splitlines() if line.startswith("|")][2:]
NAMES = sorted({name for row in ROWS for name in re.findall(r"`(signedheat\.[\w.]+)`", row)})

FOLDERS = {
    8: ["geometry", "operators"],
    9: ["operators"],
    10: ["operators", "operators/grid", "lowering/surface", "lowering/grid"],
    11: ["lowering", "lowering/surface", "lowering/grid", "lowering/tets"],
    12: ["operators/grid", "lowering/surface", "lowering/grid", "lowering/tets"],
    13: ["operators", "operators/grid", "lowering", "lowering/surface", "lowering/grid", "lowering/tets"],
    14: ["lowering", "lowering/surface", "lowering/grid", "lowering/tets"],
    15: ["geometry", "extensions"],
    16: ["extensions"],
    17: ["operators", "extensions"],
    18: ["operators", "extensions"],
    19: ["lowering/surface"],
    20: ["operators"],
    21: ["operators", "lowering/tets"],
    22: ["operators", "lowering/tets"],
    23: ["operators", "lowering/tets"],
}
"""Where each equation is done: one folder for every domain that it concerns."""


def cited(folder: str) -> set[int]:
    """Equations that the modules of a folder cite, its subfolders left out."""
    text = "".join(path.read_text(encoding="utf-8") for path in sorted((SOURCE / folder).glob("*.py")))
    return {int(number) for number in re.findall(r"\bEq\. (\d+)\b", text)}


@pytest.mark.parametrize("equation", range(8, 24))
def test_equation_is_cited_wherever_it_is_done(equation):
    missing = [folder for folder in FOLDERS[equation] if equation not in cited(folder)]
    assert not missing, f"Eq. {equation} is cited nowhere in {missing}"


def test_equation_is_in_the_table():
    listed = {int(number) for row in ROWS for number in re.findall(r"\d+", "".join(re.findall(r"Eqs?\. [\d, ]+", row)))}
    assert listed >= set(range(8, 24))


@pytest.mark.parametrize("name", NAMES)
def test_table_names_what_there_is(name):
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            found = getattr(found, part)
        return
    pytest.fail(f"{name} does not exist")


@pytest.mark.parametrize("row", ROWS)
def test_every_row_names_code(row):
    assert "`signedheat." in row or "`benchmarks/`" in row
