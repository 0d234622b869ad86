"""Who besides MuJoCo shall read the models of a build: what the workspace says, what the command line says, and what is remembered."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import pytest

from thingc.cli.main import main
from thingc.modes import Modes

LEG = """
thingc: assembly/1
name: leg
components:
  hip: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
  foot: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
joints:
  knee: {type: screw, parent: hip.origin, child: foot.origin, lead: 2 mm, limit: {lower: -1 rad, upper: 1 rad}}
mounts: {sole: foot.origin, top: hip.origin}
"""
UNIVERSAL = """
thingc: assembly/1
name: r
components:
  arm: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
  aside: {frame: true, at: {in: arm.origin, xyz: 0 0 10 mm, rpy: 90 0 30 deg}}
  hand: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
joints: {wrist: {type: universal, parent: aside.origin, child: hand.origin}}
modes:
  bolted: {root: arm, base: fixed}
  floating: {root: arm, base: free}
"""
ROBOT = """
thingc: assembly/1
name: r
components:
  left: {assembly: leg.yaml}
  right: {assembly: leg.yaml, attach: {top: left.top}}
poses: {bent: {left.knee: 0.5 rad}}
modes:
  standing: {root: left.sole, base: held, pose: bent}
  floating: {root: left.top, base: free, pose: bent}
"""
HOLDING = "  holding: {root: left.sole, base: held, pose: bent, hold: {right.sole: here}}\n"


@pytest.fixture
def document(tmp_path: Path) -> Path:
    (tmp_path / "leg.yaml").write_text(LEG)
    (tmp_path / "r.yaml").write_text(ROBOT)
    return tmp_path / "r.yaml"


def built(document: Path, store: str, *words: str) -> Path:
    assert main(["build", str(document), "--emit", "mjcf,mjz", "--store", store, *words]) == 0
    return document.parent / "build" / "r"


def chosen(folder: Path) -> object:
    return json.loads((folder / "manifest.json").read_text())["choice"].get("compat")


def test_the_command_line_counts_before_the_workspace(document: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    model = document.parent / "build" / "r" / "mjcf" / "r_standing.xml"
    assert chosen(built(document, shared_store)) is None
    assert 'name="left/knee"' in model.read_text()
    (document.parent / "thingc.toml").write_text('thingc = "workspace/1"\ncompat = ["pymjcf"]\n')
    assert chosen(built(document, shared_store)) == ["pymjcf"]
    assert 'name="left.knee"' in model.read_text()
    assert chosen(built(document, shared_store, "--compat", "drake,mjx")) == ["mjx", "drake"]
    assert 'name="left/knee"' in model.read_text()
    capsys.readouterr()
    assert chosen(built(document, shared_store, "--compat", "mjx", "--compat", "drake")) == ["mjx", "drake"]
    said = capsys.readouterr().err
    assert "nothing changed" in said
    assert f"thingc why --losses {document} --emit=mjcf,mjz --compat=mjx --compat=drake" in said


def test_losses_are_those_of_the_readers_that_are_asked_for(
    document: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    def lost(*words: str) -> set[str]:
        assert main(["why", "--losses", str(document), "--emit", "mjcf", "--store", shared_store, *words]) == 0
        return set(capsys.readouterr().out.splitlines())

    without = lost()
    assert {line.split(": ")[-2] for line in lost("--compat", "drake") - without} == {"Drake leaves it out"}
    (document.parent / "thingc.toml").write_text('thingc = "workspace/1"\ncompat = ["pymjcf"]\n')
    assert [line.partition(": ")[2] for line in lost() - without] == [
        "mjcf: r: `/` in names, which PyMJCF refuses: they have `.` in its place: approximated",
    ]
    assert main(["why", "--losses", str(document), "--compat", "mjxx", "--store", shared_store]) == 2
    assert "did you mean `mjx`?" in capsys.readouterr().err


def test_modes_switch_between_models_for_pymjcf(document: Path, shared_store: str) -> None:
    """`modes.json` names links and joints as the models beside it do; joints keep their paths for who asks."""
    document.write_text(ROBOT + HOLDING)
    folder = built(document, shared_store, "--compat", "pymjcf")
    modes = Modes.load(folder)
    models = {
        mode: mujoco.MjModel.from_xml_path(str(folder / "mjcf" / f"scene_{mode}.xml")) for mode in ("standing", "floating", "holding")
    }
    data = {mode: mujoco.MjData(model) for mode, model in models.items()}
    mujoco.mj_resetDataKeyframe(models["standing"], data["standing"], 0)
    mujoco.mj_forward(models["standing"], data["standing"])
    modes.switch(("standing", data["standing"]), ("floating", data["floating"]))
    mujoco.mj_forward(models["floating"], data["floating"])
    assert data["floating"].joint("left.knee").qpos[0] == pytest.approx(0.5)
    for mode in data:
        assert not any("/" in models[mode].body(number).name for number in range(models[mode].nbody))
    places = [state.site("right.sole").xpos.tolist() for state in data.values()]
    assert places[0] == pytest.approx(places[1], abs=1e-12)
    data["holding"].mocap_pos[:] = 5.0
    modes.switch(("floating", data["floating"]), ("holding", data["holding"]), on_motion="drop")
    mujoco.mj_forward(models["holding"], data["holding"])
    assert data["holding"].body("right.sole:held").xpos == pytest.approx(places[0], abs=1e-12)


def test_modes_switch_between_models_for_drake(document: Path, shared_store: str) -> None:
    """Where a link stands in a body that is turned in its place, it hangs on the link before it all the same."""
    document.write_text(UNIVERSAL)
    folder = built(document, shared_store, "--compat", "drake")
    models = {mode: mujoco.MjModel.from_xml_path(str(folder / "mjcf" / f"r_{mode}.xml")) for mode in ("bolted", "floating")}
    data = {mode: mujoco.MjData(model) for mode, model in models.items()}
    assert [models["bolted"].body(number).name for number in range(4)] == ["world", "arm", "hand:turned", "hand"]
    data["bolted"].joint("wrist_0").qpos = 0.3
    mujoco.mj_forward(models["bolted"], data["bolted"])
    Modes.load(folder).switch(("bolted", data["bolted"]), ("floating", data["floating"]))
    mujoco.mj_forward(models["floating"], data["floating"])
    assert data["floating"].joint("wrist_0").qpos[0] == pytest.approx(0.3)
    assert data["floating"].body("hand").xmat == pytest.approx(data["bolted"].body("hand").xmat, abs=1e-12)
