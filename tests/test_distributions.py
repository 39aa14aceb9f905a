"""The wheel and the source distribution: what is in them, and that the first lines of the README run after them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from importlib.metadata import version as version_of
from pathlib import Path

import pytest

import signedheat as sh
from signedheat import compiled

pytest.importorskip("hatchling")
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder with a wheel and a source distribution, as `make dist` builds them."""
    folder = tmp_path_factory.mktemp("dist")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", str(folder)], cwd=ROOT, check=True)
    return folder


def test_the_wheel_has_the_package_and_nothing_else(built):
    [wheel] = built.glob("*.whl")
    assert wheel.name.startswith(f"signedheat-{sh.__version__}-py3-none-any")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    source = ROOT / "src"
    files = {path.relative_to(source).as_posix() for path in source.glob("signedheat/**/*") if path.is_file()}
    assert names == {name for name in files if "__pycache__" not in name}


def test_the_source_distribution_has_what_the_documents_and_tests_need(built):
    [archive] = built.glob("*.tar.gz")
    top = f"signedheat-{sh.__version__}/"
    with tarfile.open(archive) as packed:
        names = {name.removeprefix(top) for name in packed.getnames()}
    wanted = {
        "README.md",
        "CHANGELOG.md",
        "LICENSE",
        "Makefile",
        "pyproject.toml",
        "docs/quickstart.md",
        "tests/conftest.py",
    }
    assert wanted <= names
    assert not [name for name in names if "__pycache__" in name or name.startswith((".venv", "dist/"))]


@pytest.mark.slow  # it compiles everything, and asks the package index
def test_a_wheel_with_kernels_compiles_nothing_in_a_fresh_environment(tmp_path):
    if compiled._kind_of_code() is None:
        pytest.skip("this processor does not run what wheels carry, or other code is asked for")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, env={**os.environ, "SIGNEDHEAT_KERNELS": "1"})
    [wheel] = tmp_path.glob("*.whl")
    assert "-none-any" not in wheel.name
    venv.create(tmp_path / "fresh", with_pip=True)
    programs = tmp_path / "fresh" / ("Scripts" if sys.platform == "win32" else "bin")
    numba = f"numba=={version_of('numba')}"  # kernels are for the version that compiled them
    install = [str(programs / "python"), "-m", "pip", "install", "--quiet", "--prefer-binary", str(wheel), numba]
    subprocess.run([*install, "matplotlib"], check=True)
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}

    def told(cache: Path, *arguments: str, **more: str) -> str:
        command = [str(programs / "signedheat"), *arguments]
        done = subprocess.run(
            command,
            cwd=tmp_path,
            env={**environment, "NUMBA_CACHE_DIR": str(cache), **more},
            stderr=subprocess.PIPE,
            text=True,
            check=True,
        )
        return done.stderr

    assert "compiling" not in told(tmp_path / "kernels", "demo", "--output", "demo")
    (tmp_path / "file").touch()
    assert "compiling" not in told(tmp_path / "file", "info", "demo/duck.stl")  # this folder cannot be written to
    assert "compiling" in told(tmp_path / "kernels", "info", "demo/duck.stl", NUMBA_CPU_NAME="generic")


@pytest.mark.slow  # it asks the package index
@pytest.mark.parametrize("kind", ["*.whl", "*.tar.gz"], ids=["wheel", "sdist"])
def test_first_lines_of_the_readme_run_in_a_fresh_environment(built, kind, tmp_path):
    [package] = built.glob(kind)
    venv.create(tmp_path / "fresh", with_pip=True)
    programs = tmp_path / "fresh" / ("Scripts" if sys.platform == "win32" else "bin")
    away = {"PYTHONPATH", "PYTHONHOME"}
    environment = {key: value for key, value in os.environ.items() if key not in away}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path / "kernels")

    def run(*command: str) -> None:
        subprocess.run([str(programs / command[0]), *command[1:]], cwd=tmp_path, env=environment, check=True)

    run("python", "-m", "pip", "install", "--quiet", "--prefer-binary", str(package))
    run("python", "-c", "import signedheat as sh; sh.samples.broken_duck().save('broken.stl')")
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    [code, *_] = re.findall(r"```python\n(.*?)```", text, re.S)
    run("python", "-c", f"{code}\nassert sh.__version__ == {sh.__version__!r} and sh.read('shell.stl').is_watertight")
    run("signedheat", "info", "broken.stl")
    assert (tmp_path / "whole.stl").stat().st_size > 1000
