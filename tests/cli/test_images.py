"""Images with turned axes, which `volume` writes, can be inspected, contoured and looked at."""

import json

import numpy as np
import pytest

import signedheat as sh
from signedheat.cli import main
from signedheat.io.image_files import write_nrrd

CENTER, RADIUS = np.array([12.0, 10.0, 8.0]), 6.0
TURN = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]]) * [-1, 1, 1]
ORIGIN = np.array([10.0, -5.0, 3.0])


@pytest.fixture
def mask(tmp_path):
    """A ball of voxels with the label 3, and one voxel with another, on axes that are turned and mirrored."""
    labels = np.zeros((25, 21, 17), dtype=np.uint8)
    labels[np.linalg.norm(np.moveaxis(np.indices(labels.shape), 0, -1) - CENTER, axis=-1) < RADIUS] = 3
    labels[0, 0, 0] = 1
    path = tmp_path / "mask.nrrd"
    write_nrrd(path, labels, TURN, ORIGIN, "left-posterior-superior")
    return path


def test_info_lists_labels_and_tells_where_the_image_is(mask, capsys):
    assert main(["info", str(mask), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "image of labels" and told["labels"] == [0, 1, 3]
    assert sum(told["voxels"]) == 25 * 21 * 17 and told["space"] == "left-posterior-superior"
    assert np.allclose(np.reshape(told["axes"], (3, 3)).T, TURN) and told["origin"] == ORIGIN.tolist()


def test_fields_of_images_are_contoured_in_the_world(mask, tmp_path, capsys):
    field = str(tmp_path / "distance.nrrd")
    assert main(["volume", str(mask), "--label", "3", "-o", field]) == 0
    assert main(["info", field, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["kind"] == "image of a field"
    assert main(["contour", field, "2", "-o", str(tmp_path / "grown.stl")]) == 0
    surface = sh.read(tmp_path / "grown.stl")
    away = np.linalg.norm(surface.vertices - (ORIGIN + TURN @ CENTER), axis=1)
    assert away == pytest.approx(RADIUS + 2, abs=1.0)  # voxels: half a diagonal
    assert surface.to_trimesh().volume > 0  # outside is outside, though the axes are mirrored


def test_masks_and_fields_of_images_are_looked_at(mask, tmp_path):
    for name in ("mask.png", "mask.pdf"):
        assert main(["view", str(mask), "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 3000


def test_damaged_images_are_refused(tmp_path, capsys):
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\nnothing\n")
    assert main(["info", str(tmp_path / "bad.nrrd")]) == 1
    assert "bad.nrrd" in capsys.readouterr().err


def test_nifti(mask, tmp_path, capsys):
    pytest.importorskip("nibabel")
    field = str(tmp_path / "distance.nii.gz")
    assert main(["volume", str(mask), "--label", "3", "-o", field]) == 0
    capsys.readouterr()
    assert main(["info", field, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["space"] == "right-anterior-superior"
