"""The floors of the package: what may import what, and what importing it may cost."""

from __future__ import annotations

import ast
import functools
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import signedheat
from import_graph import circles, import_graph, upward_imports

PACKAGE = Path(signedheat.__file__).parent

FLOORS = [
    {"arrays", "compiled", "diagnostics", "errors", "jobs", "memory", "packages", "parallel", "validation"},
    {"mesh"},
    {"search", "linear", "shapes.exchange", "fields.field_domain"},
    {"geodesics"},
    {"constraints", "linear.direct_integration", "discretization", "method"},
    {"surfaces", "grids", "tets", "fields", "shapes", "methods"},
    {"fields.sharpening", "solver"},
    {"curves", "solids"},
    {"distances", "morphology"},
    {"io", "torch"},
    {"view"},
    {"batches"},
    {"", "public", "results", "samples"},
    {"cli", "__main__"},
]
"""From the ground up: a module may import what is on its own floor or below. docs/architecture.md shows the same."""


@functools.cache
def graph():
    return import_graph(PACKAGE)


def homes_of_constants(package: Path) -> dict[str, set[str]]:
    """Modules that define each name in capitals, underscores before it aside; type variables are no constants."""
    homes: dict[str, set[str]] = {}
    for file in package.rglob("*.py"):
        for node in ast.parse(file.read_text()).body:
            if not isinstance(node, ast.Assign | ast.AnnAssign):
                continue
            if isinstance(node.value, ast.Call) and ast.unparse(node.value.func) in ("TypeVar", "ParamSpec"):
                continue
            for name in ast.walk(node):
                if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store) and name.id.isupper():
                    homes.setdefault(name.id.lstrip("_"), set()).add(file.relative_to(package).as_posix())
    return homes


def test_each_constant_is_defined_in_one_module():
    """So its name says what it is wherever it is read, and no number is given twice."""
    homes = homes_of_constants(PACKAGE)
    assert {name: sorted(modules) for name, modules in homes.items() if len(modules) > 1} == {}


SLOW_TO_IMPORT = ("numba", "matplotlib", "trimesh", "meshio", "skimage", "nibabel")


def test_no_object_is_changed_behind_its_back():
    """Only an object itself writes into its ``__dict__``."""
    written = re.compile(r"(?<!self)\.__dict__(\[[^]]*\] =|\.\w+\()|vars\((?!self)\w+\)\.(update|pop)\(")
    assert [file.name for file in PACKAGE.rglob("*.py") if written.search(file.read_text())] == []


def test_no_circle_of_imports():
    assert circles(graph()) == []


def test_few_files_lie_beside_the_rooms():
    assert len(list(PACKAGE.glob("*.py"))) <= 22


def test_imports_point_down():
    assert upward_imports(graph(), FLOORS) == []


SLICES = "surfaces", "grids", "tets"
SHAPES = {"surfaces.triangle_mesh", "surfaces.point_cloud"}
"""What contours are and what distance in space is measured to: the slices share them."""


def test_slices_do_not_import_each_other():
    between = {
        (module.removeprefix("signedheat."), imported.removeprefix("signedheat."))
        for module in graph()
        for imported in graph()[module]
        if module.split(".")[1:2] != imported.split(".")[1:2]
        if all(any(name.startswith(f"signedheat.{each}.") for each in SLICES) for name in (module, imported))
    }
    assert {pair for pair in between if pair[1] not in SHAPES} == set()


@pytest.mark.parametrize("folder", ["benchmarks", "blender", "examples", "shapes", "tools"])
def test_programs_around_the_package_find_what_they_import(folder):
    """Many of them need other programs and run by hand only."""
    absent = [
        f"{file.name}: {node.module}.{name.name}"
        for file in (PACKAGE.parents[1] / folder).rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "signedheat"
        for name in node.names
        if not hasattr(importlib.import_module(node.module), name.name)
    ]
    assert absent == []


def test_importing_the_package_leaves_slow_packages_alone():
    code = f"import signedheat.public, sys; print(*sorted(set({SLOW_TO_IMPORT!r}) & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_no_public_name_is_that_of_a_module():
    """Importing a submodule makes it an attribute of its package, in place of whatever had its name."""
    for name in ("signedheat", "signedheat.batches", "signedheat.io", "signedheat.view"):
        package = importlib.import_module(name)
        folder = Path(package.__file__).parent
        modules = {path.stem for path in folder.glob("*.py")} | {path.parent.name for path in folder.glob("*/*.py")}
        assert not modules & set(package.__all__), name


