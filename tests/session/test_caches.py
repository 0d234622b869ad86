"""The memory of a session does not grow with the number of variants."""

from __future__ import annotations

from pathlib import Path

import pytest

from thingc.driver.environment import Options
from thingc.driver.session import Session
from thingc.model.resolve.resolver import Settings


def test_caches_do_not_grow(shared_store: str, tmp_path: Path) -> None:
    """The number of cached results and records does not grow with variants that build no parts, whatever their values."""
    document = tmp_path / "scale.yaml"
    document.write_text(
        "thingc: assembly/1\nname: scale\nparameters: {mass: 1 kg, lift: 0 deg}\n"
        "components:\n"
        "  base: {frame: true, mass: 1 kg}\n"
        "  pan: {frame: true, mass: =mass, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}\n"
        "joints: {beam: {type: revolute, parent: base.origin, child: pan.origin, limit: {lower: -1 rad, upper: 1 rad}}}\n"
        "poses: {up: {beam: =lift}}\n"
    )
    sizes = []
    with Session(str(document), Options(store=shared_store)) as session:
        for index in range(60):
            compilation = session.compile(Settings(parameters={"mass": f"{1 + index} kg", "lift": f"{index / 2} deg"}))
            assert not session.emit(compilation, ["mjcf", "bom"])["mjcf"].losses
            assert compilation.assembly is not None
            assert compilation.assembly.properties.mass == pytest.approx(2.0 + index)
            sizes.append(len(session.environment.memo._entries))
    assert sizes[2] == sizes[-1]
