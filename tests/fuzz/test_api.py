"""A short run of the fuzzer on shapes, sources, constraints, arguments and commands; `make fuzz` is the long one."""

from __future__ import annotations

import pytest

from fuzz.frame import families, run_case

KINDS = "surface ", "space ", "same ", "far ", "touching ", "arguments", "commands"
FAMILIES = sorted(name for name in families() if name.startswith(KINDS))
CASES, OF_ARGUMENTS = 12, 24
"""Of each family; of arguments, most of which are refused, more."""


@pytest.mark.parametrize("name", FAMILIES)
def test_a_short_run(name):
    outcomes = [
        run_case(families()[name], 5, number) for number in range(OF_ARGUMENTS if name == "arguments" else CASES)
    ]
    assert [str(outcome) for outcome in outcomes if outcome.failed] == []
    assert any(not outcome.kind.startswith("refused") for outcome in outcomes)
