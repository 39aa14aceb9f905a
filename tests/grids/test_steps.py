"""Single steps on grids, on input so small that their results are known."""

from __future__ import annotations

import numpy as np

from signedheat.grids.marching import level_lines
from signedheat.grids.multilevel import coarsening, wavefronts
from signedheat.grids.redistancing import smoothed_signs


def test_a_level_line_ends_at_the_box():
    [(points, closed)] = level_lines(np.array([[0.0] * 3, [1.0] * 3]), np.ones(2), 0.5)
    assert points.tolist() == [[0.5, 2.0], [0.5, 1.0], [0.5, 0.0]] and not closed


def test_a_short_axis_is_coarsened_to_one_node():
    assert coarsening((1, 64, 64, 3), np.array([0.0, 1.0, 1.0, 0.5])).tolist() == [1, 2, 2, 4]


def test_tiles_of_one_wave_do_not_depend_on_each_other():
    assert wavefronts((4, 2), [2, 2], (1, -1)) == [[[0, 2, 1, 1, -1, -1]], [[2, 4, 1, 1, -1, -1]]]


def test_signs_are_smoothed_where_they_change():
    smooth = smoothed_signs(np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]))
    assert smooth.round(2).tolist() == [-0.6, -0.6, -0.4, 0.4, 0.6, 0.6]
