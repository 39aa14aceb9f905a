"""Files of strangers: nothing of them is run, nothing that they name is fetched, and terminals stay as they are."""

import socket
import subprocess
import sys

import numpy as np
import pytest

import scan_files
import signedheat as sh
from refusals import refused
from signedheat import samples
from signedheat.cli import main
from signedheat.jobs import command_for

HOSTILE = ("secrets", "socket", "json", "queue", "numpy", "pickle")


@pytest.fixture
def hostile(tmp_path):
    """A folder with a shape, and with modules named like those of others, each of which leaves a trace when it runs."""
    folder = tmp_path / "hostile"
    folder.mkdir()
    samples.sphere(2).save(folder / "ball.stl")
    for name in HOSTILE:
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'trace')!r}, 'a').write({name!r})\nraise ImportError")
    return folder


@pytest.mark.parametrize(
    "arguments",
    [
        ("batch", "ball.stl", "-o", "out", "--info", "--workers", "1"),
        ("volume", "ball.stl", "-o", "a.npz", "--spacing", ".2", "--band", ".4", "--tiles", "store", "--workers", "2"),
    ],
)
def test_nothing_is_imported_from_the_current_folder(hostile, arguments):
    start = (
        f"import sys; sys.path[:] = {[path for path in sys.path if path]!r}; from signedheat.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-I", "-c", start, *arguments], cwd=hostile, capture_output=True, text=True)
    assert done.returncode == 0 and not (hostile.parent / "trace").exists(), done.stderr


def test_a_process_of_its_own_takes_nothing_from_the_current_folder(hostile):
    command = command_for("json:dumps", "x")
    assert subprocess.run(command, cwd=hostile, capture_output=True).returncode == 0
    assert not (hostile.parent / "trace").exists()


def test_control_characters_of_files_and_names_are_escaped(tmp_path, capfd):
    table = tmp_path / "a\x1b[31m\nb.csv"
    table.write_text("0,0\n1,1\n\x1b[2J\x1b]0;owned\x07 \u202e\n")
    with refused(sh.errors.FileFormatError) as caught:
        sh.io.read_polylines(table)
    assert str(caught.value).isprintable() and caught.value.path == str(table)
    samples.sphere(1).save(tmp_path / "a\x1b[31m\nb.ply")
    assert main(["info", str(table), str(tmp_path / "a\x1b[31m\nb.ply")]) == 1
    assert main(["batch", str(tmp_path), "-o", str(tmp_path / "\x1bout"), "--info", "--workers", "1"]) == 0
    out, err = capfd.readouterr()
    assert "\x1b" not in out + err and len(err.splitlines()) == 1
    named = [line.split() for line in out.splitlines() if line.startswith("file")]
    assert named == [["file", f"{tmp_path}/a\\x1b[31m\\nb.ply"]]


ENTITY = b'<!DOCTYPE e57Root [<!ENTITY a SYSTEM "http://127.0.0.1:%d/a">]>'
EXTERNAL = b'<!DOCTYPE e57Root SYSTEM "http://127.0.0.1:%d/b.dtd">'
SCHEMA = b'xmlns:x="http://www.w3.org/2001/XMLSchema-instance" x:schemaLocation="a http://127.0.0.1:%d/c.xsd" '


@pytest.mark.parametrize("kind", ["entity", "external", "schema", "latin", "utf-16"])
def test_e57_files_fetch_nothing(tmp_path, kind):
    pytest.importorskip("pye57")
    path = tmp_path / "scan.e57"
    scan_files.write_e57(path, np.random.default_rng(0).normal(size=(20, 3)))
    data = path.read_bytes()
    xml = scan_files.description(data)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.3)
        port = server.getsockname()[1]
        head, _, rest = xml.partition(b"?>")
        changed = {
            "entity": head + b"?>" + ENTITY % port + rest.replace(b"</e57Root>", b'<b type="String">&a;</b></e57Root>'),
            "external": head + b"?>" + EXTERNAL % port + rest,
            "schema": xml.replace(b"<e57Root ", b"<e57Root " + SCHEMA % port),
            "latin": xml.replace(b"UTF-8", b"ISO-8859-1"),
            "utf-16": (head + b"?>" + EXTERNAL % port + rest).decode().replace("UTF-8", "UTF-16").encode("utf-16"),
        }
        path.write_bytes(scan_files.with_description(data, changed[kind]))
        with refused(sh.errors.FileFormatError):
            sh.read(path)
        with pytest.raises(TimeoutError):
            server.accept()
    path.write_bytes(scan_files.with_description(data, xml))
    assert sh.read(path).n_points == 20
