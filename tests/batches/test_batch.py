"""Many shapes: whatever happens to one of them, the others are done, and the manifest says so."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import signedheat as sh
from batch_jobs import Here, Text, counted, measure
from refusals import refused
from signedheat import samples
from signedheat.batches import pool
from signedheat.batches.inputs import expand
from signedheat.batches.manifest import Manifest
from signedheat.batches.pool import Worker


@pytest.fixture
def files(tmp_path):
    """A function that makes files, of which it returns the folder."""

    def make(*names):
        for name in names:
            path = tmp_path / "in" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"this is {name}")
        return tmp_path / "in"

    return make


def lines(folder):
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]


def test_whatever_happens_to_one_the_others_are_done(tmp_path, files):
    names = ["a", "bug", "crashed", "killed", "loud", "slow", "wrong", "z"]
    folder = files(*(f"{name}.ply" for name in names))
    reports = []
    batch = sh.batches.run(
        folder, tmp_path / "out", measure, workers=2, time_limit=2, report=lambda each: reports.append(each.name)
    )
    states = {outcome.name: outcome.state for outcome in batch.outcomes}
    assert states == {
        "a": "done",
        "bug": "failed",
        "crashed": "died",
        "killed": "died",
        "loud": "done",
        "slow": "timed out",
        "wrong": "failed",
        "z": "done",
    }
    assert sorted(reports) == names
    assert {each.name for each in batch.failures} == {"bug", "crashed", "killed", "slow", "wrong"}
    own = (folder / "killed.own").read_text()  # the folder that it had for kernels
    assert "signedheat-" in own and not os.path.lexists(own)
    told = {line["name"]: line for line in lines(tmp_path / "out")}
    assert list(told) == names
    assert told["wrong"]["message"] == "there is no face: add one"
    assert "KeyError" in told["bug"]["message"] and "killed" in told["killed"]["message"]
    assert "status 3" in told["crashed"]["message"] and "2 s" in told["slow"]["message"]
    assert told["a"]["outputs"] == ["a.begun", "a.txt"] and told["a"]["figures"] == {"length": len("this is a.ply")}
    assert told["a"]["message"] == "this is known" and told["a"]["seconds"] >= 0
    present = {path.name for path in (tmp_path / "out").iterdir()}
    assert present == {"manifest.jsonl", *(f"{name}.{end}" for name in ("a", "loud", "z") for end in ("begun", "txt"))}


@pytest.mark.usefixtures("in_this_process")
def test_a_restart_does_what_is_not_done_yet(tmp_path, files):
    folder, out = files("a.ply", "b.ply", "c.ply"), tmp_path / "out"
    first = sh.batches.run(folder, out, measure, workers=1)
    assert first.skipped == 0 and not first.failures
    before = {name: (out / f"{name}.txt").stat().st_mtime_ns for name in "abc"}
    (out / "a.txt").unlink()
    (folder / "b.ply").write_text("other")
    (folder / "new.ply").write_text("new")
    second = sh.batches.run(folder, out, measure, workers=1)
    assert second.skipped == 1 and [each.name for each in second.outcomes] == ["a", "b", "c", "new"]
    assert (out / "c.txt").stat().st_mtime_ns == before["c"]
    assert (out / "b.txt").read_text() == "other" and (out / "a.txt").exists() and (out / "new.txt").exists()
    assert len(lines(out)) == 4
    text = (out / "manifest.jsonl").read_text()
    (out / "manifest.jsonl").write_text(text[: len(text) - 40])  # as the end of a run may leave it
    assert sh.batches.run(folder, out, measure, workers=1).skipped == 3


@pytest.mark.usefixtures("in_this_process")
def test_another_job_does_everything_again(tmp_path):
    samples.sphere(2).save(tmp_path / "ball.ply")
    out = tmp_path / "out"
    job = sh.batches.Job(volume=".npz", resolution=16)
    assert sh.batches.run(tmp_path / "ball.ply", out, job, workers=1).skipped == 0
    assert sh.batches.run(tmp_path / "ball.ply", out, job, workers=1).skipped == 1
    finer = sh.batches.Job(volume=".npz", resolution=20)
    assert sh.batches.run(tmp_path / "ball.ply", out, finer, workers=1).skipped == 0
    assert max(sh.read_field(out / "ball.npz").domain.shape) == 20


@pytest.mark.usefixtures("in_this_process")
def test_methods_of_other_objects_are_other_jobs(tmp_path, files):
    folder = files("a.ply")
    for text, skipped in (("one", 0), ("one", 1), ("two", 0)):
        batch = sh.batches.run(folder, tmp_path / "out", Text(text).write, workers=1)
        assert batch.skipped == skipped and (tmp_path / "out" / "a.txt").read_text() == text


def test_what_was_short_of_memory_is_tried_again_alone(tmp_path, files):
    folder = files("a.ply", "hungry.ply", "z.ply")
    batch = sh.batches.run(folder, tmp_path / "out", measure, workers=2)
    assert [outcome.state for outcome in batch.outcomes] == ["done"] * 3


def test_a_process_that_dies_before_it_gets_a_shape_is_replaced(tmp_path, files, monkeypatch):
    start, started = Worker._started, []

    def dying_first(worker):
        started.append(start(worker))
        if len(started) == 1:
            started[0].kill()
        return started[-1]

    monkeypatch.setattr(Worker, "_started", dying_first)
    batch = sh.batches.run(files("a.ply", "z.ply"), tmp_path / "out", measure, workers=1)
    assert [outcome.state for outcome in batch.outcomes] == ["done", "done"] and len(started) == 2


def test_results_do_not_depend_on_the_number_of_workers(tmp_path):
    """Nor on the process: this one, and two workers."""
    for k in range(2):
        samples.without_faces(samples.sphere(1, radius=1 + k), 0.2, seed=k).save(tmp_path / f"in{k}.ply")
    sampling = sh.batches.Sampling(n=300, normalize=True)
    job = sh.batches.Job(volume=".npy", offsets=(0.1, -0.1), samples=sampling, info=True, resolution=16)
    one, two = tmp_path / "one", tmp_path / "two"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "Worker", Here)
        sh.batches.run(str(tmp_path / "in*.ply"), one, job, workers=1)
    batch = sh.batches.run(str(tmp_path / "in*.ply"), two, job, workers=2)
    names = sorted(path.name for path in one.iterdir())
    assert names == sorted(path.name for path in two.iterdir())
    for name in names:
        if name != "manifest.jsonl":
            assert (one / name).read_bytes() == (two / name).read_bytes()
    figures = batch.outcomes[1].figures
    assert figures["surfaces"][0]["distance"] == 0.1 and figures["samples"]["samples"] == 300
    assert figures["info"]["kind"] == "TriangleMesh" and figures["field"]["notes"]["shape_oriented"]
    field = sh.signed_distance(sh.read(tmp_path / "in1.ply"), sh.read_field(one / "in1.npy").domain)
    np.testing.assert_array_equal(sh.read_field(one / "in1.npy").values, field.values)


@pytest.mark.usefixtures("in_this_process")
def test_killing_the_whole_batch_loses_only_what_was_under_way(tmp_path, files):
    folder, out = files("a.ply", "b.ply", "slow.ply"), tmp_path / "out"
    code = (
        "import signedheat as sh\nfrom batch_jobs import Here, counted, measure\n"
        f"sh.batches.run({str(folder)!r}, {str(out)!r}, measure, workers=1)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    process = subprocess.Popen([sys.executable, "-c", code], env=environment)
    deadline = time.monotonic() + 60
    while not (out / "manifest.jsonl").exists() or len(lines(out)) < 2:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    workers = children(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    while any(is_running(worker) for worker in workers):  # workers end with the process that they work for
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert [line["state"] for line in lines(out)] == ["done", "done"]
    (folder / "slow.ply").rename(folder / "quick.ply")
    batch = sh.batches.run(folder, out, measure, workers=1)
    assert batch.skipped == 2 and not batch.failures
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def children(number):
    found = []
    for status in os.listdir("/proc"):
        if status.isdigit():
            try:
                with open(f"/proc/{status}/stat") as file:
                    parent = int(file.read().rpartition(")")[2].split()[1])
            except OSError:
                continue
            if parent == number:
                found.append(int(status))
    return found


def is_running(number):
    try:
        with open(f"/proc/{number}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.usefixtures("in_this_process")
def test_progress_estimates_and_stops(tmp_path, files):
    folder, heard = files("a.ply", "b.ply", "c.ply"), []

    def progress(fraction, text):
        heard.append((fraction, text))
        if fraction > 0.5:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        sh.batches.run(folder, tmp_path / "out", measure, workers=1, progress=progress)
    assert [fraction for fraction, _ in heard] == pytest.approx([0, 1 / 3, 2 / 3])
    assert heard[1][1].startswith("1 of 3 shapes, about ")
    assert len(lines(tmp_path / "out")) == 2


def test_links_that_lead_nowhere_are_told(tmp_path, files):
    folder = files("a.ply", "b.ply")
    (folder / "lost.ply").symlink_to(tmp_path / "not there.ply")
    for inputs in (folder, str(folder / "*.ply")):
        assert [each.name for each in expand([inputs], tmp_path / "out")] == ["a", "b", "lost"]


def test_names_follow_files(tmp_path, files):
    folder = files("a.ply", "parts/a.ply", "parts/b.stl", "parts/b.obj", "parts/deep/c.v2.off", "notes.txt")
    out = folder / "out"
    (out).mkdir()
    (out / "old.ply").write_text("result of a run before")
    named = {str(each.path.relative_to(folder)): each.name for each in expand([folder], out)}
    assert named == {
        "a.ply": "a",
        "parts/a.ply": "parts/a",
        "parts/b.obj": "parts/b.obj",
        "parts/b.stl": "parts/b.stl",
        "parts/deep/c.v2.off": "parts/deep/c.v2",
    }
    patterns = expand([f"{folder}/**/a.ply", f"{folder}/parts/*.stl", folder / "a.ply"], out)
    assert [each.name for each in patterns] == ["a", "parts/a", "b"]
    twins = expand([folder / "a.ply", folder / "parts" / "a.ply"], out)
    assert sorted(each.name for each in twins) == ["a.ply", "parts/a.ply"]


def test_what_is_no_batch_says_so(tmp_path, files, monkeypatch):
    folder = files("a.ply")
    with pytest.raises(sh.errors.FileFormatError):
        sh.batches.run(str(tmp_path / "*.nothing"), tmp_path / "out", measure)
    (tmp_path / "empty").mkdir()
    with pytest.raises(sh.errors.FileFormatError):
        sh.batches.run(tmp_path / "empty", tmp_path / "out", measure)
    with pytest.raises(sh.errors.SignedHeatError) as caught:
        sh.batches.run(folder, tmp_path / "out", lambda path, stem: {})
    assert "module" in caught.value.remedy
    for job in (None, {"volume": ".npz"}, os.path.getsize, lambda path: {}):
        with pytest.raises(sh.errors.SignedHeatError):
            sh.batches.run(folder, tmp_path / "out", job)
    ball = sh.samples.sphere(1)
    for inputs, results in ((ball, "out"), ([ball], "out"), (folder, ball), ([3], "out")):
        with pytest.raises(sh.errors.UnsupportedTypeError):
            sh.batches.run(inputs, tmp_path / results if results == "out" else results, measure)
    with pytest.raises(sh.errors.SignedHeatError):
        sh.batches.run(folder, tmp_path / "out", measure, workers=0)
    with pytest.raises(sh.errors.SignedHeatError):
        sh.batches.run(folder, folder / "a.ply" / "out", measure)
    with pytest.raises(sh.errors.SignedHeatError):
        sh.batches.Job()
    with pytest.raises(sh.errors.SignedHeatError):
        sh.batches.Job(samples=sh.batches.Sampling(), plain=True)
    assert sh.batches.Job(offsets=0.5).offsets == (0.5,)
    for odd in (
        {"offsets": ("a",)}, {"offsets": (np.nan,)}, {"offsets": 1.0, "band": "x"}, {"volume": "npz"},
        {"offsets": 1.0, "surfaces": "stl"}, {"samples": 100},
    ):  # fmt: skip
        with pytest.raises(sh.errors.SignedHeatError):
            sh.batches.Job(**odd)
    for wrong in ({"volume": ".nrrd"}, {"offsets": (0.2,)}, {"info": True, "plain": True}):
        with pytest.raises(sh.errors.SignedHeatError):
            sh.batches.Job(band=0.1, **wrong)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if not path.endswith("tests")])
    unknown = sh.batches.run(folder, tmp_path / "other", measure, workers=1)
    assert unknown.failures[0].state == "failed" and "batch_jobs" in unknown.failures[0].message
    missing = sh.batches.run(folder / "missing.ply", tmp_path / "out", sh.batches.Job(info=True), workers=1)
    assert missing.failures[0].state == "failed" and "no such file" in missing.failures[0].message


@pytest.mark.parametrize("odd", [0, -1, 1.5, np.nan, "two", 10**6])
@pytest.mark.parametrize("name", ["workers", "threads"])
def test_odd_numbers_of_workers(tmp_path, name, odd):
    with refused(sh.errors.SignedHeatError, name):
        sh.batches.run("shape.stl", tmp_path / "made", sh.batches.Job(info=True), **{name: odd})
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("odd", [0, -1, np.nan, np.inf, "long", 1e30])
def test_odd_time_limits(tmp_path, odd):
    with refused(sh.errors.SignedHeatError, "time_limit"):
        sh.batches.run("shape.stl", tmp_path / "made", sh.batches.Job(info=True), time_limit=odd)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("name", ["new\nline", "separator\u2028", "next\x85", "quote\"'", "-dash", "\udcff"])
@pytest.mark.usefixtures("in_this_process")
def test_odd_names_are_one_line_of_the_manifest(tmp_path, files, name):
    try:
        folder = files(f"{name}.ply")
    except (OSError, UnicodeError):
        pytest.skip("this system has no such names")
    assert [each.name for each in sh.batches.run(folder, tmp_path / "out", measure, workers=1).outcomes] == [name]
    assert [line["name"] for line in lines(tmp_path / "out")] == [name]
    assert sh.batches.run(folder, tmp_path / "out", measure, workers=1).skipped == 1


def test_results_stay_in_their_folder(tmp_path, files, monkeypatch):
    """Whatever the names of files, and however patterns lead out of the folder that they begin in."""
    files("..ply", "...ply", "a.ply", "deep/a.ply")
    (tmp_path / "in" / "other").mkdir()
    monkeypatch.chdir(tmp_path / "in" / "deep")
    given = ["../..ply", "../...ply", "a.ply", "../a.ply"]
    named = [each.name for each in expand(given, tmp_path / "out")]
    assert named == ["..ply", "...ply", "deep/a", "a"] or named == ["..ply", "...ply", "deep/a.ply", "a.ply"]
    monkeypatch.chdir(tmp_path)
    inner = expand(["in/*/../../in/deep/*.ply"], tmp_path / "out")
    assert [each.name for each in inner] == ["a"]


def test_links_that_run_in_circles_give_every_file_once(tmp_path, files):
    """With two links, patterns would be followed 2⁴⁰ times."""
    folder = files("a.ply", "b/c.ply")
    for name in ("again", "b/up", "once more"):
        (folder / name).symlink_to(folder)
    (folder / "itself.ply").symlink_to("itself.ply")
    for given in (folder, f"{folder}/**/*.ply", f"{folder}/**"):
        found = {os.path.realpath(each.path) for each in expand([given], tmp_path / "out")}
        assert {f"{folder}/a.ply", f"{folder}/b/c.ply"} <= found and len(found) == 3
        assert len(expand([given], tmp_path / "out")) == 3


@pytest.mark.usefixtures("in_this_process")
def test_results_among_the_shapes_are_refused(tmp_path, files):
    folder = files("a.ply")
    for target in (folder, tmp_path):
        with refused(sh.errors.FileFormatError):
            sh.batches.run(folder, target, measure, workers=1)
    with refused(sh.errors.FileFormatError):
        sh.batches.run(folder, folder / "a.ply", measure, workers=1)
    assert sh.batches.run(folder, folder / "out", measure, workers=1).outcomes[0].is_done


@pytest.mark.usefixtures("in_this_process")
def test_a_folder_is_written_by_one_batch_at_a_time(tmp_path, files):
    folder, out = files("a.ply", "b.ply"), tmp_path / "out"

    def second(outcome):
        with refused(sh.errors.SignedHeatError):
            sh.batches.run(folder, out, measure, workers=1)

    assert not sh.batches.run(folder, out, measure, workers=1, report=second).failures
    assert len(lines(out)) == 2


def test_shapes_whose_results_would_have_one_name_are_refused(tmp_path, files):
    folder = files("a.ply", "a_samples.stl")
    job = sh.batches.Job(volume=".npz", samples=sh.batches.Sampling(n=10), resolution=16)
    with refused(sh.errors.FileFormatError):
        sh.batches.run(folder, tmp_path / "out", job, workers=1)


@pytest.mark.parametrize("odd", ["folder", "pipe"])
def test_what_has_the_name_of_the_manifest_is_refused(tmp_path, files, odd):
    (tmp_path / "out").mkdir()
    place = tmp_path / "out" / "manifest.jsonl"
    place.mkdir() if odd == "folder" else os.mkfifo(place)
    with refused(sh.errors.FileFormatError):
        sh.batches.run(files("a.ply"), tmp_path / "out", measure, workers=1)


@pytest.mark.usefixtures("in_this_process")
def test_damaged_manifests_are_begun_anew(tmp_path, files):
    folder, out = files("a.ply"), tmp_path / "out"
    sh.batches.run(folder, out, measure, workers=1)
    good = lines(out)[0]
    odd = [{**good, "outputs": [1]}, {**good, "name": ["a"]}, {**good, "state": 3}, {**good, "later": 1}, [1], None]
    texts = [*map(json.dumps, odd), "[" * 100_000, json.dumps({**good, "outputs": ["a\0"]}), "\x00\xff"]
    for text in texts:
        (out / "manifest.jsonl").write_text(text)
        assert Manifest(out).earlier_outcome("a", folder / "a.ply", good["job"]) is None
    (out / "manifest.jsonl").write_text("\n".join([*texts, json.dumps(good)]))
    assert sh.batches.run(folder, out, measure, workers=1).skipped == 1


@pytest.mark.parametrize("odd", ["folder", "device"])
@pytest.mark.usefixtures("in_this_process")
def test_results_replace_nothing_but_files(tmp_path, files, odd):
    folder, out = files("a.ply"), tmp_path / "out"
    out.mkdir()
    (out / "a.txt").mkdir() if odd == "folder" else (out / "a.txt").symlink_to("/dev/null")
    (outcome,) = sh.batches.run(folder, out, measure, workers=1).outcomes
    assert outcome.state == "failed" and odd in outcome.message
    assert {path.name for path in out.iterdir()} == {"a.txt", "manifest.jsonl"}


@pytest.mark.usefixtures("in_this_process")
def test_results_go_where_links_lead_with_the_permissions_there(tmp_path, files):
    folder, out = files("a.ply"), tmp_path / "out"
    out.mkdir()
    (tmp_path / "elsewhere").write_text("old")
    (tmp_path / "elsewhere").chmod(0o640)
    (out / "a.txt").symlink_to(tmp_path / "elsewhere")
    assert sh.batches.run(folder, out, measure, workers=1).outcomes[0].is_done
    assert (out / "a.txt").is_symlink() and (tmp_path / "elsewhere").read_text() == "this is a.ply"
    assert (tmp_path / "elsewhere").stat().st_mode & 0o777 == 0o640


def test_figures_that_the_manifest_cannot_hold_fail_alone(tmp_path, files):
    batch = sh.batches.run(files("a.ply"), tmp_path / "out", counted, workers=1)
    assert [outcome.state for outcome in batch.outcomes] == ["failed"]
    assert "not JSON serializable" in batch.outcomes[0].message


def test_constraints_of_plain_fields_give_them_in_batches_too(tmp_path):
    source = tmp_path / "ball.ply"
    samples.sphere(2).save(source)
    job = sh.batches.Job(volume=".npz", resolution=12, constraint=sh.constraints.EachComponent())
    job(source, tmp_path / "made")
    grid = sh.read_field(tmp_path / "made.npz").domain
    plain = sh.SignedHeatSolver(grid).distance(sh.read(source), sh.constraints.EachComponent())
    assert np.array_equal(sh.read_field(tmp_path / "made.npz").values, plain.values)
    with pytest.raises(sh.SignedHeatError, match="a band would need"):
        sh.batches.Job(volume=".npz", band=0.1, constraint=sh.constraints.EachComponent())
