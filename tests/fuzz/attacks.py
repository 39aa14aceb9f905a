"""Every format attacked in the same ways: ``python -m fuzz.attacks [ENDING …]``, in the folder tests, prints a table.

A cell says how many files were tried, and how many of them were read; all others were refused by a `SignedHeatError`
that names the file. Anything else is told and counts as a failure: another exception, a number or a name from a file
outside the folder, more than `SECONDS` of a processor, or more than `MEMORY` bytes.
"""

from __future__ import annotations

import gzip
import io
import os
import re
import struct
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import scan_files
import signedheat as sh
from fuzz.cases_files import KINDS, Files
from fuzz.forked import forked
from fuzz.frame import _peak

LIES_TOLD = 1000
"""Lies that are told in place of the sizes of a file, at most."""
SECONDS, MEMORY = 10.0, 600_000_000
"""What a file of some kilobytes may take: parsers of other packages, half a gigabyte."""
LARGE = 1 << 28
"""Bytes that a bomb becomes."""
SECRET = 777.125
"""A number in a file outside the folder."""
NUMBER = re.compile(rb"[-+]?\d+(\.\d*)?(e[-+]?\d+)?")
LIES = [b"0", b"-1", b"2147483647", b"4294967296", b"1000000000000", b"999999999999999999", b"1e400", b"1" * 5000]
WORDS = [struct.pack("<I", 2**31 - 1), b"\xff" * 4, struct.pack("<Q", 2**40), struct.pack("<Q", 2**62), b"\xff" * 8]
Attack = Callable[[Files, Path], Iterator[Files]]


def first_of(files: Files, data: bytes) -> Files:
    """The same files, with other bytes in the first."""
    return {name: data if k == 0 else old for k, (name, old) in enumerate(files.items())}


def contents(files: Files) -> Iterator[tuple[bytes, Callable[[bytes], Files]]]:
    """What the first file has, unpacked, and how it is packed again, with checksums that are right."""
    data = next(iter(files.values()))
    if data.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        for name, content in members.items():
            yield content, lambda new, name=name: first_of(files, zipped(members | {name: new}))
    elif data.startswith(b"\x1f\x8b"):
        yield gzip.decompress(data), lambda new: first_of(files, gzip.compress(new, 6, mtime=0))
    elif data.startswith(b"ASTM-E57"):
        yield scan_files.description(data), lambda new: first_of(files, scan_files.with_description(data, new))
    else:
        yield data, lambda new: first_of(files, new)


