"""Read the mechanisms of the two sides of a comparison: documents, model files of other formats, build folders or git revisions."""

from __future__ import annotations

import os

from thingc.base.diagnostics import Severity
from thingc.driver.environment import Options
from thingc.modes.errors import ModesError
from thingc.modes.modes_file import load_modes
from thingc.tools.diff.arguments import REBUILD, UnknownComparison
from thingc.tools.diff.cached_snapshots import BrokenDocument
from thingc.tools.diff.checkouts import Checkout, DocumentPair, broken_side, read_completely, subject
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.imported_document import compile_robot
from thingc.tools.same.mechanism import Mechanism, mechanism_of_assembly, mechanism_of_mode

NO_MESHES = ImportRequest(meshes=False)


def mechanisms(pair: DocumentPair, names: tuple[str, str], options: Options, source: ImportRequest) -> tuple[Mechanism, Mechanism]:
    """Read both mechanisms of a pair.

    `names` are the names of the sides in diagnostics, and `source` the options for reading robot files. Raises `BrokenSide` and
    `UnknownComparison`.
    """
    found: list[Mechanism] = []
    for laid, name in zip((pair.old, pair.new), names, strict=True):
        if laid is None:
            raise UnknownComparison(f"`{pair.name}` does not exist in {name}", "compare documents that exist in both revisions")
        try:
            found.append(read_side(laid, options, source))
        except BrokenDocument as broken:
            raise broken_side(laid, name, broken) from broken
    return found[0], found[1]


def read_side(laid: Checkout, options: Options, source: ImportRequest = NO_MESHES) -> Mechanism:
    """Read the mechanism of one side. Raises `BrokenDocument` and `UnknownComparison`."""
    match laid.kind:
        case "build":
            try:
                modes = load_modes(laid.path)
            except (FileNotFoundError, ModesError) as fault:
                raise UnknownComparison(str(fault), REBUILD) from fault
            return mechanism_of_mode(os.path.basename(laid.path), next(iter(modes.values())))
        case "lock":
            raise UnknownComparison(f"the lock file `{laid.path}` does not contain joints", "compare documents or build folders")
        case "model":
            return read_completely(laid, options, lambda: _import(laid.path, options, source))
        case _:
            with subject(laid, options) as compiled:
                return mechanism_of_assembly(compiled.assembly)


def _import(path: str, options: Options, source: ImportRequest) -> Mechanism:
    """Import a robot, and compile the document. Raises `BrokenDocument`."""
    compilation = compile_robot(path, options, source)
    if compilation.assembly is None:
        raise BrokenDocument([one for one in compilation.report.sorted_diagnostics() if one.severity is Severity.ERROR])
    return mechanism_of_assembly(compilation.assembly)
