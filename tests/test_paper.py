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

CITED = {
    int(number)
    for path in SOURCE.rglob("*.py")
    for number in re.findall(r"\bEq\. (\d+)\b", path.read_text(encoding="utf-8"))
}


def test_every_equation_is_cited_in_the_source():
    assert set(range(8, 24)) <= CITED


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
