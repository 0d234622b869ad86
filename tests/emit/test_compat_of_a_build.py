"""`compat`: additional readers (MJX, PyMJCF, Drake) that the models of a build support, from the workspace, the command line and the
manifest."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import pytest

import thingc
from thingc.batch import batch
from thingc.driver.pipeline import UnknownChoice
from thingc.modes import Modes
from thingc.tools.cli.main import main
from variants.robots import InThisProcess

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


def build_document(document: Path, store: str, *words: str) -> Path:
    assert main(["build", str(document), "--emit", "mjcf,mjz", "--store", store, *words]) == 0
    return document.parent / "build" / "r"


def manifest_compat(folder: Path) -> object:
    return json.loads((folder / "manifest.json").read_text())["choice"].get("compat")


def test_command_line_overrides_workspace(document: Path, shared_store: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`--compat` overrides `compat` in `thingc.toml`. The manifest records the choice, and an up-to-date build suggests a matching
    `thingc why` command."""
    model = document.parent / "build" / "r" / "mjcf" / "r_standing.xml"
    assert manifest_compat(build_document(document, shared_store)) is None
    assert 'name="left/knee"' in model.read_text()
    (document.parent / "thingc.toml").write_text('thingc = "workspace/1"\ncompat = ["pymjcf"]\n')
    assert manifest_compat(build_document(document, shared_store)) == ["pymjcf"]
    assert 'name="left.knee"' in model.read_text()
    assert manifest_compat(build_document(document, shared_store, "--compat", "drake,mjx")) == ["mjx", "drake"]
    assert 'name="left/knee"' in model.read_text()
    capsys.readouterr()
    assert manifest_compat(build_document(document, shared_store, "--compat", "mjx", "--compat", "drake")) == ["mjx", "drake"]
    said = capsys.readouterr().err
    assert "is up to date" in said
    assert f"thingc why --losses {document} --emit=mjcf,mjz --compat=mjx --compat=drake" in said


def test_losses_depend_on_selected_readers(
    document: Path, shared_store: str, capsys: pytest.CaptureFixture[str],
) -> None:
    """`thingc why --losses` lists losses of the readers selected with `--compat` or in `thingc.toml`. An unknown reader is a usage error
    with a suggestion."""
    def lost(*words: str) -> set[str]:
        assert main(["why", "--losses", str(document), "--emit", "mjcf", "--store", shared_store, *words]) == 0
        return set(capsys.readouterr().out.splitlines())

    without = lost()
    assert {tuple(line.split(": ")[-2:]) for line in lost("--compat", "drake") - without} == {
        (feature, "not supported by Drake (omitted)") for feature in ("the keyframe", "the motion at run time", "the mimic")
    }
    (document.parent / "thingc.toml").write_text('thingc = "workspace/1"\ncompat = ["pymjcf"]\n')
    assert [line.partition(": ")[2] for line in lost() - without] == [
        "mjcf: r: `/` in names: replaced by `.` for PyMJCF (approximated)",
    ]
    assert main(["why", "--losses", str(document), "--compat", "mjxx", "--store", shared_store]) == 2
    assert "did you mean `mjx`?" in capsys.readouterr().err


def test_modes_switch_between_models_for_pymjcf(document: Path, shared_store: str) -> None:
    """`modes.json` uses the link and joint names of the PyMJCF models, so states can be switched between them."""
    document.write_text(ROBOT + HOLDING)
    folder = build_document(document, shared_store, "--compat", "pymjcf")
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
    """A state can be switched between Drake models in which a link has an additional turned body as its parent."""
    document.write_text(UNIVERSAL)
    folder = build_document(document, shared_store, "--compat", "drake")
    models = {mode: mujoco.MjModel.from_xml_path(str(folder / "mjcf" / f"r_{mode}.xml")) for mode in ("bolted", "floating")}
    data = {mode: mujoco.MjData(model) for mode, model in models.items()}
    assert [models["bolted"].body(number).name for number in range(4)] == ["world", "arm", "hand:turned", "hand"]
    data["bolted"].joint("wrist_0").qpos = 0.3
    mujoco.mj_forward(models["bolted"], data["bolted"])
    Modes.load(folder).switch(("bolted", data["bolted"]), ("floating", data["floating"]))
    mujoco.mj_forward(models["floating"], data["floating"])
    assert data["floating"].joint("wrist_0").qpos[0] == pytest.approx(0.3)
    assert data["floating"].body("hand").xmat == pytest.approx(data["bolted"].body("hand").xmat, abs=1e-12)


