"""Every example runs, gives the number it promises, and makes a picture."""

import importlib.util
from pathlib import Path

import matplotlib.image
import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
NEEDED = {"fit_to_distances": "torch"}
"""What `make test` does not install."""


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(tmp_path, path):
    if path.stem in NEEDED:
        pytest.importorskip(NEEDED[path.stem])
    specification = importlib.util.spec_from_file_location(path.stem, path)
    example = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(example)
    expected, tolerance = example.EXPECTED
    assert example.main(tmp_path) == pytest.approx(expected, abs=tolerance)
    assert matplotlib.image.imread(tmp_path / f"{path.stem}.png")[..., :3].std() > 0.05
