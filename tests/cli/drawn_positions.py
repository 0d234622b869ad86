"""Record the joint positions in which `thingc render` draws a robot, instead of drawing pictures."""

from __future__ import annotations

import mujoco
import pytest

from thingc.targets.render.picture import pose_model
from thingc.tools.cli import render


def record_positions(monkeypatch: pytest.MonkeyPatch) -> list[list[float]]:
    """Replace the renderer. Return a list that will contain the positions `qpos` of each picture, as MuJoCo reads them from the model."""
    drawn: list[list[float]] = []

    def picture(xml: str, assets: dict[str, bytes], *, pose: str, **_: object) -> bytes:
        drawn.append(pose_model(mujoco.MjModel.from_xml_string(xml, assets), pose).qpos.tolist())
        return b""

    monkeypatch.setattr(render, "ready", lambda: None)
    monkeypatch.setattr(render, "picture", picture)
    return drawn
