"""What is released says the same everywhere: version and dependencies."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import pytest

import signedheat as sh

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "packaging" / "conda" / "recipe.yaml"


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tomllib is in Python 3.11")
def test_the_recipe_needs_what_the_wheel_needs():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {f"python {project['requires-python']}"}
    for dependency in project["dependencies"]:
        name, bound = re.match(r"([\w-]+)(>=[\w.]+)", dependency).groups()
        wanted.add(f"{name} {bound}")
    run = RECIPE.read_text(encoding="utf-8").partition("  run:\n")[2].partition("\n\n")[0]
    named = re.findall(r"^ +- (\S+ >=\S+)$", run, re.MULTILINE)
    assert set(named) == wanted and len(named) == len(wanted)


def test_one_version():
    assert f'version: "{sh.__version__}"' in RECIPE.read_text(encoding="utf-8")
    assert f"version: {sh.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## {re.escape(sh.__version__)}\b", changes, re.MULTILINE)


def long_description():
    """The module that makes the page of the project on a package index."""
    pytest.importorskip("hatchling")
    where = ROOT / "packaging" / "long_description.py"
    spec = importlib.util.spec_from_file_location("long_description", where)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("source", [None, "https://example.org/signedheat"])
def test_links_of_the_long_description_need_no_files(source):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    text = long_description().without_relative_links(readme, source)
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert all(target.startswith("https://") for target in targets)
    links = re.findall(r"\]\(([^)\s]+)\)", readme)
    assert len(targets) == (len(links) if source else sum(link.startswith("https://") for link in links))
    prose = re.sub(r"!?\[[^\]]*\]\([^)]*\)", "", text)
    assert {"make demo", "make test"} <= set(re.findall(r"make \w+", prose))


def test_the_long_description_keeps_labels_and_absolute_links():
    text = "a [page](docs/a.md#b), ![picture](docs/a.png) and [`x[i]`](docs/c.md), [elsewhere](https://a.org/b)"
    description = long_description()
    assert description.without_relative_links(text) == "a page,  and `x[i]`, [elsewhere](https://a.org/b)"
    absolute = description.without_relative_links(text, "https://a.org/")
    assert "![picture](https://a.org/docs/a.png)" in absolute and "[page](https://a.org/docs/a.md#b)" in absolute
