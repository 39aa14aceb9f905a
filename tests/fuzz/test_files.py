"""Files that are right are read; a short run of the fuzzer on damaged ones."""

from __future__ import annotations

import pytest

from fuzz.cases_files import KINDS
from fuzz.frame import families, run

CASES = 12


@pytest.mark.parametrize("kind", KINDS)
def test_files_that_are_right_are_read(tmp_path, kind):
    read, variants = KINDS[kind]
    for number, files in enumerate(variants()):
        (tmp_path / str(number)).mkdir()
        for name, data in files.items():
            (tmp_path / str(number) / name).write_bytes(data)
        assert read(tmp_path / str(number) / next(iter(files))) is not None


def test_a_short_run_on_damaged_files():
    names = [name for name in families() if name.startswith("files ")]
    assert len(names) == len(KINDS)
    tally = run(names, CASES, seed=1)
    assert not tally.failures, "\n".join(map(str, tally.failures))
    assert sum(sum(kinds.values()) for kinds in tally.counts.values()) == CASES * len(names)
    assert all(any(kind.startswith("refused") for kind in kinds) for kinds in tally.counts.values())
