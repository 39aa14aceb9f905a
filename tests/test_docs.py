"""The documents: links lead somewhere, code blocks run, and the picture of the floors shows those that there are."""

from __future__ import annotations

import functools
import importlib.util
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import signedheat
from public_names import PUBLIC, methods, properties
from signedheat.io import shape_files as shapes

ROOT = Path(__file__).parents[1]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")])
INDEX = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
TOCTREE = re.findall(
    r"^[\w/-]+$", "\n".join(re.findall(r"```\{toctree\}\n(?::[^\n]*\n)*\n(.*?)```", INDEX, re.S)), re.M
)
EXTENDING = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
SECTIONS = re.findall(r"^## (.+?)$(.*?)(?=^## |\Z)", EXTENDING, re.M | re.S)
BLOCKS = [(title, block) for title, text in SECTIONS for block in re.findall(r"```python\n(.*?)```", text, re.S)]


def anchors(page: Path) -> set[str]:
    """Names under which the headings of a page can be linked."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        linked = (page.parent / path).resolve() if path else page
        if path.startswith("gallery/"):  # made from the examples by `make docs`
            name = path.removeprefix("gallery/")
            linked = ROOT / "examples" / ("README.rst" if name == "index" else f"{name}.py")
        assert linked.exists(), f"{page.name} links to {target}, which does not exist"
        assert not anchor or anchor in anchors(linked), f"{page.name} links to {target}, which is no heading there"


def test_every_page_is_in_the_contents():
    pages = {page.stem for page in [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*.rst")]} - {
        "index",
        "sg_execution_times",
    }
    assert sorted(TOCTREE) == sorted([*pages, "gallery/index"])


def test_every_public_name_is_in_the_reference():
    listed = re.findall(r"^   ([\w.]+)$", (ROOT / "docs" / "api.rst").read_text(encoding="utf-8"), re.M)
    assert {name for name, _ in PUBLIC} <= set(listed)
    assert len(listed) == len(set(listed))


@pytest.mark.usefixtures("small_pictures", "coarse_duck")
@pytest.mark.parametrize("name", ["quickstart", "tutorial", "recipes", "domains"])
def test_code_of_pages_runs_from_top_to_bottom(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert blocks
    exec(compile("\n".join(blocks), f"docs/{name}.md", "exec", dont_inherit=True), {"__name__": "__main__"})


COMING = (ROOT / "docs" / "coming-from.md").read_text(encoding="utf-8")
ROWS = [row.replace("\\|", "|") for row in re.findall(r"^\| .* \| `([^`]*)` \|$", COMING, re.M)]


@functools.cache
def before_rows():
    names: dict[str, object] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", COMING, re.S)), names)
    return names


def test_thirty_verbs_of_other_packages_are_there():
    rows = re.findall(r"^\| (?!there|---)(.*?) \| `", COMING, re.M)
    assert len(rows) == len(ROWS) >= 30


@pytest.mark.filterwarnings("ignore::signedheat.errors.InexactWarning")  # on a coarse grid
@pytest.mark.parametrize("row", sorted(set(ROWS)))
def test_rows_for_users_of_other_packages_run(row, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = dict(before_rows())
    names["mesh"].save("part.stl")
    assert eval(row, names) is not None or row.startswith("mesh.save")


def test_extending_has_an_example_of_each_kind():
    assert {title for title, _ in BLOCKS} == {
        "A domain",
        "A source",
        "A constraint",
        "A file format",
        "A linear solver",
    }


@pytest.mark.parametrize("block", [block for _, block in BLOCKS], ids=[title for title, _ in BLOCKS])
def test_examples_of_extending_run(block, monkeypatch):
    monkeypatch.setattr(shapes, "READERS", dict(shapes.READERS))
    monkeypatch.setattr(shapes, "WRITERS", dict(shapes.WRITERS))
    exec(compile(block, "docs/extending.md", "exec", dont_inherit=True), {"__name__": "__main__"})


def module_of_docs(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_example_has_a_card_of_one_trade():
    cards = module_of_docs("gallery_cards")
    named = [name for names in cards.TRADES.values() for name in names.split()]
    assert sorted(named) == sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
    assert cards.FIRST_PANEL <= set(named)


def test_cards_show_one_panel_without_title_and_colour_bar():
    picture = np.full((120, 400, 3), 255, np.uint8)
    picture[5:12, 20:90] = 0  # a title
    picture[20:110, 10:110] = (200, 0, 0)
    picture[20:110, 150:250] = (0, 0, 200)
    picture[20:110, 300:310] = (0, 200, 0)  # a colour bar
    picture[20:110:20, 314:322] = 0  # its numbers
    panel = module_of_docs("gallery_cards").panel
    assert panel(picture, True).shape == (90, 100, 3) and (panel(picture, True) == (200, 0, 0)).all()
    assert panel(picture, False).shape == (90, 100, 3) and (panel(picture, False) == (0, 0, 200)).all()


def test_picture_of_the_floors_shows_all_of_them():
    drawing = module_of_docs("draw_architecture")
    drawn = [name for names, _, _ in drawing.FLOORS for name in names.split()]
    package = Path(signedheat.__file__).parent
    floors = {path.stem for path in package.glob("*.py")} | {path.parent.name for path in package.glob("*/__init__.py")}
    assert sorted(drawn) == sorted(floors - {"__init__"})


@pytest.mark.parametrize("thing", [thing for _, thing in PUBLIC], ids=[name for name, _ in PUBLIC])
def test_docstrings_hold_no_substitutions(thing):
    """Docutils takes |x| outside of literals for a substitution, of which there is none."""
    text = re.sub(r"``.*?``|`.*?`", "", thing.__doc__ or "")
    assert not re.search(r"\|[^\s|][^|\n]*[^\s|]\||\|[^\s|]\|", text)


CALLABLE = [(name, thing) for name, thing in PUBLIC if inspect.isroutine(thing)]
KNOWN = {name for name, _ in [*PUBLIC, *methods()]}


@pytest.mark.parametrize(("name", "thing"), [*PUBLIC, *methods()], ids=[name for name, _ in [*PUBLIC, *methods()]])
def test_docstrings_say_what_else_to_look_at(name, thing):
    found = re.search(r"^See Also\n-+\n(.*?)(?:\n\n|\Z)", inspect.getdoc(thing) or "", re.M | re.S)
    assert found, f"{name} has no section See Also"
    targets = [line.partition(" : ")[0] for line in found[1].splitlines()]
    assert targets and set(targets) <= KNOWN - {name}


QUANTITIES = re.compile(
    r"(^|[._])(distance|length|area|volume|angle|spacing|thickness|offset|deviation)s?($|[._])", re.IGNORECASE
)
WITHOUT_UNITS = {"io.read_volume", "results.Deviation.worst"}  # an image, and ids of points
MEASURED = [
    (name, thing)
    for name, thing in [*PUBLIC, *methods(), *properties()]
    if QUANTITIES.search(name) and name not in WITHOUT_UNITS
]


@pytest.mark.parametrize(("name", "thing"), MEASURED, ids=[name for name, _ in MEASURED])
def test_docstrings_of_quantities_state_their_units(name, thing):
    assert re.search(r"\bunits?\b|degrees|radians", (inspect.getdoc(thing) or "").partition("\nExamples\n")[0]), name


@pytest.mark.parametrize(("name", "function"), CALLABLE, ids=[name for name, _ in CALLABLE])
def test_functions_say_what_they_take_and_return(name, function):
    says_what_it_takes_and_returns(name, function)


@pytest.mark.parametrize(("name", "method"), methods(), ids=[name for name, _ in methods()])
def test_methods_say_what_they_take_and_return(name, method):
    """`make docs` checks that each has an anchor."""
    says_what_it_takes_and_returns(name, method)


def says_what_it_takes_and_returns(name, function):
    """Assert that a docstring describes each parameter and the result, with an example."""
    text, signature = inspect.getdoc(function) or "", inspect.signature(function)
    sections = re.findall(r"^(\w+)\n-+$", text, re.M)
    parameters = [parameter for parameter in signature.parameters if parameter != "self"]
    described = re.findall(r"^\*{0,2}(\w[^:\n]*?) : ", text, re.M) + re.findall(r"^\*(\w+) : ", text, re.M)
    assert set(parameters) <= {word for names in described for word in names.split(", ")}, name
    assert "Examples" in sections and len(sections) == len(set(sections)), name
    assert "Returns" in sections or signature.return_annotation in ("None", "NoReturn"), name
