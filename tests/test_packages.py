"""Packages that are imported late, and what happens where they are missing."""

import ast
import copy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.cli import main
from signedheat.io import parsers
from signedheat.packages import REMEDIES, lazy_module, require
from signedheat.view import save_scene

SOURCES = sorted(set(Path(sh.__file__).parent.rglob("*.py")) - {Path(parsers.__file__)})
CUBE = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

USES = {
    "nibabel": lambda folder: sh.io.read_labels(folder / "labels.nii"),
    "torch": lambda folder: sh.torch.distance(sh.complete(CUBE), [[0, 0, 0]]),
    "trimesh": lambda folder: CUBE.to_trimesh(),
    "meshio": lambda folder: CUBE.to_meshio(),
    "pyvista": lambda folder: CUBE.to_pyvista(),
    "matplotlib": lambda folder: save_scene(CUBE, folder / "scene.png"),
    "skimage": lambda folder: sh.Field(sh.Grid([0, 0], 1, [3, 3]), np.eye(3) - 0.5).contour(0.0),
}
"""What needs each package that may be missing."""

FILES = {
    "ball.dae": "collada",
    "ball.e57": "pye57",
    "ball.las": "laspy",
    "ball.mesh": "meshio",
    "ball.step": "OCP",
    "ball.vtk": "meshio",
}
"""Files of shapes, and the package that reads them."""


@pytest.fixture
def folder(tmp_path):
    for name in ("labels.nii", *FILES):
        (tmp_path / name).write_bytes(b"anything but empty")
    return tmp_path


def block(monkeypatch, package):
    """Let a package be missing, whether it is installed or not."""
    for name in [name for name in sys.modules if name == package or name.startswith(f"{package}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)


@pytest.mark.parametrize("package", USES)
def test_a_missing_package_is_named_with_its_remedy(monkeypatch, folder, package):
    block(monkeypatch, package)
    with pytest.raises(sh.errors.MissingPackageError) as caught:
        USES[package](folder)
    message = str(caught.value)
    assert f" {package}," in message
    assert message.endswith(REMEDIES.get(package, f"pip install {package}"))
    assert "\n" not in message


@pytest.mark.parametrize(("name", "package"), FILES.items())
def test_a_file_whose_reader_is_missing_is_not_called_damaged(monkeypatch, folder, name, package, capsys):
    block(monkeypatch, package)
    with pytest.raises(sh.errors.MissingPackageError):
        sh.read(folder / name)
    assert main(["info", str(folder / name)]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_pictures_are_refused_before_anything_is_computed(monkeypatch, folder, capsys):
    block(monkeypatch, "matplotlib")
    sh.save(CUBE, folder / "cube.stl")
    arguments = ["volume", str(folder / "cube.stl"), "-o", str(folder / "phi.npz"), "--preview", str(folder / "p.png")]
    assert main(arguments) == 1
    assert "pip install matplotlib" in capsys.readouterr().err
    assert not (folder / "phi.npz").exists()


@pytest.mark.usefixtures("coarse_duck")
def test_the_demo_without_pictures_makes_the_rest(monkeypatch, tmp_path, capsys):
    block(monkeypatch, "matplotlib")
    assert main(["demo", "-o", str(tmp_path), "--resolution", "12"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"duck.stl", "distance.vti", "offset.stl"}
    assert "pip install matplotlib" in capsys.readouterr().err


def test_a_missing_package_is_bad_input_and_an_import_error():
    with pytest.raises(ImportError) as caught:
        require("no_such_package", "tests")
    assert isinstance(caught.value, sh.errors.SignedHeatError)
    assert isinstance(caught.value.__cause__, ModuleNotFoundError)


def test_a_package_that_is_there_and_broken_says_why(monkeypatch, tmp_path):
    (tmp_path / "broken_package.py").write_text("import its_own_requirement\n")
    monkeypatch.syspath_prepend(tmp_path)
    with refused(sh.errors.MissingPackageError, "broken_package"):
        require("broken_package", "tests")


def test_a_handle_imports_nothing_until_something_is_asked_of_it(monkeypatch):
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    handle = lazy_module("colorsys", "tests")
    copy.copy(handle), repr(handle), hasattr(handle, "__wrapped__")
    assert "colorsys" not in sys.modules
    assert handle.rgb_to_hsv is sys.modules["colorsys"].rgb_to_hsv
    with pytest.raises(AttributeError):
        handle.no_such_function  # noqa: B018


def test_importing_the_package_leaves_out_what_only_some_use():
    late = ("matplotlib", "meshio", "nibabel", "numba", "pyvista", "scipy.fft", "scipy.ndimage", "scipy.optimize",
            "scipy.spatial", "skimage", "trimesh")  # fmt: skip
    code = (
        "import signedheat.public, signedheat.cli.operands, sys\n"
        f"print([name for name in {late} if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_other_packages_are_imported_at_the_top_or_through_handles(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    top = {id(node) for node in tree.body}
    for node in tree.body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            top |= {id(inner) for inner in node.body}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in top:
            named = getattr(node, "module", None) or node.names[0].name
            inside = isinstance(node, ast.ImportFrom) and node.level > 0
            assert inside or named.partition(".")[0] in sys.stdlib_module_names, f"{path}:{node.lineno}: {named}"
