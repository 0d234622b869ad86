"""Create zip files whose bytes depend only on the files in them, and not on the time or the operating system.

The standard module `zipfile` stores the time and the operating system, and cannot write entries that are already compressed.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct

MODEL = "model.xml"
"""File name of the XML model in a `.mjz` archive. MuJoCo searches an archive for this name first."""

DATE, TIME = 0x21, 0
"""Date (1980-01-01) and time of all entries, in MS-DOS format."""

_DEFLATED, _VERSION, _UNIX, _UTF8 = 8, 20, 3 << 8, 0x800
_MODE = 0o100644 << 16
_HEADER = 30
"""Number of bytes in the local header of a zip entry before the file name."""


class ZipEntry(FrozenStruct):
    """A compressed file of a zip archive (RFC 1951), with the CRC-32 and the size [bytes] of its uncompressed content."""

    data: bytes
    crc: int
    size: int


def make_zip(entries: Mapping[str, bytes | ZipEntry]) -> bytes:
    """Create a zip archive from files by name. The archive is sorted by name, so the same files always result in the same bytes.

    The format of the archive is PKWARE APPNOTE.TXT 6.3.
    """
    parts, directory, at = list[bytes](), bytearray(), 0  # join the pieces only once, because meshes are large
    for name in sorted(entries):
        content, encoded = entries[name], name.encode()
        entry = deflate(content) if isinstance(content, bytes) else content
        flags = 0 if name.isascii() else _UTF8
        common = struct.pack("<HHHHHIIIHH", _VERSION, flags, _DEFLATED, TIME, DATE, entry.crc, len(entry.data), entry.size, len(encoded), 0)
        directory += b"PK\x01\x02" + struct.pack("<H", _UNIX | _VERSION) + common
        directory += struct.pack("<HHHII", 0, 0, 0, _MODE, at) + encoded
        parts += [b"PK\x03\x04" + common + encoded, entry.data]
        at += _HEADER + len(encoded) + len(entry.data)
    count = len(entries)
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, count, count, len(directory), at, 0)
    return b"".join([*parts, directory, end])


def entries(archive: bytes) -> dict[str, ZipEntry]:
    """Return the files in a zip archive that `make_zip` created, by name."""
    from zipfile import ZipFile

    members = {}
    for one in ZipFile(io.BytesIO(archive)).infolist():
        begin = one.header_offset + _HEADER + len(one.filename.encode())
        members[one.filename] = ZipEntry(data=archive[begin: begin + one.compress_size], crc=one.CRC, size=one.file_size)
    return members


def inflate(entry: ZipEntry) -> bytes:
    """Return the uncompressed content of a file of a zip archive."""
    return zlib.decompress(entry.data, -zlib.MAX_WBITS)


def deflate(data: bytes) -> ZipEntry:
    """Compress the content of a file for a zip archive."""
    compressor = zlib.compressobj(4, zlib.DEFLATED, -zlib.MAX_WBITS)
    return ZipEntry(data=compressor.compress(data) + compressor.flush(), crc=zlib.crc32(data), size=len(data))
