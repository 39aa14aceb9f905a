"""3MF packages: objects, components, builds, units, and packages that mean harm."""

import json
import zipfile

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main
from signedheat.io.scenes import unit_of

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r0" '
    'Target="/{}" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)


def mesh_xml(mesh):
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces.tolist())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def model(resources, build="", unit='unit="inch"'):
    spaces = f'xmlns="{CORE}" xmlns:p="{PRODUCTION}"'
    return f"<model {unit} {spaces}><resources>{resources}</resources><build>{build}</build></model>"


def package(path, parts, root="3D/3dmodel.model"):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("_rels/.rels", RELATIONS.format(root))
        for name, text in parts.items():
            file.writestr(name, text)
    return path


@pytest.fixture(scope="module")
def ball():
    return samples.sphere(2)


def test_items_components_and_other_parts_are_placed(tmp_path, ball):
    other = model(f'<object id="7">{mesh_xml(ball)}</object>')
    mirrored = "-1 0 0 0 1 0 0 0 1 5 0 0"
    components = f'<component objectid="7" p:path="/3D/other.model" transform="{mirrored}"/><component objectid="1"/>'
    resources = f'<object id="1">{mesh_xml(ball)}</object><object id="2"><components>{components}</components></object>'
    build = '<item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 0 1"/><item objectid="1"/>'
    path = package(tmp_path / "two.3mf", {"3D/a.model": model(resources, build), "3D/other.model": other}, "3D/a.model")
    mesh = sh.read(path)
    n = ball.n_vertices
    assert mesh.n_vertices == 3 * n and mesh.n_faces == 3 * ball.n_faces
    first, second, third = mesh.vertices[:n], mesh.vertices[n : 2 * n], mesh.vertices[2 * n :]
    np.testing.assert_allclose(first, (ball.vertices * [-1, 1, 1] + [5, 0, 0]) * 2 + [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(second, ball.vertices * 2 + [0, 0, 1], atol=1e-12)
    np.testing.assert_array_equal(third, ball.vertices)
    bodies = mesh.vertices[mesh.faces]
    volumes = np.einsum("ij,ij->i", np.cross(bodies[:, 0], bodies[:, 1]), bodies[:, 2]).reshape(3, -1).sum(axis=1)
    assert (volumes > 0).all()  # what is mirrored keeps its outside
    assert unit_of(path) == "inch"


def test_without_a_build_all_meshes_are_there(tmp_path, ball):
    path = package(
        tmp_path / "a.3mf", {"3D/3dmodel.model": model(f'<object id="1">{mesh_xml(ball)}</object>', unit="")}
    )
    np.testing.assert_array_equal(sh.read(path).vertices, ball.vertices)
    assert unit_of(path) == "millimeter"


def test_packages_of_trimesh(tmp_path, ball):
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("lxml")
    pytest.importorskip("networkx")
    path = tmp_path / "ball.3mf"
    trimesh.Scene([ball.to_trimesh()]).export(path)
    np.testing.assert_allclose(sh.read(path).vertices, ball.vertices, atol=1e-6)


def test_units_on_the_command_line(tmp_path, ball, capsys):
    build = '<item objectid="1"/>'
    path = package(tmp_path / "a.3mf", {"3D/3dmodel.model": model(f'<object id="1">{mesh_xml(ball)}</object>', build)})
    output = tmp_path / "grown.ply"
    assert main(["offset", str(path), "5", "-o", str(output), "--units", "mm", "--resolution", "32", "--quiet"]) == 0
    assert np.linalg.norm(sh.read(output).vertices, axis=1).mean() == pytest.approx(25.4 + 5, rel=0.01)
    assert main(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["units"] == "inch"
    ball.save(tmp_path / "ball.stl")
    arguments = ["offset", str(tmp_path / "ball.stl"), "5", "-o", str(output), "--resolution", "32"]
    assert main([*arguments, "--units", "mm"]) == 0
    assert "ball.stl" in capsys.readouterr().err
    assert np.linalg.norm(sh.read(output).vertices, axis=1).mean() == pytest.approx(6, rel=0.01)
    assert main([*arguments, "--units", "cm:mm", "--quiet"]) == 0
    assert np.linalg.norm(sh.read(output).vertices, axis=1).mean() == pytest.approx(15, rel=0.01)
    assert main([*arguments, "--units", "parsec"]) == 2


def test_units_of_drawings(tmp_path):
    """Lengths and distances of a square a centimetre wide are those of ten millimetres; it is moved by no matrix."""
    path, output = tmp_path / "square.csv", tmp_path / "square.npz"
    path.write_text("0,0\n1,0\n1,1\n0,1\n0,0\n")
    arguments = ["volume", str(path), "-o", str(output), "--resolution", "8", "--quiet"]
    assert main(arguments) == 0
    inner = sh.read_field(output).values.min()
    assert main([*arguments, "--units", "cm:mm"]) == 0
    assert sh.read_field(output).values.min() == pytest.approx(10 * inner)
    assert main([*arguments, "--transform", *"1 0 0 0 0 1 0 0 0 0 1 0".split()]) == 1


def test_transforms_on_the_command_line(tmp_path, ball, capsys):
    ball.save(tmp_path / "ball.ply")
    matrix = "-2 0 0 7\n0 2 0 0\n0 0 2 0\n0 0 0 1\n"
    (tmp_path / "matrix.txt").write_text(matrix)
    outputs = []
    for name, words in (
        ("file", [str(tmp_path / "matrix.txt")]),
        ("words", matrix.split()),
        ("rows", matrix.split()[:12]),
    ):
        output = tmp_path / f"{name}.npz"
        arguments = ["volume", str(tmp_path / "ball.ply"), "-o", str(output), "--resolution", "24", "--json"]
        assert main([*arguments, "--transform", *words]) == 0
        note = json.loads(capsys.readouterr().out)["notes"].get("shape_oriented", {"turned_faces": 0})
        assert note["turned_faces"] == 0  # mirrored, and still outside out
        outputs.append(sh.read_field(output))
    assert all((field.values == outputs[0].values).all() for field in outputs)
    assert outputs[0]([[7.0, 0, 0]])[0] == pytest.approx(-2, abs=0.3)
    for wrong in (["1", "2"], ["a"] * 16, [str(tmp_path / "nowhere.txt")], ["0"] * 12):
        assert main(["volume", str(tmp_path / "ball.ply"), "-o", str(output), "--transform", *wrong]) == 1
        assert capsys.readouterr().err.count("\n") == 1


def bomb():
    layers = "".join(
        f'<object id="{k + 1}"><components>' + f'<component objectid="{k}"/>' * 10 + "</components></object>"
        for k in range(1, 25)
    )
    return model(f'<object id="1">{mesh_xml(samples.sphere(1))}</object>{layers}', '<item objectid="25"/>')


DAMAGED = {
    "no package": b"nothing of a package",
    "no model": {"other.txt": "x"},
    "no mesh": {"3D/3dmodel.model": model("")},
    "missing object": {"3D/3dmodel.model": model("", '<item objectid="4"/>')},
    "missing vertex": {
        "3D/3dmodel.model": model(
            '<object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/></vertices><triangles>'
            '<triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>',
            '<item objectid="1"/>',
        )
    },
    "circle": {
        "3D/3dmodel.model": model(
            '<object id="1"><components><component objectid="1"/></components></object>', '<item objectid="1"/>'
        )
    },
    "components in components": {"3D/3dmodel.model": bomb()},
    "entities": {"3D/3dmodel.model": '<!DOCTYPE m [<!ENTITY a "b">]>' + model("")},
    "short transform": {
        "3D/3dmodel.model": model(
            f'<object id="1">{mesh_xml(samples.sphere(0))}</object>', '<item objectid="1" transform="1 2"/>'
        )
    },
    "no number": {
        "3D/3dmodel.model": model(
            '<object id="1"><mesh><vertices><vertex x="one" y="0" z="0"/></vertices></mesh></object>',
            '<item objectid="1"/>',
        )
    },
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_packages_are_refused(tmp_path, kind):
    path, what = tmp_path / "bad.3mf", DAMAGED[kind]
    if isinstance(what, bytes):
        path.write_bytes(what)
    else:
        package(path, what)
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.read(path)
    assert caught.value.path == str(path)
