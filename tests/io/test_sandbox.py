"""Parsers of other packages in a process of their own: whatever they do to it is one error."""

import ctypes
import os
import socket
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.errors import FileFormatError, MemoryLimitError, MissingPackageError
from signedheat.io import budgets, parsers, sandbox

HOSTILE = """
def good(path, factor):
    print("what is printed does not come between")
    return {"a": factor * np.arange(6, dtype=">f4").reshape(2, 3), "none": np.zeros((0, 3)), "name": path[-3:]}

def crash(path):
    ctypes.string_at(0)

def abort(path):
    os.write(2, b"cannot go on\\n")
    os.abort()

def leave(path):
    os._exit(0)

def hang(path):
    while True:
        pass

def devour(path):
    return {"a": np.ones(1 << 40)}

def raise_it(path):
    raise KeyError("an odd\\x1b[31m\\nmessage")

def lacks(path):
    import no_such_package

def connect(path):
    import socket
    socket.create_connection(("127.0.0.1", int(path.rpartition("_")[2])), timeout=1)

def connect_natively(path):
    address = b"\\2\\0" + int(path.rpartition("_")[2]).to_bytes(2, "big") + bytes([127, 0, 0, 1]) + bytes(8)
    native = ctypes.CDLL(None)
    return {"status": native.connect(native.socket(2, 1, 0), address, 16)}

def run(path):
    os.system("true")

def objects(path):
    raw(b'{"values": {}, "arrays": [["a", "|O8", [1]]]}\\n' + bytes(8))

def more_than_it_has(path):
    raw(b'{"values": {}, "arrays": [["a", "<f8", [1000]]]}\\n' + bytes(8))

def more_than_there_is(path):
    raw(b'{"values": {}, "arrays": [["a", "<f8", [1000000000, 1000000]]]}\\n')

def less_than_nothing(path):
    raw(b'{"values": {}, "arrays": [["a", "<f8", [-1, -1]]]}\\n')

def noise(path):
    raw(b"\\xff" * 100)

def raw(text):
    ANSWERS.write(text)
    ANSWERS.flush()
    os._exit(0)

"""


@pytest.fixture
def parse(tmp_path, monkeypatch):
    """A function that parses a file by one of the functions above."""
    source = Path(parsers.__file__).read_text(encoding="utf-8")
    opened = 'os.fdopen(os.dup(1), "wb")'
    source = source.replace(f"file = {opened}", f'file = globals()["ANSWERS"] = {opened}')
    (tmp_path / "program.py").write_text(source.replace("if __name__ ==", f"{HOSTILE}if __name__ =="))
    monkeypatch.setattr(sandbox, "parsers", SimpleNamespace(__file__=tmp_path / "program.py"))

    def parse(function, name="a.xyz", **options):
        (tmp_path / name).write_bytes(b"content")
        return sandbox.parsed(function, tmp_path / name, "numpy", "tests", **options)

    return parse


def test_arrays_and_other_values_come_back(parse):
    found = parse("good", factor=2)
    assert found["a"].tolist() == [[0, 2, 4], [6, 8, 10]] and found["none"].shape == (0, 3) and found["name"] == "xyz"


@pytest.mark.parametrize(
    ("function", "kind"),
    [
        ("crash", FileFormatError),
        ("abort", FileFormatError),
        ("leave", FileFormatError),
        ("devour", MemoryLimitError),
        ("raise_it", FileFormatError),
        ("lacks", MissingPackageError),
        ("run", FileFormatError),
        ("objects", FileFormatError),
        ("more_than_it_has", FileFormatError),
        ("more_than_there_is", MemoryLimitError),
        ("less_than_nothing", FileFormatError),
        ("noise", FileFormatError),
    ],
)
def test_whatever_a_parser_does_is_one_line(parse, function, kind):
    with refused(kind) as caught:
        parse(function)
    assert str(caught.value).isprintable()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of processor time")
def test_a_parser_without_an_end_is_stopped_by_its_processor_time(parse, monkeypatch):
    monkeypatch.setattr(budgets, "LEAST_SECONDS", 1)
    with refused(FileFormatError) as caught:
        parse("hang")
    assert " 1 s " in caught.value.cause


def test_a_parser_has_no_network(parse):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with refused(FileFormatError):
            parse("connect", f"a_{port}")
        unshare = getattr(ctypes.CDLL(None), "unshare", None)
        pid = os.fork() if unshare is not None else None
        if pid == 0:
            flags = parsers.NEW_NETWORK, parsers.NEW_USER | parsers.NEW_NETWORK
            os._exit(all(unshare(flag) for flag in flags))
        if pid is not None and os.waitpid(pid, 0)[1] == 0:  # the system can take the network from native code, too
            assert parse("connect_natively", f"a_{port}")["status"] == -1


def test_small_files_are_read_soon(tmp_path):
    """The time is that of a processor, of the process that reads: it starts Python and imports NumPy and meshio."""
    mesh = sh.TetMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]])
    mesh.save(tmp_path / "one.mesh")
    before = os.times()
    assert sh.read(tmp_path / "one.mesh").n_tets == 1
    after = os.times()
    assert sum(after[:4]) - sum(before[:4]) < 2.0  # .2 s where nobody else works
