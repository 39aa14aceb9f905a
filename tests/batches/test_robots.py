"""Robots: the meshes that a URDF refers to, with their scales, as shapes of a batch."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.batches.inputs import expand
from signedheat.cli import main
from signedheat.shapes.inspection import inspect

ROBOT = """<robot name="arm">
  <link name="base">
    <visual><geometry><mesh filename="meshes/ball.stl"/></geometry></visual>
    <collision>
      <geometry><mesh filename="package://arm_description/meshes/ball.stl" scale="0.5 0.5 0.5"/></geometry>
    </collision>
  </link>
  <link name="hand">
    <visual><geometry><mesh filename="meshes/ball.stl" scale="1 1 1"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/cup.stl" scale="2 1 1"/></geometry></visual>
    <visual><geometry><box size="1 1 1"/></geometry></visual>
  </link>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    folder = tmp_path / "arm_description"
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    samples.sphere(3).save(folder / "meshes" / "ball.stl")
    samples.without_faces(samples.sphere(3), 0.1).save(folder / "meshes" / "cup.stl")
    path = folder / "arm.urdf"
    path.write_text(ROBOT)
    return path


def test_each_mesh_is_listed_once_with_each_scale(robot):
    found = [(shape.path.name, shape.name, shape.scale) for shape in expand([robot])]
    assert found == [
        ("ball.stl", "arm/ball", (1.0, 1.0, 1.0)),
        ("ball.stl", "arm/ball_x0.5", (0.5, 0.5, 0.5)),
        ("cup.stl", "arm/cup_x2_1_1", (2.0, 1.0, 1.0)),
    ]
    with_folder = expand([robot.parent])
    assert {shape.name for shape in with_folder} >= {"arm/ball_x0.5", "arm/cup_x2_1_1", "meshes/ball", "meshes/cup"}


@pytest.mark.usefixtures("in_this_process")
def test_a_field_and_a_closed_mesh_of_each_mesh(robot, tmp_path, capsys):
    output = tmp_path / "out"
    command = [
        "batch",
        str(robot),
        "-o",
        str(output),
        "--volume",
        "--offset",
        "0",
        "--resolution",
        "24",
        "--workers",
        "1",
    ]
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["shapes"] == 3
    cup = sh.read_field(output / "arm" / "cup_x2_1_1.npz")
    assert cup([[2.5, 0, 0], [0, 0, 0]]) == pytest.approx([0.5, -1], abs=0.1)
    assert inspect(sh.read(output / "arm" / "cup_x2_1_1_+0.stl")).is_closed
    small = sh.read(output / "arm" / "ball_x0.5_+0.stl")
    assert np.linalg.norm(small.vertices, axis=1).max() == pytest.approx(0.5, abs=0.03)
    assert main(["watertight", str(robot), "-o", str(tmp_path / "closed"), "--workers", "1"]) == 0
    assert sh.complete(sh.read(tmp_path / "closed" / "arm" / "cup_x2_1_1.stl")).volume == pytest.approx(
        8 * np.pi / 3, rel=0.05
    )


@pytest.mark.parametrize(
    "text",
    ["<robot>", "<sdf/>", "<robot/>", '<robot><mesh filename="a.stl" scale="1 2"/></robot>', "<robot><mesh/></robot>"],
)
def test_descriptions_that_are_none(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with refused(sh.errors.FileFormatError, file="robot.urdf"):
        expand([path])


def test_a_mesh_that_is_not_there_fails_alone(robot, tmp_path):
    (robot.parent / "meshes" / "cup.stl").unlink()
    done = sh.batches.run(robot, tmp_path / "out", sh.batches.Job(info=True), workers=1)
    assert [outcome.state for outcome in done.outcomes] == ["done", "done", "failed"]
