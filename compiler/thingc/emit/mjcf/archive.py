"""`.mjz`: a model and its meshes in one zip file that MuJoCo opens, the same bytes every time.

`MjSpec.encode` writes the clock and six digits. Python's `zipfile` would compress the meshes anew for every mode and every
edit; here each is compressed once and kept in the store.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping

from thingc.emit.artifact import Artifacts, Stored
from thingc.emit.mjcf.target import models
from thingc.emit.request import EmitRequest
from thingc.frozen import dataclass
from thingc.realize.store.local import BlobMissing, Store

MODEL = "model.xml"
"""The name under which MuJoCo looks for the model first, whatever the archive is called."""

DATE, TIME = 0x21, 0
"""1980-01-01 00:00:00, the first moment that a zip file can state."""

_DEFLATED, _VERSION, _UNIX, _UTF8 = 8, 20, 3 << 8, 0x800
_MODE = 0o100644 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Deflated:
    """A file's content, compressed (RFC 1951), with the CRC-32 and the size [bytes] of what it was."""

    data: bytes
    crc: int
    size: int


def emit(request: EmitRequest) -> Artifacts:
    """`mjcf/<name>_<mode>.mjz` of each chosen mode. What it cannot say is what the model in it cannot say."""
    made = models(request)
    if request.report.failed:
        return Artifacts(files={}, losses=made.losses)
    return Artifacts(
        files={
            f"mjcf/{candidate.file.removesuffix('.xml')}.mjz": archive(candidate.model.text.encode(), made.assets, request.store)
            for candidate in made.candidates
        },
        losses=made.losses,
    )


def archive(model: bytes, assets: Mapping[str, Stored], store: Store) -> bytes:
    """The zip file: the model, and each asset as `assets/<file>`."""
    entries = {f"assets/{file}": _asset(stored, store) for file, stored in assets.items()}
    entries[MODEL] = deflate(model)
    return zipped(entries)


def zipped(entries: Mapping[str, Deflated]) -> bytes:
    """A zip file with these entries, sorted by name, the same bytes every time (layout: PKWARE APPNOTE.TXT 6.3)."""
    body, directory = bytearray(), bytearray()
    for name in sorted(entries):
        entry, encoded = entries[name], name.encode()
        flags = 0 if name.isascii() else _UTF8
        common = struct.pack(
            "<HHHHHIIIHH", _VERSION, flags, _DEFLATED, TIME, DATE, entry.crc, len(entry.data), entry.size, len(encoded), 0
        )
        directory += b"PK\x01\x02" + struct.pack("<H", _UNIX | _VERSION) + common
        directory += struct.pack("<HHHII", 0, 0, 0, _MODE, len(body)) + encoded
        body += b"PK\x03\x04" + common + encoded + entry.data
    count = len(entries)
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, count, count, len(directory), len(body), 0)
    return bytes(body + directory + end)


def deflate(data: bytes) -> Deflated:
    """Compress."""
    compressor = zlib.compressobj(4, zlib.DEFLATED, -zlib.MAX_WBITS)
    return Deflated(data=compressor.compress(data) + compressor.flush(), crc=zlib.crc32(data), size=len(data))


def _asset(stored: Stored, store: Store) -> Deflated:
    """An asset, compressed now or earlier."""
    known = store.get_json("deflated", stored.sha256)
    if known is not None:
        try:
            return Deflated(data=store.read(known["sha256"]), crc=known["crc"], size=known["size"])
        except BlobMissing:
            pass
    entry = deflate(store.read(stored.sha256))
    store.put_json("deflated", stored.sha256, {"sha256": store.put(entry.data), "crc": entry.crc, "size": entry.size})
    return entry
