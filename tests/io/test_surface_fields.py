"""Fields on surfaces come back from files as they were written."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.cli import main

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]]
DOMAINS = {
    "triangles": samples.sphere(1),
    "polygons": sh.PolygonMesh(SQUARE, [[0, 1, 2, 3], [1, 4, 2]]),
    "points": sh.PointCloud(SQUARE),
}


@pytest.mark.parametrize("ending", ["npz", "ply", "vtp"])
@pytest.mark.parametrize("name", DOMAINS)
def test_values_and_vertices_come_back(tmp_path, name, ending):
    domain = DOMAINS[name]
    n = len(domain.points if name == "points" else domain.vertices)
    field = sh.Field(domain, np.random.default_rng(0).normal(size=n))
    field.save(tmp_path / f"phi.{ending}")
    back = sh.read_field(tmp_path / f"phi.{ending}")
    assert type(back.domain) is type(domain) and np.array_equal(back.values, field.values)


def test_clouds_come_back_with_what_their_triangles_are_made_of(tmp_path):
    cloud = sh.PointCloud(SQUARE, normals=5 * [[0, 0, 1]], areas=np.arange(1.0, 6), n_neighbors=4)
    sh.Field(cloud, np.zeros(5)).save(tmp_path / "phi.npz")
    back = sh.read_field(tmp_path / "phi.npz").domain
    assert back.n_neighbors == 4 and np.array_equal(back.normals, cloud.normals)
    assert np.array_equal(back.areas, cloud.areas)


@pytest.mark.parametrize("ending", ["ply", "vtp"])
def test_shapes_without_values_are_no_fields_but_are_looked_at(tmp_path, ending):
    path = tmp_path / f"ball.{ending}"
    samples.sphere(1).save(path)
    with refused(sh.errors.FileFormatError):
        sh.read_field(path)
    assert main(["view", str(path), "-o", str(tmp_path / "ball.png")]) == 0
