"""Files that are right are read; a short run of the fuzzer on damaged ones."""

from __future__ import annotations

import sys

import pytest

from fuzz.cases_files import KINDS
from fuzz.forked import forked
from fuzz.frame import families, run
from signedheat import SignedHeatError

CASES = 8


@pytest.mark.usefixtures("forked_parsers")
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


@pytest.mark.skipif(sys.platform != "linux", reason="parsers are forked on Linux alone")
def test_parsers_that_are_forked_say_what_those_that_are_started_say(tmp_path):
    read, variants = KINDS["labels"]
    path, data = tmp_path / "labels.nii.gz", next(f["labels.nii.gz"] for f in variants() if "labels.nii.gz" in f)

    def said(part):
        path.write_bytes(part)
        try:
            return repr(read(path))
        except SignedHeatError as error:
            return str(error)

    parts = data, data[:-9], data[:20], b""
    started = [said(part) for part in parts]
    with forked():
        assert [said(part) for part in parts] == started
    assert len(set(started)) > 2