@pytest.mark.parametrize("step", [1, -1], ids=["forwards", "backwards"])
def test_public_names_are_the_same_whatever_is_imported_first(step):
    submodules = sorted(set(graph()) - {"signedheat", "signedheat.__main__"})[::step]
    code = f"""from importlib import import_module
import signedheat as sh
for name in {submodules!r}: import_module(name)
public = import_module("signedheat.public")
assert all(getattr(sh, name) is getattr(public, name) for name in public.__all__)
assert all(getattr(sh, module.__name__.rpartition(".")[2]) is module for module in public.MODULES)
print(*dir(sh))"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == dir(signedheat)


def test_looking_at_the_package_shows_its_public_names_and_nothing_else():
    code = "import signedheat as sh; print(*dir(sh)); print(callable(sh.signed_distance)); print(*dir(sh))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names, is_function, again = found.stdout.splitlines()
    public = importlib.import_module("signedheat.public")
    modules = {module.__name__.removeprefix("signedheat.") for module in public.MODULES}
    assert set(names.split()) == {*public.__all__, *modules, "__version__"}
    assert is_function == "True" and again == names
    assert {"SignedHeatError", "signed_distance"} <= set(signedheat.__all__)
    assert len([*public.__all__, *modules]) <= 50


def test_public_modules_show_their_public_names_and_nothing_else():
    for module in importlib.import_module("signedheat.public").MODULES:
        assert dir(module) == sorted(module.__all__), module.__name__
        assert all(hasattr(module, name) for name in module.__all__), module.__name__


@pytest.mark.parametrize("name", ["GeometryError", "Free", "Convex", "broken_duck"])
def test_a_name_of_a_public_module_is_said_to_be_there(name):
    with pytest.raises(AttributeError, match=rf"signedheat\.\w+\.{name}$"):
        getattr(signedheat, name)


@pytest.fixture
def package(tmp_path):
    """A package whose modules are given by their text."""

    def write(**modules: str) -> Path:
        for name, text in {"__init__": "", **modules}.items():
            path = tmp_path.joinpath("house", *name.split("__")) if name != "__init__" else tmp_path / "house/__init__"
            path.parent.mkdir(parents=True, exist_ok=True)
            (path.parent / "__init__.py").touch()
            path.with_suffix(".py").write_text(text)
        return tmp_path / "house"

    return write


@pytest.mark.parametrize(
    "line",
    [
        "from ..roof import tile",
        "from .. import roof",
        "import house.roof",
        "from house.roof import tile",
        "from house import roof",
        "def lazily():\n    from ..roof import tile",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..roof import tile",
    ],
)
def test_every_way_to_import_is_seen(package, line):
    graph = import_graph(package(cellar__wine=line, roof="from .cellar.wine import bottle"))
    assert graph["house.cellar.wine"] == {"house.roof"}
    assert circles(graph) == [["house.cellar.wine", "house.roof"]]
    assert upward_imports(graph, [{"cellar"}, {"roof", ""}]) == [("house.cellar.wine", "house.roof")]


def test_what_is_in_order_passes(package):
    graph = import_graph(package(cellar__wine="import numpy", cellar__beer="from .wine import x", roof="import house"))
    assert graph["house.cellar.beer"] == {"house.cellar.wine"} and graph["house.cellar.wine"] == set()
    assert circles(graph) == [] and upward_imports(graph, [{"cellar"}, {""}, {"roof"}]) == []


def test_constants_of_one_name_are_seen(package):
    house = package(
        cellar__wine="FLAT: float = 0.1\nDRY, SWEET = range(2)\nP = ParamSpec('P')",
        roof="from .cellar.wine import DRY\n_FLAT = {name: 0.2 for name in 'ab'}\nP = TypeVar('P')",
    )
    homes = {"FLAT": {"cellar/wine.py", "roof.py"}, "DRY": {"cellar/wine.py"}, "SWEET": {"cellar/wine.py"}}
    assert homes_of_constants(house) == homes


def test_a_folder_without_a_floor_is_refused(package):
    graph = import_graph(package(attic="from . import roof", roof=""))
    with pytest.raises(LookupError, match=r"house\.attic"):
        upward_imports(graph, [{""}, {"roof"}])
