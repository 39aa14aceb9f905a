"""Batches on a Dask cluster: a scheduler and a worker in processes of their own."""

import json
import os
import subprocess
import sys
import time

import pytest

import signedheat as sh
from batch_jobs import measure

pytest.importorskip("distributed")


@pytest.fixture
def cluster(tmp_path):
    """The address of a scheduler with one Dask worker, which has a nanny, as workers usually do."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    told = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    options = ["--scheduler-file", str(told)]
    quiet = {"env": environment, "cwd": tmp_path, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    ports = ["--port", "0", "--no-dashboard", "--host", "127.0.0.1"]
    scheduler = subprocess.Popen([*dask, "scheduler", *ports, *options], **quiet)
    worker = subprocess.Popen([*dask, "worker", "--nthreads", "2", "--no-dashboard", *options], **quiet)
    deadline = time.monotonic() + 60
    try:
        while not told.exists() or not told.read_text():
            assert time.monotonic() < deadline and scheduler.poll() is None
            time.sleep(0.1)
        yield json.loads(told.read_text())["address"]
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait(30)


def test_a_cluster_does_what_processes_do(tmp_path, cluster):
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a", "bug", "killed", "slow", "z"):
        (folder / f"{name}.ply").write_text(f"this is {name}")
    batch = sh.batches.run(folder, tmp_path / "out", measure, scheduler=cluster, time_limit=2)
    assert [outcome.state for outcome in batch.outcomes] == ["done", "failed", "died", "timed out", "done"]
    assert (tmp_path / "out" / "z.txt").read_text() == "this is z"
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith(".")]
    assert sh.batches.run(folder, tmp_path / "out", measure, scheduler=cluster, time_limit=2).skipped == 2


def test_without_a_scheduler_the_batch_says_so(tmp_path):
    (tmp_path / "a.ply").write_text("")
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.batches.run(tmp_path / "a.ply", tmp_path / "out", measure, scheduler="tcp://127.0.0.1:9")
    assert "dask scheduler" in caught.value.remedy
