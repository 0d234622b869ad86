"""The declaration of a target. Each target declares itself in the `__init__.py` of its folder."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct


class Target(FrozenStruct):
    """A target: its name, its files, and its emitter.

    `position` determines the order in which a build writes targets. `says` is a short description. `emitter` is a reference of the form
    `module:function`, and `writes` contains patterns of file paths. `files` contains a description for each file path. The
    documentation shows them in the picture of the build folder. A path that ends with `/` represents all files below the folder. NAME, MODE
    and DEFINITION represent names. Set `numbers_in_text` to True if numbers that depend on settings only occur in text, and not in binary
    data or in a layout. Batches can then insert other numbers into the files instead of calling the emitter again.

    If `unasked` is True, the target is also written by builds without `--emit`. `capabilities` is the module that contains the
    `CAPABILITIES` of a format for whole robots. If `by_name` is True, custom names are applied, because readers refer to elements of these
    files by name. `libraries` lists modules of other packages that the emitter imports. These modules can be imported early.
    """

    position: int
    says: str
    emitter: str
    writes: tuple[str, ...]
    files: Mapping[str, str]
    numbers_in_text: bool
    unasked: bool = True
    capabilities: str | None = None
    by_name: bool = False
    libraries: tuple[str, ...] = ()