ROLLER = """
thingc: assembly/1
name: roller
parameters: {radius: {value: 20 mm, min: 1 mm}, width: {value: 50 mm, min: 1 mm}, gap: 200 mm}
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}}
  box:
    {link: true, mass: 1 kg, inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}, shapes: [{box: 100 100 100 mm}]}
  wheel:
    link: true
    mass: 1 kg
    inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2}
    shapes: [{cylinder: {radius: =radius, length: =width}}]
joints:
  axle: {type: continuous, parent: base.origin, child: wheel.origin, gap: =gap}
  lift: {type: prismatic, parent: base.origin, child: box.origin, limit: {lower: -1 mm, upper: 1 mm}}
modes: {free: {root: base, base: free}}
"""
"""MJX does not support contacts between a cylinder and a box."""


@pytest.mark.parametrize("settings", [{}, {"gap": 0.3}, {"radius": 0.03, "width": 0.08}], ids=["plain", "gap", "size"])
def test_compat_setting_applies_to_every_entry_point(
    tmp_path: Path, shared_store: str, settings: dict[str, float], monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A build, `compile`, a family and a batch write the same model for the reader that the workspace specifies."""
    (tmp_path / "thingc.toml").write_text('thingc = "workspace/1"\ncompat = ["mjx"]\n')
    (tmp_path / "roller.yaml").write_text(ROLLER)
    document = str(tmp_path / "roller.yaml")
    words = [f"-p={name}={value} m" for name, value in settings.items()]
    assert main(["build", document, "--emit", "mjcf", "--store", shared_store, *words]) == 0
    folder = tmp_path / "build" / "roller"
    text = (folder / "mjcf" / "roller_free.xml").read_text()
    assert 'class="collision" type="mesh" mesh="prism:0"' in text
    assert thingc.compile(document, parameters=settings, store=shared_store).modes["free"].mjcf() == text
    assert "prism" not in thingc.compile(document, parameters=settings, store=shared_store, compat=()).modes["free"].mjcf()
    with thingc.family(document, store=shared_store) as family, thingc.family(document, store=shared_store, compat="pymjcf") as other:
        expected = mujoco.MjModel.from_xml_path(str(folder / "mjcf" / "roller_free.xml"))
        for model in family.models([settings] * 3, visual=True):  # by passes, then by a plan
            assert model.mesh("prism:0").id == 0 and (model.mesh_vert == expected.mesh_vert).all()
            assert (model.body_pos == expected.body_pos).all()
        assert other.model(settings).nmesh == 0
        assert family.write({name: f"{value} m" for name, value in settings.items()}, tmp_path / "written" / "roller", emit="mjcf") == ()
    found = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    own = tmp_path / "written" / "roller"
    assert {path.relative_to(own): path.read_bytes() for path in own.rglob("*") if path.is_file()} == found
    listed = ", ".join(f"{name}: [{value} m]" for name, value in (settings or {"gap": 0.2}).items())
    (tmp_path / "rollers.yaml").write_text(
        f"thingc: variants/1\nassembly: roller.yaml\nname: rollers\nemit: [mjcf]\nparameters: {{{listed}}}\n"
    )
    monkeypatch.setattr(batch, "LocalExecutor", InThisProcess)
    assert main(["batch", str(tmp_path / "rollers.yaml"), "--store", shared_store, "--pictures", "none"]) == 0
    (built_alone,) = (tmp_path / "build" / "rollers").glob("**/roller_free.xml")
    assert built_alone.read_text().partition("<mujoco")[2] == text.partition("<mujoco")[2]


def test_unknown_reader_is_rejected_with_suggestion(document: Path) -> None:
    """`compile` and `family` raise `UnknownChoice` with the closest reader name."""
    for use in (thingc.compile, thingc.family):
        with pytest.raises(UnknownChoice, match="did you mean `mjx`"):
            use(str(document), compat=["mjxx"])
