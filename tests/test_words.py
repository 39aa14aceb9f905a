"""Numbers in sentences, and the words and signs of documents and docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from public_names import PUBLIC, methods
from signedheat import Grid, TriangleMesh, complete, diagnostics, samples
from signedheat.cli import main
from signedheat.errors import Sentence, counted, percent


@pytest.mark.parametrize("share", [0.0, 1e-12, 1e-5, 0.004999, 0.12345, 0.9994, 0.99951, 0.999999, 1.0, 1.5, 123.0])
@pytest.mark.parametrize("digits", [1, 2, 3])
def test_shares_are_near_and_well_formed(share, digits):
    text = percent(share, digits)
    assert re.fullmatch(r"[0-9]+(\.[0-9]+)? %|[0-9.]+e-[0-9]+ %", text) and "e+" not in text
    assert float(text.removesuffix(" %")) == pytest.approx(100 * share, rel=0.5 * 10.0 ** (1 - digits) + 1e-12)


def test_counts():
    assert [counted(n, "face") for n in (0, 1, np.int64(1), 2)] == ["0 faces", "1 face", "1 face", "2 faces"]
    assert [counted(2, noun) for noun in ("vertex", "body", "box", "mesh")] == [
        "2 vertices", "2 bodies", "2 boxes", "2 meshes",
    ]  # fmt: skip
    assert Sentence().format("{0:face}, {1:%} and {2:.3g}", 1, 0.5, 2.0) == "1 face, 50 % and 2"


def test_notes_have_no_exponents_in_percent_and_no_wrong_plurals():
    notes = [
        diagnostics.LeftOut(1, 0.9999999, 1),
        diagnostics.FacesRestored(1, 0.9999999),
        diagnostics.BoundsNothing(1.0),
        diagnostics.OrientedPoints(1, 1),
        diagnostics.CompletedArea(1.0, 0.99999999, []),
        diagnostics.ShapeOriented(1, 0.9999999, 1, 1, 0, 0.0, 0, 0),
    ]
    for note in notes:
        assert not re.search(r"e\+|[0-9]%|\b1 [a-z]+s\b", str(note)), str(note)


ROOT = Path(__file__).parents[1]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
DOCUMENTED = [(name, inspect.getdoc(thing) or "") for name, thing in [*PUBLIC, *methods()]]
DIALECT = r"(?i)\b(turned|turns? (?=to|what|curves?|faces?|no|the)|pieces?|rims?|places?)\b"
"""Words for which the field has better ones: flipped, patches or strokes, boundary loops, points or positions."""


def sentences(text: str) -> Iterator[str]:
    """The sentences of paragraphs, lists and cells of tables, without code, links and bold openings."""
    for pattern, instead in (
        (r"```.*?```", ""), (r"``.*?``|`[^`]*`", "code"), (r"\]\([^)]*\)", "]"), (r"\*\*[^*]*\*\*:?", ""),
    ):  # fmt: skip
        text = re.sub(pattern, instead, text, flags=re.S)
    for block in re.split(r"\n\s*\n|\n(?=[*|#>-] ?|\d\.)|\|", text):
        yield from re.split(r"(?<=[.!?])\s+(?=[A-Z\"(*\[∇φε]|code)", " ".join(block.split()))


def prose(docstring: str) -> str:
    """A docstring without its headings, lists of other things to look at, names of parameters and examples."""
    text = docstring.partition("Examples\n---")[0]
    text = re.sub(r"See Also\n-+\n.*?(\n\n|\Z)", "\n\n", text, flags=re.S)
    return re.sub(r"^[^\s].* : .*$|^.*\n-{3,}$", "\n", text, flags=re.M)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_sentences_of_pages_have_one_colon_or_semicolon_at_most(page):
    text = page.read_text(encoding="utf-8")
    assert [each for each in sentences(text) if len(re.findall(r"[;:](?=\s|$)", each)) > 1] == []
    code = re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.S)
    assert re.findall(r"(?<![\w.…/*])\.\d", code) == []  # 0.5, not .5


@pytest.mark.parametrize(("name", "docstring"), DOCUMENTED, ids=[name for name, _ in DOCUMENTED])
def test_docstrings_use_the_words_of_the_field(name, docstring):
    text = re.sub(r"``.*?``|`[^`]*`|in place of", "code", prose(docstring), flags=re.S)
    assert re.findall(DIALECT, text) == []
    assert [each for each in sentences(text) if len(re.findall(r"[;:](?=\s|$)", each)) > 1] == []


@pytest.mark.parametrize("away", [0.0, 1e2, 5e6, -3e9])
def test_places_are_told_apart_however_far_they_are(away, tmp_path, capsys):
    """As in coordinates of maps: a box of size 20 is told to four digits of its size."""
    ball = samples.sphere(2, radius=10.0)
    shape = TriangleMesh(ball.vertices + np.array([away, 2.0 * away, 0.0]), ball.faces)
    shape.save(tmp_path / "far.ply")
    assert main(["info", str(tmp_path / "far.ply")]) == 0
    rows = [line.split()[1:] for line in capsys.readouterr().out.splitlines() if line[:5] in ("lower", "upper")]
    pattern = r"box from \((.*)\) to \((.*)\),"
    texts = [text.split(", ") for text in re.search(pattern, repr(complete(shape))).groups()]
    for corners in (rows, texts):
        assert np.abs(np.array(corners, dtype=float) - shape.bounds).max() <= 20 * 0.5e-3
    grid = Grid.around(shape.bounds, resolution=9)
    origin = re.search(r"origin=\[(.*?)\]", repr(grid)).group(1).split(", ")
    assert np.abs(np.array(origin, dtype=float) - grid.origin).max() <= 28 * 0.5e-3
