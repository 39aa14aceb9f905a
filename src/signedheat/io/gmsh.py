"""What Gmsh's files announce, looked at before meshio allocates memory for it or counts to it."""

from __future__ import annotations

import re

import numpy as np

from .files import PathLike, contents, damaged, ensure_fits

COUNTS = {"PhysicalNames": 1, "Entities": 4, "Nodes": 2, "Elements": 2, "Periodic": 1, "NodeData": 1, "ElementData": 1}
"""Sections, and how many numbers at the beginning of each count what is in it (in version 2 there is but one)."""
IN_TEXT = ("PhysicalNames", "NodeData", "ElementData")
"""Sections that begin with text in binary files, too."""
LARGE = rb"^(\d{9,})(?=[ \t]*\r?$|(?:[ \t]+\S+){3})"
"""Numbers of nodes with many digits, at the beginning of lines that are no coordinates."""


def refuse_announcements(path: PathLike) -> None:
    """Check that a Gmsh file can hold what it announces, and that a table up to its largest node number fits.

    Raises
    ------
    FileFormatError
        If it announces more things than it has bytes.
    MemoryLimitError
        If its nodes have numbers so large that there is no memory for the table which meshio makes of them.
    """
    data = contents(path)
    form = re.search(rb"\$MeshFormat\s+(\S+)\s+([01])\s+([48])\s", data)
    if form is None:
        return  # meshio says so
    is_raw = form[2] == b"1" and form[1].startswith(b"4")
    kind = np.dtype(f"<u{form[3].decode()}")
    for section in re.finditer(rb"^\$(\w+)[ \t]*\r?\n", data, re.MULTILINE):
        name, begin = section[1].decode(), section.end()
        if name not in COUNTS:
            continue
        if is_raw and name not in IN_TEXT:
            counts = np.frombuffer(data, kind, COUNTS[name], begin).tolist()
        else:
            counts = [int(word) for word in data[begin : begin + 100].split(b"\n")[0].split()[: COUNTS[name]]]
        if max(counts, default=0) > len(data):
            raise damaged(f"it has {len(data)} bytes, and announces {max(counts)} {name}", element=name)
        if name == "Nodes":
            if is_raw and form[1] != b"4.0":
                largest = _largest_in_blocks(data, begin, counts[0], kind)
            else:
                rows = data[begin : data.find(b"$EndNodes", begin)]
                largest = max(map(int, re.findall(LARGE, rows, re.MULTILINE)), default=0)
            ensure_fits(8 * largest, path)


def _largest_in_blocks(data: bytes, at: int, n_blocks: int, kind: np.dtype[np.unsignedinteger]) -> int:
    """The largest number of a node in the blocks of a binary file of version 4.1."""
    largest, at = 0, at + 4 * kind.itemsize
    for _ in range(n_blocks):
        at += 12  # dimension and number of the entity, whether it is parametric
        count = int(np.frombuffer(data, kind, 1, at)[0])
        numbers = np.frombuffer(data, kind, count, at + kind.itemsize)
        largest = max(largest, int(numbers.max(initial=0)))
        at += kind.itemsize * (1 + count) + 24 * count
    return largest
