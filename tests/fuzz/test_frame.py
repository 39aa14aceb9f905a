"""The fuzzer's frame tells every kind of failure, and the same case again."""

from __future__ import annotations

import pytest

from fuzz.frame import families, run, run_case

EXPECTED = {
    "right": {"fine"},
    "refused": {"refused (GeometryError)"},
    "wrong": {"changed input"},
    "exception": {"KeyError"},
    "warning": {"RuntimeWarning"},
    "hang": {"hang"},
    "busy": {"hang"},
    "crash": {"crash"},
    "memory": {"memory"},
}


@pytest.fixture(scope="module")
def tally():
    return run([f"frame {name}" for name in EXPECTED], cases=1, limit=0.2)


@pytest.mark.parametrize("name", EXPECTED)
def test_every_kind_of_end_is_told(tally, name):
    assert set(tally.counts[f"frame {name}"]) == EXPECTED[name]
    failed = {outcome.family for outcome in tally.failures}
    assert (f"frame {name}" in failed) == (name not in ("right", "refused"))
    assert sum(tally.counts[f"frame {name}"].values()) == 1


def test_workers_know_families_whose_checks_are_partial():
    assert set(run(["frame right"], cases=1).counts["frame right"]) == EXPECTED["right"]


def test_a_case_comes_again_by_its_seed(tally):
    once = next(outcome for outcome in tally.failures if outcome.family == "frame wrong")
    again = run_case(families()["frame wrong"], once.seed, once.number)
    assert (again.kind, again.about) == (once.kind, once.about)
    assert run_case(families()["frame wrong"], once.seed, once.number + 7).about != once.about
