"""STEP: solids as Open CASCADE writes them."""

import re

import numpy as np
import pytest

import signedheat as sh
from refusals import refused


@pytest.fixture
def drilled(tmp_path):
    """A box of 4 × 3 × 2 with a hole of radius 1/2 through its height."""
    pytest.importorskip("OCP")
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    block = BRepPrimAPI_MakeBox(4.0, 3.0, 2.0).Shape()
    drill = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(1.0, 1.5, 0.0), gp_Dir(0.0, 0.0, 1.0)), 0.5, 2.0).Shape()
    writer = STEPControl_Writer()
    writer.Transfer(BRepAlgoAPI_Cut(block, drill).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "drilled.step"))
    return tmp_path / "drilled.step"


@pytest.mark.usefixtures("forked_parsers")
def test_faces_of_the_part(drilled):
    mesh, owners = sh.io.read_step(drilled, deflection=0.002)
    assert len(owners) == mesh.n_faces and len(np.unique(owners)) == 7
    solid = sh.complete(mesh)
    assert not solid.diagnostics.notes or all("complet" not in str(note) for note in solid.diagnostics.notes)
    points = np.array([[3.0, 1.5, 1.0], [1.0, 1.5, 1.0], [3.0, 1.5, 5.0]])
    np.testing.assert_allclose(solid.distance(points), [-1.0, 0.5, 3.0], atol=0.002)
    on = solid.closest([[1.4, 1.5, 1.0], [1.0, 1.9, 0.7], [3.0, 1.5, 5.0]]).faces
    assert owners[on[0]] == owners[on[1]] != owners[on[2]]


@pytest.mark.usefixtures("forked_parsers")
def test_as_any_shape(drilled):
    mesh = sh.read(drilled)
    assert isinstance(mesh, sh.TriangleMesh)
    assert sh.complete(mesh).inside([[3.0, 1.5, 1.0]]).all()


def test_entities_that_are_damaged_do_not_end_the_process(drilled):
    """Open CASCADE crashed at a direction whose number was lost, or which was of another kind."""
    data = drilled.read_bytes()
    [first, *_] = re.findall(rb"#\d+ ?= ?VECTOR", data)
    for damaged in (b"?" + first[1:], first.replace(b"VECTOR", b"ORIENTED_EDGE")):
        drilled.write_bytes(data.replace(first, damaged))
        try:
            assert sh.read(drilled).n_faces
        except sh.errors.SignedHeatError as error:
            assert error.path == str(drilled)


@pytest.mark.usefixtures("forked_parsers")
def test_what_is_no_step_file_is_refused(tmp_path, capfd):
    pytest.importorskip("OCP")
    (tmp_path / "part.step").write_text("solid part\n")
    with refused(sh.errors.FileFormatError):
        sh.read(tmp_path / "part.step")
    assert capfd.readouterr().out == ""
