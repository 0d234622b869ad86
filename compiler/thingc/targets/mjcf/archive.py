"""`.mjz`: a model and its meshes in one zip file that MuJoCo opens, the same bytes every time.

`MjSpec.encode` writes the clock and six digits. Python's `zipfile` would compress the meshes anew for every mode and every
edit; here each is compressed once and kept in the store.
"""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.zip_files import MODEL, ZipEntry, deflate, zipped
from thingc.geometry.store.local import BlobMissing, Store
from thingc.targets.artifact import Artifacts, StoredArtifact
from thingc.targets.mjcf.emit import models
from thingc.targets.request import EmitRequest


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


def archive(model: bytes, assets: Mapping[str, StoredArtifact], store: Store) -> bytes:
    """The zip file: the model, and each asset as `assets/<file>`."""
    return zipped({MODEL: model, **{f"assets/{file}": _asset(stored, store) for file, stored in assets.items()}})


def _asset(stored: StoredArtifact, store: Store) -> ZipEntry:
    """An asset, compressed now or earlier."""
    deflated = store.get_json("deflated", stored.sha256)
    if deflated is not None:
        try:
            return ZipEntry(data=store.read(deflated["sha256"]), crc=deflated["crc"], size=deflated["size"])
        except BlobMissing:
            pass
    entry = deflate(store.read(stored.sha256))
    store.put_json("deflated", stored.sha256, {"sha256": store.put(entry.data), "crc": entry.crc, "size": entry.size})
    return entry
