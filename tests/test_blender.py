"""The Blender add-on: what it writes and reads, with the command line; its operators, where Blender is there."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main

ROOT = Path(__file__).parents[1] / "blender"


def load(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"{name.replace('.', '/')}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


protocol = load("signedheat_blender.protocol")


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """The command line as one program."""
    path = tmp_path_factory.mktemp("bin") / "signedheat"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m signedheat "$@"\n')
    path.chmod(0o755)
    return str(path)


def holed():
    mesh = samples.without_patches(samples.sphere(3), 3, 0.4)
    return mesh, np.array(mesh.vertices), mesh.faces.tolist()


@pytest.mark.parametrize("distance", [0.0, -0.1])
def test_surfaces_are_closed_and_where_they_should_be(monkeypatch, distance):
    """With the command in this process: the next test runs the program."""
    monkeypatch.setattr(protocol, "run", lambda _, *words: main([*words, "--quiet"]))
    _, vertices, polygons = holed()
    places, triangles = protocol.surface_at("signedheat", vertices, polygons, distance, 48)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 1.0 + distance, atol=0.06)


@pytest.mark.skipif(sys.platform == "win32", reason="the program here is a shell's")
def test_fields_are_volumes(command, tmp_path):
    _, vertices, polygons = holed()
    protocol.field_of(command, vertices, polygons, 16, str(tmp_path / "ball.vdb"))
    assert (tmp_path / "ball.vdb").read_bytes().startswith(b" BDV")


def test_polygons_of_any_size_are_written(tmp_path):
    polygons = [[0, 1, 2, 3], [4, 5, 6], [0, 1, 2, 3, 4]]
    protocol.write_ply(tmp_path / "mesh.ply", np.arange(21.0).reshape(7, 3), polygons)
    mesh = sh.read(tmp_path / "mesh.ply")
    assert [face.tolist() for face in np.split(mesh.corners, mesh.offsets[1:-1])] == polygons


@pytest.mark.skipif(sys.platform == "win32", reason="the program here is a shell's")
def test_errors_are_those_of_the_command(command):
    with pytest.raises(protocol.CommandError, match="single point"):
        protocol.surface_at(command, np.zeros((3, 3)), [[0, 1, 2]], 0.0, 32)
    with pytest.raises(protocol.CommandError, match="preferences"):
        protocol.run("/nowhere/signedheat", "info")


def test_the_version_is_that_of_the_package():
    version = sh.__version__.replace("rc", "-rc.")  # as semantic versions are written
    assert f'version = "{version}"' in (ROOT / "signedheat_blender/blender_manifest.toml").read_text()


def test_operators(command, monkeypatch):
    bpy = pytest.importorskip("bpy")
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.setenv("SIGNEDHEAT", command)
    import signedheat_blender

    signedheat_blender.register()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(2, 0, 0))
    bpy.ops.object.signedheat_offset(distance=0.1, resolution=32)
    made = bpy.context.active_object
    assert made.name.endswith("offset") and len(made.data.polygons) > 100
    reach = [abs((vertex.co.x - 2) ** 2 + vertex.co.y**2 + vertex.co.z**2 - 1.21) for vertex in made.data.vertices]
    assert max(reach) < 0.05
    bpy.ops.object.signedheat_field(resolution=32)
    assert bpy.context.active_object.type == "VOLUME"
    signedheat_blender.unregister()
