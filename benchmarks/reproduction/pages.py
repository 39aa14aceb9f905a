"""Sections of a chapter: what a figure draws and measures, kept in files, and written as Markdown."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

Row = dict[str, str]


@dataclass
class Page:
    """Where a figure puts its picture and its rows."""

    folder: Path
    number: str
    rows: list[Row] = field(default_factory=list)

    def add(self, **cells: object) -> None:
        """Add a row of the table: one cell for each column; numbers with three digits."""
        self.rows.append({name.replace("_", " "): _cell(value) for name, value in cells.items()})

    def draw(self, figure: Figure, width: int = 1100) -> None:
        """Keep the picture, with few colours: small files."""
        path = self.folder / picture_name(self.number)
        figure.savefig(path, dpi=110, bbox_inches="tight")
        picture = Image.open(path).convert("RGB")
        if picture.width > width:
            picture = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
        picture.quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)


@dataclass(frozen=True)
class Section:
    """One figure of the paper, or several that show one thing."""

    title: str
    make: Callable[[Page], None]


DIFFERENCES = Path(__file__).parent / "differences.md"
"""The last section: what the library does differently, and why."""
FIGURES: dict[str, Section] = {}
"""By the number that the paper gives them."""


def figure(number: str, title: str) -> Callable[[Callable[[Page], None]], Callable[[Page], None]]:
    """Decorator: this function remakes that figure, or the numbers of a section, such as ``"section-9.5"``."""

    def add(make: Callable[[Page], None]) -> Callable[[Page], None]:
        if number in FIGURES:
            raise ValueError(f"figure {number} is made twice: by {FIGURES[number].make.__name__} and {make.__name__}")
        FIGURES[number] = Section(title, make)
        return make

    return add


def picture_name(number: str) -> str:
    return f"figure-{number}.png"


def load_numbers(folder: Path) -> dict[str, list[Row]]:
    path = folder / "numbers.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def save_numbers(folder: Path, numbers: Mapping[str, list[Row]]) -> None:
    text = json.dumps(dict(sorted(numbers.items(), key=lambda item: order(item[0]))), indent=1, ensure_ascii=False)
    (folder / "numbers.json").write_text(text + "\n", encoding="utf-8")


def order(number: str) -> tuple[bool, float]:
    """Figures by their numbers, then sections."""
    is_section = number.startswith("section-")
    return is_section, float(number.removeprefix("section-").partition("-")[0])


def heading(number: str) -> str:
    """What a figure or a section is called.

    >>> heading("4-19"), heading("section-9.5")
    ('Figures 4 and 19', 'Section 9.5')
    """
    if number.startswith("section-"):
        return f"Section {number.removeprefix('section-')}"
    return f"Figure {number}" if "-" not in number else f"Figures {number.replace('-', ' and ')}"


def write_chapter(folder: Path, numbers: Mapping[str, list[Row]], versions: str) -> None:
    """Write docs/paper.md from the docstrings, the rows and the pictures."""
    lines = [
        "# The paper, reproduced",
        "",
        "Every section remakes a figure of Nicole Feng and Keenan Crane, *A Heat Method for Generalized Signed",
        "Distance*, ACM Transactions on Graphics 43(4), 2024, [doi:10.1145/3658220](https://doi.org/10.1145/3658220),",
        "on generated shapes. Baselines are in `benchmarks/reproduction/baselines.py`. The last section lists what is",
        "done differently.",
        "",
        f"`make paper` makes this page. Last run with {versions}.",
        "Errors ε are root mean squares in per cent of the range of the true distance (Sec. 9.1); t = h² if nothing",
        "is said.",
    ]
    for number, section in sorted(FIGURES.items(), key=lambda item: order(item[0])):
        lines += ["", f"## {heading(number)}: {section.title}", "", inspect.getdoc(section.make) or ""]
        if (folder / picture_name(number)).exists():
            lines += ["", f"![{section.title}](paper/{picture_name(number)})"]
        if numbers.get(number):
            lines += ["", *table(numbers[number])]
    lines += ["", DIFFERENCES.read_text(encoding="utf-8").rstrip()]
    (folder.parent / "paper.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def table(rows: list[Row]) -> list[str]:
    """Rows as a Markdown table; what a row lacks stays empty."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return lines + ["| " + " | ".join(row.get(name, "") for name in columns) + " |" for row in rows]


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)
