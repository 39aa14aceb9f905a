"""Every example runs, measures what it should, and makes a picture."""

import runpy
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

FOLDER = Path(__file__).parent.parent / "examples"
NEEDED = {"fit_to_distances": "torch"}
"""What `make test` does not install."""
EXPECTED = {
    "booleans_of_fields": (2 * np.pi / 3 * 0.75**2 * (3 - 0.75), 0.06),
    "broken_letter": (8.5, 0.1),
    "clothes_and_roads": (1.0, 0.002),
    "coastline": (1.0, 0.08),
    "completion_and_diffusion": (0.705, 0.02),
    "confidence": (1.0, 0.01),
    "constraints": (0.0, 0.05),
    "curve_across_polygons": (0.5 * np.pi, 0.08),
    "curve_design": (0.15, 0.051),
    "curve_distance": (0.0, 0.002),
    "curve_on_a_point_cloud": (0.5 * np.pi - np.arcsin(0.4), 0.03),
    "deepsdf_set": (0.0, 0.002),
    "deviation_of_a_scan": (-0.086, 0.003),
    "distance_from_points": (np.pi / 2, 0.03),
    "distance_on_bad_triangles": (0.0, 3e-3),
    "distance_on_tets": (1.5, 0.03),
    "distance_on_voxels": (0.0, 0.01),
    "distance_round_corners": (3.297, 0.08),
    "distance_that_jumps": (2 * np.pi * 0.4, 0.08),
    "files_in_and_out": (25.4 * 1.1, 0.1),
    "filled_holes": (1.0, 0.01),
    "fine_band": (0.0, 0.15),
    "fit_to_distances": (0.01, 0.01),
    "flipped_faces": (0.0, 0.005),
    "flipped_strokes": (0.0, 0.03),
    "floor_plan": (8.64341649025257, 0.001),
    "grid_of_your_own": (0.3, 0.02),
    "grow_and_shrink": (-0.1, 0.01),
    "hollow_model": (1.0, 0.08),
    "intrinsic_triangles": (20.0, 11.0),
    "made_solid": (1.0, 0.01),
    "mask_and_back": (1.0, 0.0),
    "offset_of_a_broken_sphere": (1.2, 0.01),
    "open_sheets": (1.0, 0.0),
    "overlapping_bodies": (-np.sqrt(0.75), 0.02),
    "points_without_normals": (2 * np.pi**2 * 0.4**2, 0.12),
    "print_shell": (2 * np.pi * 0.12 - np.pi * 0.2**2 * 0.12, 0.06),
    "relief_with_a_base": (1.0, 1e-9),
    "robot_clearance": (0.0, 0.01),
    "robot_meshes": (1.0, 0.02),
    "rounding_a_drawing": (1.0, 0.02),
    "sections_and_cuts": (1.0, 0.01),
    "shapes_of_other_packages": (0.0, 1e-12),
    "sharp_contours": (0.0, 1e-9),
    "sharpened_distance": (0.0, 0.05),
    "shortest_paths": (1.0, 0.001),
    "smooth_blends": (0.125, 0.01),
    "surface_from_points": (2 * np.pi**2 * 1.0 * 0.4**2, 0.06),
    "terrain_from_contours": (2.5, 0.35),
    "thin_plates": (0.0, 0.004),
    "toolpaths": (0.12 - 0.03 / np.sqrt(2), 0.005),
    "wall_distance": (0.5, 0.01),
    "wall_thickness": (0.1, 0.005),
    "watertight_scan": (1.0, 0.06),
}
"""What each measures at its end, and by how much it may be off."""


def test_every_example_is_expected_to_measure_something():
    assert set(EXPECTED) == {path.stem for path in FOLDER.glob("*.py")}


@pytest.mark.usefixtures("small_pictures")
@pytest.mark.parametrize("name", EXPECTED)
def test_example(tmp_path, monkeypatch, name):
    if name in NEEDED:
        pytest.importorskip(NEEDED[name])
    monkeypatch.chdir(tmp_path)
    measured = runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")["measured"]
    expected, tolerance = EXPECTED[name]
    assert measured == pytest.approx(expected, abs=tolerance)
    assert matplotlib.image.imread(tmp_path / f"{name}.png")[..., :3].std() > 0.05
