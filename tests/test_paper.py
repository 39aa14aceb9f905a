"""The paper is findable: its equations in the source, its sections in docs/architecture.md, its numbers on the page."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

import pytest

import signedheat

SOURCE = Path(signedheat.__file__).parent
ROOT = Path(__file__).parents[1]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
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


@pytest.fixture(scope="module")
def reproduction():
    """The package that remakes the figures, and their numbers in docs/paper.md."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        pages = importlib.import_module("reproduction.pages")
        for name in ("accuracy", "domains", "space", "surfaces"):
            importlib.import_module(f"reproduction.{name}")
        yield pages


def test_page_has_the_numbers_and_the_words_of_its_script(reproduction):
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    numbers = reproduction.load_numbers(ROOT / "docs" / "paper")
    assert set(numbers) == set(reproduction.FIGURES)
    for number, section in reproduction.FIGURES.items():
        assert inspect.getdoc(section.make) in page
        assert "\n".join(reproduction.table(numbers[number])) in page


@pytest.mark.parametrize("number", ["8", "10", "17"])
@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")
def test_page_is_no_older_than_what_it_measures(reproduction, number, tmp_path, monkeypatch):
    """What is quick, boundaries, constraints and broken curves, is measured again, to a tenth, but not drawn."""
    monkeypatch.setattr("reproduction.surfaces.draw_surface", lambda *_, **__: None)
    monkeypatch.setattr(reproduction.Page, "draw", lambda *_: None)
    page = reproduction.Page(tmp_path, number)
    reproduction.FIGURES[number].make(page)
    written = reproduction.load_numbers(ROOT / "docs" / "paper")[number]
    assert [list(row) for row in page.rows] == [list(row) for row in written]
    for measured, row in zip(page.rows, written, strict=True):
        for name, cell in row.items():
            if re.fullmatch(r"[-+.e\d]+", cell):
                assert float(measured[name]) == pytest.approx(float(cell), rel=0.1), f"{name}: make paper"
            else:
                assert measured[name] == cell
