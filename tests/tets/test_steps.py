"""Single steps on tets, on input so small that their results are known."""

from __future__ import annotations

import numpy as np

from signedheat.tets.tet_discretization import memory_estimate, uphill_roots


def test_steepest_ascent_along_a_chain_leads_to_its_highest_tet():
    chain = np.array([[1, -1, -1, -1], [0, 2, -1, -1], [1, -1, -1, -1]])
    assert uphill_roots(np.array([3.0, 2.0, 1.0]), chain, np.array([True, False, False])).tolist() == [0, 0, 0]


def test_half_a_million_tets_take_a_gigabyte():
    assert 0.9e9 < memory_estimate(580_000) < 1.1e9
