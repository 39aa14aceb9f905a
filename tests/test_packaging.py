"""What is released says the same everywhere: version and dependencies."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import signedheat as sh

ROOT = Path(__file__).parents[1]
RECIPE = ROOT / "packaging" / "conda" / "recipe.yaml"
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tomllib is in Python 3.11")
def test_the_recipe_needs_what_the_wheel_needs():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {f"python {project['requires-python']}"}
    for dependency in project["dependencies"]:
        name, bound = re.match(r"([\w-]+)(>=[\w.]+)", dependency).groups()
        wanted.add(f"{CONDA_NAMES.get(name, name)} {bound}")
    run = RECIPE.read_text(encoding="utf-8").partition("  run:\n")[2].partition("\n\n")[0]
    assert {line.strip()[2:] for line in run.splitlines()} == wanted


def test_one_version():
    assert f'version: "{sh.__version__}"' in RECIPE.read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## {re.escape(sh.__version__)}\b", changes, re.MULTILINE)
