"""Distance to what is there, with nothing completed: open surfaces, and networks of curves on surfaces."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.cli import main
from signedheat.search.face_tree import FaceTree


def skirt(n=48):
    """A cone without its two ends."""
    turn = 2 * np.pi * np.arange(n) / n
    rings = [(r * np.cos(turn), r * np.sin(turn), np.full(n, z)) for r, z in ((0.5, 0.0), (0.3, 0.6))]
    vertices = np.concatenate([np.stack(ring, axis=1) for ring in rings])
    low, after = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.stack([low, after, n + after], axis=1), np.stack([low, n + after, n + low], axis=1)])
    return sh.TriangleMesh(vertices, faces)


def test_distance_to_clothes_is_not_to_what_closes_them():
    mesh = skirt()
    cloth = sh.complete(mesh, completion="none")
    points = np.concatenate([[[0, 0, 0], [0, 0, 0.6]], np.random.default_rng(0).uniform(-1, 1, (500, 3))])
    exact = FaceTree.of_triangles(mesh.vertices[mesh.faces]).distances(points)
    assert exact[0] > 0.4  # in the middle of the hem
    assert cloth.distance(points) == pytest.approx(exact, abs=1e-15)
    assert not cloth.inside(points).any() and cloth.volume == 0
    field = sh.signed_distance(mesh, resolution=24, completion="none")
    assert field.values.min() >= 0
    assert field(points[:1]) == pytest.approx(exact[:1], abs=1e-12)
    assert cloth.closest(points).faces.min() >= 0
    again = samples.union(mesh, mesh)
    assert sh.complete(again, completion="none").distance(points) == pytest.approx(exact, abs=1e-15)


def test_a_ball_as_a_sheet_is_hollow():
    sheet = sh.complete(samples.sphere(3), completion="none")
    assert sheet.distance([[0, 0, 0], [2.0, 0, 0]]) == pytest.approx([1, 1], abs=0.02)


def network():
    """Roads with junctions in a square, and the distance of its vertices to them."""
    n = 33
    x, y = np.meshgrid(np.linspace(0, 4, n), np.linspace(0, 4, n), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + n, corner + n + 1], axis=1), np.stack([corner, corner + n + 1, corner + 1], axis=1)]
    )
    mesh = sh.TriangleMesh(vertices, faces)
    roads = [[(0.5, 2, 0), (3.5, 2, 0)], [(1.5, 2, 0), (1.5, 3.7, 0)], [(2.6, 0.3, 0), (2.6, 2, 0)]]
    away = []
    for a, b in np.array(roads):
        share = np.clip((vertices - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        away.append(np.linalg.norm(vertices - a - share[:, None] * (b - a), axis=1))
    return mesh, [mesh.polyline(road) for road in roads], np.min(away, axis=0)


def test_distance_to_a_network_of_roads():
    mesh, roads, exact = network()
    field = sh.signed_distance(roads, mesh, completion="none")
    assert field.values == pytest.approx(exact, abs=1e-3)
    backwards = [road.reversed() for road in roads[::-1]]
    assert sh.signed_distance(backwards, mesh, completion="none").values == pytest.approx(field.values, abs=1e-9)


@pytest.mark.parametrize(("end", "n"), [((0.0, -100.0), 20), ((0.0, -100.0), 200), ((400.0, 100.0), 50)])
def test_distance_to_lines_that_graze_vertices_is_not_negative(end, n):
    """Of a road over a hill, whose points are beside the mesh, so that it passes vertices within rounding."""
    sides = np.linspace(-500.0, 500.0, 21)
    plane = np.stack(np.meshgrid(sides, sides, indexing="ij"), axis=-1).reshape(-1, 2)

    def on_the_hill(points):
        return np.column_stack([points, 80.0 * np.exp(-(points**2).sum(axis=1) / 2e5)])

    first = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([np.add.outer(first, corners) for corners in ([0, 21, 22], [0, 22, 1])])
    hill = sh.TriangleMesh(on_the_hill(plane), faces)
    road = hill.polyline(on_the_hill(np.linspace((-400.0, -300.0), end, n)))
    assert sh.signed_distance(road, hill, completion="none").values.min() >= 0.0


def test_points_are_no_sheet():
    with refused(sh.errors.SourceError, element="completion"):
        sh.complete(sh.PointCloud(samples.sphere(2).vertices), completion="none")


def test_lines_in_the_plane():
    ends = np.random.default_rng(1).uniform(0, 4, (6, 2, 2))
    lines = [sh.Polyline(line) for line in ends]
    field = sh.signed_distance(lines, resolution=40, completion="none")
    away = []
    for a, b in ends:
        share = np.clip((field.domain.points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        away.append(np.linalg.norm(field.domain.points - a - share[..., None] * (b - a), axis=-1))
    assert field.values == pytest.approx(np.min(away, axis=0), abs=1e-12)
    nearest = field.closest([[0.0, 0.0], [2.0, 2.0]])
    assert not nearest.completed.any() and (nearest.distances >= 0).all()
    square = sh.Polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    assert sh.signed_distance(square, resolution=16, completion="none")([[0.5, 0.5]]) == pytest.approx([0.5])
    with refused(sh.errors.UnsupportedTypeError, element="fill"):
        sh.signed_distance(lines, completion="none", fill="evenodd")
    with refused(sh.errors.UnsupportedTypeError, element="source 0"):
        sh.signed_distance(sh.PointCloud(ends[0]), completion="none")


@pytest.mark.usefixtures("in_this_process")
def test_one_word_on_the_command_line(tmp_path, monkeypatch):
    """The same commands as for signed distance, with the same numbers as in Python."""
    monkeypatch.chdir(tmp_path)
    mesh, roads, exact = network()
    skirt().save("skirt.obj")
    mesh.save("land.obj")
    sh.io.write_curves(roads, "roads.json", mesh)
    line = sh.Polyline([[0.0, 0.0], [2.0, 0.0]])
    sh.io.write_polylines([line], "line.svg")
    for command in (
        "volume skirt.obj --resolution 16 -o cloth.npz",
        "surface land.obj roads.json -o along.npz",
        "volume line.svg --resolution 16 -o line.npz",
        "sample skirt.obj -n 200 -o points.npz",
        "offset skirt.obj 0.05 --resolution 24 -o shell.stl",
        "batch skirt.obj -o many --volume --resolution 16 --workers 1",
    ):
        assert main([*command.split(), "--unsigned"]) == 0
    cloth = sh.complete(skirt(), completion="none")
    for path in ("cloth.npz", "many/skirt.npz"):
        field = sh.read_field(path)
        assert field.values == pytest.approx(cloth.distance(field.domain.points), abs=1e-12)
    assert np.load("along.npz")["values"] == pytest.approx(exact, abs=1e-3)
    in_plane = sh.read_field("line.npz")
    assert in_plane.values == pytest.approx(sh.signed_distance(line, in_plane.domain, completion="none").values)
    assert np.load("points.npz")["distances"].min() >= 0
    around_rims = 0.5 * np.pi * 0.05**2 * 2 * np.pi * (0.5 + 0.3)  # half cylinders along hem and waist
    assert sh.complete(sh.read("shell.stl")).volume == pytest.approx(0.1 * skirt().area + around_rims, rel=0.03)


@pytest.mark.parametrize("option", ["--plain", "--lids flat", "--as-oriented", "--diffusion 2", "--nested bodies"])
def test_one_word_stands_alone(option, tmp_path, capsys):
    command = ["volume", "skirt.obj", "-o", str(tmp_path / "a.npz"), "--unsigned", *option.split()]
    assert main(command) == 2
    assert "do not go together" in capsys.readouterr().err
