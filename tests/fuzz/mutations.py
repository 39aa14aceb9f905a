"""Damage to files: bytes, lines, numbers, headers, truncation, insertion; in packed files, to what is packed."""

from __future__ import annotations

import gzip
import io
import re
import zipfile
from collections.abc import Callable

import numpy as np

Mutation = Callable[[np.random.Generator, bytes], bytes]

NUMBERS = [
    b"0", b"-1", b"1", b"2", b"3", b"7", b"255", b"256", b"65535", b"2147483647", b"2147483648", b"-2147483648",
    b"4294967295", b"4294967296", b"9223372036854775807", b"-9223372036854775808", b"18446744073709551616", b"1e9",
    b"1099511627776", b"nan", b"inf", b"-inf", b"1e308", b"1e400", b"-1e400", b"1e-400", b"0.5", b"", b"x", b"\xff",
    "²".encode(), b"1_0", b"0x10", b"--1", b"1e", b"999999999999999999999999999999",
]  # fmt: skip
"""What numbers in text become."""
WORDS = [b"0000", b"ffffffff", b"7fffffff", b"80000000", b"0000c07f", b"0000807f", b"01000000", b"ffffff7f"]
"""What four bytes become: zero, −1, the largest and least integers, NaN, infinity, one, the largest float."""


def flip(random: np.random.Generator, data: bytes) -> bytes:
    """A few bits."""
    array = np.frombuffer(data, np.uint8).copy()
    at = random.integers(0, len(array), random.integers(1, 5))
    array[at] ^= (1 << random.integers(0, 8, len(at))).astype(np.uint8)
    return array.tobytes()


def overwrite(random: np.random.Generator, data: bytes) -> bytes:
    """A stretch of random bytes, or of one byte."""
    a, b = stretch(random, len(data), 64)
    new = bytes(random.integers(0, 256, b - a, dtype=np.uint8)) if random.random() < 0.5 else bytes([
        int(random.choice([0, 255, 32, 10, 48]))]) * (b - a)  # fmt: skip
    return data[:a] + new + data[b:]


def truncate(random: np.random.Generator, data: bytes) -> bytes:
    """The beginning only."""
    return data[: random.integers(0, len(data))]


def remove(random: np.random.Generator, data: bytes) -> bytes:
    """A stretch less."""
    a, b = stretch(random, len(data), 256)
    return data[:a] + data[b:]


def repeat(random: np.random.Generator, data: bytes) -> bytes:
    """A stretch again, up to a thousand times."""
    a, b = stretch(random, len(data), 256)
    return data[:b] + data[a:b] * int(random.choice([1, 2, 10, 1000])) + data[b:]


def insert(random: np.random.Generator, data: bytes) -> bytes:
    """Bytes that were not there."""
    at = int(random.integers(0, len(data) + 1))
    new = bytes(random.integers(0, 256, random.integers(1, 32), dtype=np.uint8))
    return data[:at] + (new if random.random() < 0.6 else bytes(random.choice(NUMBERS))) + data[at:]


def word(random: np.random.Generator, data: bytes) -> bytes:
    """Four bytes that mean much as a count, an id or a number."""
    reach = len(data) if random.random() < 0.5 else min(len(data), 400)
    at = int(random.integers(0, max(reach - 4, 1)))
    return data[:at] + bytes.fromhex(bytes(random.choice(WORDS)).decode()) + data[at + 4 :]


def number(random: np.random.Generator, data: bytes) -> bytes:
    """A number in text becomes another, more often near the beginning, where the counts are."""
    reach = data[:400] if random.random() < 0.6 else data
    found = list(re.finditer(rb"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", reach))
    if not found:
        return flip(random, data)
    chosen = found[int(random.integers(0, len(found)))]
    return data[: chosen.start()] + bytes(random.choice(NUMBERS)) + data[chosen.end() :]


def lines(random: np.random.Generator, data: bytes) -> bytes:
    """Lines less, again, exchanged, joined or without their last word."""
    rows = data.split(b"\n")
    at, other = (int(k) for k in random.integers(0, min(len(rows), 30) if random.random() < 0.5 else len(rows), 2))
    match int(random.integers(0, 5)):
        case 0:
            del rows[at]
        case 1:
            rows.insert(other, rows[at])
        case 2:
            rows[at], rows[other] = rows[other], rows[at]
        case 3:
            rows[at : at + 2] = [b" ".join(rows[at : at + 2])]
        case 4:
            rows[at] = rows[at].rpartition(b" ")[0]
    return b"\n".join(rows)


def key(random: np.random.Generator, data: bytes) -> bytes:
    """A word becomes another word of the file."""
    found = list(re.finditer(rb"[A-Za-z_]{2,}", data[:4000]))
    if len(found) < 2:
        return flip(random, data)
    a, b = (found[int(k)] for k in random.integers(0, len(found), 2))
    return data[: a.start()] + b.group() + data[a.end() :]


def stretch(random: np.random.Generator, length: int, most: int) -> tuple[int, int]:
    """The ends of a piece of something."""
    a = int(random.integers(0, length))
    return a, min(length, a + int(random.integers(1, most)))


MUTATIONS: list[Mutation] = [flip, overwrite, truncate, remove, repeat, insert, word, number, lines, key]


OF_CONTENT = 0.9
"""How often what is packed is damaged, and not the pack, whose checksums tell that."""


def damaged(random: np.random.Generator, data: bytes) -> bytes:
    """Data with one to three damages."""
    if data.startswith((b"PK", b"\x1f\x8b")) and random.random() < OF_CONTENT:
        return member_damaged(random, data) if data.startswith(b"PK") else packed_damaged(random, data)
    for _ in range(int(random.integers(1, 4))):
        if data:
            data = MUTATIONS[int(random.integers(0, len(MUTATIONS)))](random, data)
    return data


def packed_damaged(random: np.random.Generator, data: bytes) -> bytes:
    """A gzip file of which the content is damaged; its checksum is right."""
    return gzip.compress(damaged(random, gzip.decompress(data)), mtime=0)


def member_damaged(random: np.random.Generator, data: bytes) -> bytes:
    """An archive of which a member is damaged, is missing, or has the content of another; its checksums are right."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = (list(members)[int(k)] for k in random.integers(0, len(members), 2))
    kind = random.random()
    if kind < 0.05:
        del members[name]
    else:
        members[name] = members[other] if kind < 0.15 else damaged(random, members[name])
    new = io.BytesIO()
    with zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return new.getvalue()
