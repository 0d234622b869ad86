"""What a compilation has read, and what it depends on: for `driver/up_to_date.py` and `tools/live/`."""

from __future__ import annotations

import os

from thingc.driver.environment import Environment
from thingc.driver.pipeline import Compilation


def inputs(environment: Environment, compilation: Compilation) -> dict[str, str | None] | None:
    """Everything that a compilation without errors has read, by absolute path, with its content's digest (see `up_to_date.state_of`).

    None where a file changed while it was being read: nobody knows which content the answer is of.
    """
    from thingc.driver.up_to_date import state_of

    workspace, documents = environment.workspace, compilation.documents
    assert workspace is not None and documents is not None
    states = {**workspace.inputs, **{document.path: document.sha256 for document in documents.by_path.values()}}
    states.update({path: state_of(path, environment.store) for path in looked_at(environment, compilation) if path not in states})
    changed = any(state is not None and os.stat(path).st_mtime_ns >= environment.started for path, state in states.items())
    return None if changed else states


def looked_at(environment: Environment, compilation: Compilation) -> set[str]:
    """Absolute paths of everything that a compilation, sound or not, depends on in the workspace and in packages tracked by content: files
    and folders, there or not."""
    from thingc.documents.workspace import settings_files
    from thingc.model.resolve.choices import chosen_files

    workspace, documents = environment.workspace, compilation.documents
    paths = {environment.document, *(workspace.inputs if workspace is not None else settings_files(environment.document))}
    if workspace is not None:
        paths.update(environment.parts.inputs, chosen_files(compilation.settings.choices, environment.document))
    if documents is not None:
        paths.update(documents.files, (document.path for document in documents.by_path.values()))
    return paths