def zipped(members: dict[str, bytes]) -> bytes:
    """An archive."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def truncated(files: Files, _: Path) -> Iterator[Files]:
    """The beginning alone."""
    data = next(iter(files.values()))
    for end in range(len(data)):
        yield first_of(files, data[:end])


def changed(files: Files, _: Path) -> Iterator[Files]:
    """One byte is another."""
    random = np.random.default_rng(0)
    for data, packed in contents(files):
        for at in range(len(data)):
            yield packed(data[:at] + bytes([data[at] ^ int(random.integers(1, 256))]) + data[at + 1 :])


def lying(files: Files, _: Path) -> Iterator[Files]:
    """Counts, sizes and indices are others: the first numbers of a text, and words of four and eight bytes."""
    for data, packed in contents(files):
        changes = [data[: found.start()] + lie + data[found.end() :]
                   for found in NUMBER.finditer(data[:4000]) for lie in LIES]  # fmt: skip
        if not data[:4000].isascii() or b"\0" in data[:4000]:
            changes += [data[:at] + word + data[at + len(word) :] for at in range(0, 400, 2) for word in WORDS]
        for k in np.unique(np.linspace(0, len(changes) - 1, min(LIES_TOLD, len(changes))).astype(int)):
            yield packed(changes[k])


def bombs(files: Files, _: Path) -> Iterator[Files]:
    """Files that become large: packed zeros, entities of entities, nesting, numbers and lines of any length."""
    zeros = bytes(LARGE)
    for data, packed in contents(files):
        if next(iter(files.values()))[:2] in (b"PK", b"\x1f\x8b"):
            yield packed(data + zeros)
        if b"encoding: gzip" in data:
            yield packed(data.partition(b"\n\n")[0] + b"\n\n" + gzip.compress(zeros, 6))
        if is_xml(data):
            inner = b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9))
            yield packed(with_entities(data, b'<!ENTITY a "1111111111">' + inner, b"&j;"))
            end = data.rindex(b"</")
            yield packed(data[:end] + b"<g>" * 100_000 + b"</g>" * 100_000 + data[end:])
        elif data[:1] == b"{":
            yield packed(b'{"a":' * 100_000 + b"1" + b"}" * 100_000)
            yield packed(data[:1] + b'"a":' + b"[" * 100_000 + b"]" * 100_000 + b"," + data[1:])
        numbers = list(NUMBER.finditer(data[:4000]))
        for found in numbers[:: max(len(numbers) // 4, 1)]:
            yield packed(data[: found.start()] + b"1" * 1_000_000 + data[found.end() :])


def entities(files: Files, outside: Path) -> Iterator[Files]:
    """Descriptions that refer to other files: entities, document types, inclusions."""
    for data, packed in contents(files):
        if is_xml(data):
            named = outside.as_uri().encode()
            yield packed(with_entities(data, b'<!ENTITY j SYSTEM "%s">' % named, b"&j;"))
            yield packed(with_entities(data, b'<!ENTITY %% j SYSTEM "%s"> %%j;' % named, b"1"))
            yield packed(re.sub(rb"(<[A-Za-z])", b'<!DOCTYPE a SYSTEM "%s">\\1' % named, data, count=1))
            include = b'<x:include xmlns:x="http://www.w3.org/2001/XInclude" href="%s" parse="text"/>' % named
            end = data.rindex(b"</")
            yield packed(data[:end] + include + data[end:])


def traversal(files: Files, outside: Path) -> Iterator[Files]:
    """Names of files outside the folder, wherever a format names files."""
    data = next(iter(files.values()))
    for name in (f"../{outside.name}", str(outside), outside.as_uri()):
        ways = [
            (rb'("uri": ?)"[^"]*"', rb'\1"%s"'),
            (rb"data ?file: .*", b"data file: %s"),
            (rb'(href=)"[^"]*"', rb'\1"%s#a"'),
            (rb'(url=)"[^"]*"', rb'\1"%s#a"'),
        ]
        for way, new in ways:
            if re.search(way, data):
                yield first_of(files, re.sub(way, new % name.encode(), data))
        if data.startswith(b"NRRD"):
            yield first_of(files, data.partition(b"\n\n")[0] + b"\ndata file: %s\n\n" % name.encode())
        if data[:2] == b"v ":
            yield first_of(files, b"mtllib %s\n" % name.encode() + data)
        if b"<svg" in data:
            yield first_of(files, data.replace(b"</svg>", b'<use href="%s#a"/></svg>' % name.encode()))
        if data.startswith(b"PK"):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                members = {member: archive.read(member) for member in archive.namelist()}
            yield first_of(files, zipped(members | {name: b"evil"}))
            other = b'<item xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06" p:path="%s"'
            model = next(iter(members.values())).replace(b"<item", other % name.encode())
            yield first_of(files, zipped(members | {next(iter(members)): model}))


def is_xml(data: bytes) -> bool:
    return re.match(rb"\s*<\??[A-Za-z]", data) is not None


def with_entities(data: bytes, definitions: bytes, use: bytes) -> bytes:
    """XML with definitions of entities, and a use of them in place of the first number between tags."""
    data = re.sub(rb">(\s*)[-\d.]+", lambda found: b">" + found[1] + use, data, count=1)
    return re.sub(rb"<[A-Za-z]", lambda found: b"<!DOCTYPE a [" + definitions + b"]>" + found[0], data, count=1)


ATTACKS: dict[str, Attack] = {
    "truncated": truncated,
    "bytes changed": changed,
    "sizes lying": lying,
    "bombs": bombs,
    "entities": entities,
    "traversal": traversal,
}


def outcome(read: Callable[[Path], Any], files: Files, folder: Path, opened: list[str]) -> str:
    """What becomes of an attack: read, refused, or what is wrong."""
    for name, data in files.items():
        (folder / name).write_bytes(data)
    there, before, begin = sorted(folder.parent.iterdir()), _peak(), time.process_time()
    opened.clear()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = read(folder / next(iter(files)))
        result = "read"
    except sh.errors.SignedHeatError as error:
        found, result = str(error), "refused" if error.path is not None else f"no name: {error}"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    if time.process_time() - begin > SECONDS or _peak() - before > MEMORY:
        return f"{time.process_time() - begin:.1f} s, {(_peak() - before) / 1e6:.0f} MB"
    if (
        any(os.path.realpath(name) in map(str, there[1:]) for name in opened)
        or sorted(folder.parent.iterdir()) != there
    ):
        return "a file outside its folder was opened or written"
    values = getattr(found, "vertices", getattr(found, "points", None))
    if str(SECRET) in str(found) or (values is not None and SECRET in values):
        return "what is outside its folder was read"
    return result


def formats() -> dict[str, list[tuple[Callable[[Path], Any], Files]]]:
    """Files that are right, and what reads them, by ending."""
    found: dict[str, list[tuple[Callable[[Path], Any], Files]]] = {}
    for read, variants in KINDS.values():
        for files in variants():
            ending = next(iter(files)).partition(".")[2]
            found.setdefault(ending, []).append((read, files))
    return dict(sorted(found.items()))


def main(wanted: list[str]) -> int:
    """Run all attacks on some formats; 1 if any failed."""
    opened: list[str] = []
    sys.addaudithook(lambda event, given: opened.append(str(given[0])) if event == "open" else None)
    print("|", " | ".join(["", *ATTACKS]), "|")
    print("|" + "---|" * (len(ATTACKS) + 1), flush=True)
    failures = []
    for ending, variants in formats().items():
        if wanted and ending not in wanted:
            continue
        print(f"| `.{ending}` |", end="", flush=True)
        for name, attack in ATTACKS.items():
            kinds: Counter[str] = Counter()
            for read, files in variants:
                with tempfile.TemporaryDirectory() as root:
                    folder, outside = Path(root) / "in", Path(root) / "outside.bin"
                    folder.mkdir()
                    outside.write_text(f"{SECRET} {SECRET} {SECRET}\n")
                    for attacked in attack(files, outside):
                        kind = outcome(read, attacked, folder, opened)
                        if kind not in ("read", "refused"):  # again: it may have been kernels that were compiled
                            kind = outcome(read, attacked, folder, opened)
                        kinds[kind] += 1
                        if kind not in ("read", "refused"):
                            failures.append(f".{ending} {name}: {kind[:200]}")
            tried, wrong = kinds.total(), kinds.total() - kinds["read"] - kinds["refused"]
            cell = f"{tried:,} ({kinds['read']:,})" + (f" **{wrong} wrong**" if wrong else "")
            print(f" {cell if tried else '–'} |", end="", flush=True)
        print()
    print("\n".join(["", f"{len(failures)} failures", *failures]))
    return int(bool(failures))


if __name__ == "__main__":
    with forked():
        status = main(sys.argv[1:])
    sys.exit(status)
