"""``signedheat sample``, as a user meets it."""

import json

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.ply"
    samples.without_faces(samples.sphere(3, radius=2.0, center=(1, 0, 0)), 0.2).save(path)
    return str(path)


def test_samples_of_a_shape(tmp_path, ball, capsys):
    output = str(tmp_path / "ball.npz")
    options = ["-n", "2000", "--near", "0.5", "--widths", "0.1", "0.01", "--seed", "3"]
    assert main(["sample", ball, "-o", output, *options, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    same = sh.sample_distances(sh.read(ball), 2000, near=0.5, widths=[0.1, 0.01], seed=3)
    with np.load(output) as arrays:
        np.testing.assert_array_equal(arrays["points"], same.points)
        np.testing.assert_array_equal(arrays["distances"], same.distances)
    assert told["samples"] == 2000 and told["near"] == 1000
    assert told["center"] == pytest.approx([1, 0, 0], abs=0.05) and told["radius"] == pytest.approx(2.0, rel=0.03)


def test_deepsdf_layout_in_the_unit_sphere(tmp_path, ball, capsys):
    output = str(tmp_path / "ball.npz")
    arguments = ["sample", ball, "-o", output, "-n", "500", "--normalize", "--layout", "deepsdf"]
    assert main(arguments) == 0
    assert "500 points" in capsys.readouterr().out
    with np.load(output) as arrays:
        rows = np.concatenate([arrays["pos"], arrays["neg"]])
    assert rows.shape == (500, 4)
    # the completion may be off a cell
    assert np.abs(rows[:, 3] - (np.linalg.norm(rows[:, :3], axis=1) - 1)).max() < 0.13
