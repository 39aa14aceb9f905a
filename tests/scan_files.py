"""E57 files whose description is changed, with checksums that are right."""

import struct
from pathlib import Path

import numpy as np

PAGE, PAYLOAD = 1024, 1020


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_CRC = _crc_table()


def checksum(data: bytes) -> bytes:
    """CRC-32C, as each page of an E57 file ends with."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = (crc >> 8) ^ _CRC[(crc ^ byte) & 0xFF]
    return struct.pack(">I", crc ^ 0xFFFFFFFF)


def write_e57(path: Path, points: np.ndarray, **options: object) -> None:
    """A scan by pye57."""
    import pye57

    file = pye57.E57(str(path), mode="w")
    file.write_scan_raw(dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True)), **options)
    file.close()


def logical(data: bytes) -> bytes:
    """The bytes of the pages, without checksums."""
    return b"".join(data[begin : begin + PAYLOAD] for begin in range(0, len(data), PAGE))


def place_of_description(data: bytes) -> tuple[int, int]:
    """Where the XML begins among the logical bytes, and how long it is."""
    offset, length = struct.unpack_from("<QQ", data, 24)
    return offset // PAGE * PAYLOAD + offset % PAGE, length


def description(data: bytes) -> bytes:
    """The XML of a file."""
    begin, length = place_of_description(data)
    return logical(data)[begin : begin + length]


def with_description(data: bytes, xml: bytes) -> bytes:
    """The file with another XML."""
    begin, _ = place_of_description(data)
    body = bytearray(logical(data)[:begin] + xml)
    body += bytes(-len(body) % PAYLOAD)
    struct.pack_into("<Q", body, 16, len(body) // PAYLOAD * PAGE)
    struct.pack_into("<Q", body, 32, len(xml))
    pages = (bytes(body[k : k + PAYLOAD]) for k in range(0, len(body), PAYLOAD))
    return b"".join(page + checksum(page) for page in pages)
