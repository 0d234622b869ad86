"""The inputs of parts are determined without running their code."""

from __future__ import annotations

import os
from typing import Any

import pytest

from thingc.tools.affected.dependents import part_inputs


@pytest.mark.parametrize("trusted", [True, False])
def test_inputs_include_imports_and_missing_modules(place: Any, trusted: bool) -> None:
    arm = place.write("parts/arm.py", "import sizes\nfrom thingc import Thing\nraise SystemExit('run')\nclass Arm(Thing): ...\n")
    sizes = place.write("parts/sizes.py", "A = 1\n")
    other = place.write("parts/other.py", "B = 1\n")
    store = place.store if trusted else None
    files, folders = part_inputs(["arm:Arm"], place.workspace, store)
    assert {str(arm), str(sizes), str(place.root / "parts.lock.json")} <= files
    assert str(other) not in files
    assert folders == (str(place.parts),)
    missing, folders_of_missing = part_inputs(["arm:Arm", "gone:Gone"], place.workspace, store)
    assert files | {str(place.parts / "gone.py")} <= missing
    assert str(other) in missing, "a class `Gone` in it would be suggested"
    assert folders_of_missing == folders


def test_library_parts_read_no_workspace_folder(place: Any) -> None:
    _, folders = part_inputs(["thingc_stock.fasteners:Screw"], place.workspace, place.store)
    assert folders == ()
    assert part_inputs([], place.workspace, None)[0] == {os.path.join(place.workspace.root, "parts.lock.json")}
