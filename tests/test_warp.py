"""The example of docs/performance.md: a solid's mesh in Warp, on its CPU device."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples

pytest.importorskip("warp")
PAGE = Path(__file__).parents[1] / "docs/performance.md"


def test_signs_and_distances_are_ours(tmp_path):
    (code,) = re.findall(r"```py\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    path = tmp_path / "by_warp.py"  # Warp reads kernels from their file
    path.write_text(code, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("by_warp", path)
    by_warp = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(by_warp)
    shapes = [samples.without_faces(samples.sphere(3), 0.1), samples.torus(0.8, 0.3, 24, 12)]
    solids = [sh.complete(shape) for shape in shapes]
    meshes = [by_warp.mesh_of(solid) for solid in solids]
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (10_000, 3))
    for solid, mesh in zip(solids, meshes, strict=True):
        found, expected = by_warp.distance(mesh, points), solid.distance(points)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
        clear = np.abs(expected) > 1e-6
        assert ((found < 0) == (expected < 0))[clear].all()
