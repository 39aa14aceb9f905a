"""Notes print in one line and are JSON."""

import dataclasses
import json

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples


def all_notes():
    ball = samples.sphere(2)
    damaged = samples.with_flipped_faces(samples.without_patches(samples.sphere(3), 3, 0.4), 0.2, seed=1)
    with pytest.warns(sh.errors.InexactWarning):
        pieces = sh.signed_distance([ball.path([0, 1])], ball)
    line = sh.Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
    return [
        *sh.complete(damaged).diagnostics.notes,
        *sh.complete(samples.union(box((0, 0, 0), (1, 1, 1)), box((0.5, 0, 0), (1.5, 1, 1)))).diagnostics.notes,
        *sh.complete(sh.PointCloud(ball.vertices)).diagnostics.notes,
        *sh.SignedHeatSolver(sh.Grid.around(ball.bounds, 12)).distance(ball).diagnostics.notes,
        *sh.signed_distance(line, resolution=12).diagnostics.notes,
        *pieces.diagnostics.notes,
        *sh.signed_distance(ball, sh.tetrahedralize(ball, resolution=6)).diagnostics.notes,
    ]


def test_notes_are_json_and_one_line():
    notes = all_notes()
    assert len({type(note) for note in notes}) > 5
    for note in notes:
        values = json.loads(json.dumps(dataclasses.asdict(note)))
        assert values == note.as_dict()
        assert str(note) and "\n" not in str(note) and "array(" not in repr(note)


def test_numbers_of_numpy_are_plain():
    note = sh.complete(samples.without_patches(samples.sphere(2), 2, 0.4)).diagnostics.notes[0]
    changed = dataclasses.replace(note, **{dataclasses.fields(note)[0].name: np.int64(3)})
    assert json.dumps(dataclasses.asdict(changed))


def test_diagnostics_can_be_compared():
    assert sh.results.Diagnostics() not in (sh.results.Diagnostics(), None)
    assert len({sh.results.Diagnostics(), sh.results.Diagnostics()}) == 2
