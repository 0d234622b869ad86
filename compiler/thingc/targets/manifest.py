"""Write `manifest.json`, which lists the contents and the sources of a build folder. thingc uses the manifest to check the folder and to
replace it.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Mapping, Sequence

from thingc import __version__
from thingc.base.installed_packages import distribution_versions
from thingc.documents.workspace import Workspace
from thingc.model.assembly.types import Assembly
from thingc.model.resolve.resolver import Settings
from thingc.targets import json_writer
from thingc.targets.artifact import MANIFEST, Content, Loss, StoredArtifact

DISTRIBUTIONS = ("build123d", "cadquery-ocp-novtk", "cadquery-ocp", "mujoco", "trimesh")
"""Names of distributions whose version affects a build, in addition to thingc. Distributions that are not installed are omitted."""


def manifest(
    assembly: Assembly, *, document: str, documents: Mapping[str, str], settings: Settings, modes: Sequence[str], emit: Sequence[str],
    compat: Sequence[str], files: Mapping[str, Content], losses: Sequence[Loss], workspace: Workspace,
) -> bytes:
    """Create the content of the file `manifest.json` as bytes.

    `document` and the keys of `documents` are paths in the workspace. The values of `documents` are the SHA-256 of the files. `modes`
    contains the names of the modes in document order, `emit` the names of targets and `compat` the names of programs that read MuJoCo
    models, both in the order of their tables. `files` contains all other files of the build folder. The result does not depend on the
    order of the mappings. Raises `ValueError` if `files` already contains a manifest.
    """
    if MANIFEST in files:
        raise ValueError(f"{MANIFEST} cannot list itself")
    links = assembly.links
    return json_writer.encode(
        {
            "name": assembly.name,
            "document": document,
            "choice": {
                "modes": modes,
                "emit": emit,
                **({"compat": compat} if compat else {}),
                "parameters": dict(sorted(settings.parameters.items())),
                "choices": dict(sorted(settings.choices.items())),
            },
            "versions": versions(),
            "documents": dict(sorted(documents.items())),
            "files": {path: sha256_of(content) for path, content in sorted(files.items())},
            "occurrences": [
                {
                    "path": occurrence.path,
                    "definition": occurrence.definition.text,
                    "link": links[assembly.link_of[occurrence.index]].name,
                    "mass": occurrence.properties.mass,
                    "mass_source": occurrence.mass_source,
                }
                for occurrence in assembly.occurrences
            ],
            "losses": [loss_entry(loss, workspace) for loss in losses],
        }
    )


def loss_entry(loss: Loss, workspace: Workspace) -> dict[str, object]:
    """Convert an export loss to a JSON object, as in the manifest and in `--format json`.

    `file` (relative to the workspace) and `line` are null if the location is unknown.
    """
    return {
        "target": loss.target,
        "mode": loss.mode,
        "path": loss.path,
        "what": loss.what,
        "how": loss.how,
        "file": workspace.relative(loss.span.file) if loss.span is not None else None,
        "line": loss.span.line if loss.span is not None else None,
    }


def sha256_of(content: Content) -> str:
    """Return the hexadecimal SHA-256 of the content of a file. For a file in the store, the known hash is returned."""
    return content.sha256 if isinstance(content, StoredArtifact) else hashlib.sha256(content).hexdigest()


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the installed versions of Python, thingc and `DISTRIBUTIONS` by name. The result is cached.

    If the import path contains several versions of a distribution, the first version is returned.
    """
    installed = distribution_versions(sys.path)
    versions = {name: installed[key] for name in DISTRIBUTIONS if (key := name.replace("-", "_")) in installed}
    own = {"thingc": __version__, "python": ".".join(map(str, sys.version_info[:3]))}
    return dict(sorted({**versions, **own}.items()))
