"""The declaration of a target, which the `__init__.py` of each target's folder contains."""

from __future__ import annotations

from collections.abc import Mapping

from thingc.base.frozen_struct import FrozenStruct


class Target(FrozenStruct):
    """A target: its name, its files, and its emitter.

    `position` is the position of the target in the order in which a build writes targets. `says` is a short description, `emitters` are
    references of the form `module:function`, and `writes` are patterns of file paths. `files` describes the files by path, for the
    picture of the build folder in the documentation. A path that ends with `/` stands for all files below it; NAME, MODE and DEFINITION
    stand for names. If `numbers_in_text` is True, numbers that depend on settings occur only in text, not in binary data or in a
    layout. For other settings, a batch then inserts other numbers into the files.

    If `unasked` is True, builds without `--emit` write the target. `capabilities` is the module with the `CAPABILITIES` of a format for
    whole robots. If `by_name` is True, custom names are applied, because readers of the files use names. `libraries` are the modules of
    other packages that the emitters import; these modules can be imported early.
    """

    position: int
    says: str
    emitters: tuple[str, ...]
    writes: tuple[str, ...]
    files: Mapping[str, str]
    numbers_in_text: bool
    unasked: bool = True
    capabilities: str | None = None
    by_name: bool = False
    libraries: tuple[str, ...] = ()
