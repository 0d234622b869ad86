"""Verification by sampling: of models that differ only in numbers, MuJoCo compiles the first and then every n-th."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from thingc.driver.environment import Options
from thingc.driver.session import Session
from thingc.model.resolve.resolver import Settings
from thingc.targets.mjcf import verify

DOCUMENT = """\
thingc: assembly/1
name: scale
parameters: {mass: 1 kg, lift: 1 deg, stiff: false}
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
  pan: {frame: true, mass: =mass, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}
joints: {beam: {type: revolute, parent: base.origin, child: pan.origin, limit: {lower: -1 rad, upper: 1 rad}}}
poses: {up: {beam: =lift}}
modes: {still: {root: base}, loose: {root: pan, base: free}}
"""


@pytest.mark.parametrize(("share", "asked"), [(0, []), (1, [2] * 9), (4, [2, 0, 0, 0, 2, 2, 0, 0, 0])])
def test_every_nth_model_is_verified(
    share: int, asked: list[int], tmp_path: Path, shared_store: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The sequence of verified models for each interval. A change of structure starts again with a verification."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "scale.yaml").write_text(DOCUMENT)
    found: list[int] = []
    doubtful = verify.remaining

    def counting(candidates: Any, *arguments: Any, **named: Any) -> Any:
        found.append(len(candidates))
        return doubtful(candidates, *arguments, **named)

    monkeypatch.setattr(verify, "remaining", counting)
    with Session(str(tmp_path / "scale.yaml"), Options(store=shared_store)) as session:
        assert session.sources is not None, session.report.sorted_diagnostics()
        for index in range(9):
            choices = {"joints.beam.dynamics.damping": "1 N*m*s/rad"} if index == 5 else {}  # which makes it a model of another kind
            compilation = session.compile(Settings(parameters={"mass": f"{1 + index / 8} kg", "lift": f"{1 + index} deg"}, choices=choices))
            artifacts = session.emit(compilation, ["mjcf"], verify=share)
            assert not compilation.report.diagnostics and len(artifacts["mjcf"].files) == 6
    assert found == asked


def test_rejected_models_are_verified_each_time(tmp_path: Path, shared_store: str) -> None:
    """Sampling starts only after a model of the kind was accepted."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (tmp_path / "scale.yaml").write_text(DOCUMENT + "raw: {mjcf: {joint: {beam: {solimplimit: 1 2 3 4 5 6 7}}}}\n")
    with Session(str(tmp_path / "scale.yaml"), Options(store=shared_store)) as session:
        for index in range(3):
            compilation = session.compile(Settings(parameters={"mass": f"{1.5 + index} kg"}))
            session.emit(compilation, ["mjcf"], verify=64)
            assert [one.code.code for one in compilation.report.diagnostics] != []
