"""Setting a value of a drive that a part or `defaults` declares gives the same model as writing it into the document."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import pytest

import thingc
from thingc.batch.families import NoModel
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.driver.edit_document import write_values
from thingc.driver.environment import Options

PARTS = """\
    from build123d import Box, Location
    from thingc import Actuator, MountPoint, Thing


    class Servo(Thing):
        actuator = Actuator(kind="position", stall_torque=2.0, no_load_speed=5.0, kp=2.0, rotor_inertia=1e-6, gear_ratio=100)

        def __init__(self) -> None:
            self.horn = MountPoint(Location((0, 0, 15)))

        def result(self):
            return Box(20, 20, 30)

        def mass(self):
            return 0.05
"""

LEG = """\
thingc: assembly/1
name: leg
components:
  hip: {part: "m:Servo"}
  foot: {frame: true, mass: 0.2 kg, inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}}
joints:
  knee: {type: revolute, parent: hip.horn, child: foot.origin, limit: {lower: -1 rad, upper: 1 rad}, drive: hip}
mounts: {top: hip.origin}
"""

ARM = """\
thingc: assembly/1
name: arm
defaults: {joint: {limit: {lower: -1 rad, upper: 1 rad}, drive: {kind: position, kp: 5 N*m/rad, effort: 3 N*m}}}
components:
  servo: {part: "m:Servo"}
  arm: {frame: true, mass: 0.3 kg, inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}}
  tip: {frame: true, mass: 0.1 kg, inertia: {ixx: 0.001 kg*m^2, iyy: 0.001 kg*m^2, izz: 0.001 kg*m^2}}
  leg: {assembly: leg.yaml, at: {in: tip.origin, xyz: 0 0 100 mm}}
joints:
  hinge: {type: revolute, parent: servo.horn, child: arm.origin, drive: servo}
  wrist: {type: revolute, parent: arm.origin, child: tip.origin}
modes: {standing: {root: servo, base: fixed}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    (folder / "parts").mkdir()
    (folder / "parts/m.py").write_text(textwrap.dedent(PARTS))
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\n')
    (folder / "arm.yaml").write_text(ARM)
    (folder / "leg.yaml").write_text(LEG)
    return folder


@pytest.fixture(scope="module")
def arm(folder: Path) -> Iterator[thingc.RobotFamily]:
    with thingc.family(folder / "arm.yaml", verify=0) as family:
        yield family


CASES: list[tuple[dict[str, float], str, str]] = [
    ({"joints.hinge.drive.kp": 3.5}, "drive: servo", "drive: {component: servo, kp: 3.5 N*m/rad}"),
    ({"joints.hinge.drive.kv": 0.25, "joints.hinge.drive.effort": 1.5}, "drive: servo",
     "drive: {component: servo, kv: 0.25 N*m*s/rad, effort: 1.5 N*m}"),
    ({"joints.hinge.drive.armature": 0.003}, "drive: servo", "drive: {component: servo, armature: 0.003 kg*m^2}"),
    ({"joints.wrist.drive.kp": 6.5}, "child: tip.origin", "child: tip.origin, drive: {kind: position, kp: 6.5 N*m/rad, effort: 3 N*m}"),
    ({"components.leg.joints.knee.drive.kp": 7.25}, "drive: hip", "drive: {component: hip, kp: 7.25 N*m/rad}"),
]


def written(folder: Path, name: str, old: str, new: str) -> mujoco.MjModel:
    """Return the model of documents in which `new` replaces `old`."""
    leg = f"leg_{name}.yaml"
    (folder / leg).write_text(LEG.replace(old, new))
    (folder / f"{name}.yaml").write_text(ARM.replace("leg.yaml", leg).replace(old, new))
    return thingc.compile(folder / f"{name}.yaml", modes=["standing"]).modes["standing"].model()


@pytest.mark.parametrize("case", range(len(CASES)))
def test_set_value_equals_written_value(arm: thingc.RobotFamily, folder: Path, case: int) -> None:
    settings, old, new = CASES[case]
    (own,) = arm.models([{}], mode="standing", visual=True)
    whole = written(folder, f"written_{case}", old, new)
    assert isinstance(own, mujoco.MjModel) and different_fields(own, whole)
    for _ in range(4):  # compiled, then by a plan
        (model,) = arm.models([settings], mode="standing", visual=True)
        assert isinstance(model, mujoco.MjModel), model
        assert different_fields(model, whole) == []
    assert {arm.explain(name).way for name in settings} == {"arrays"}


def test_star_includes_drives_of_parts_and_defaults(arm: thingc.RobotFamily) -> None:
    (model,) = arm.models([{"joints.*.drive.kp": 4.0}], mode="standing", visual=True)
    assert isinstance(model, mujoco.MjModel) and model.actuator_gainprm[:, 0].tolist() == [4.0] * 3


@pytest.mark.parametrize(("settings", "words"), [
    ({"joints.hinge.drive.kp": -1.0}, "`drive.kp` of joint `hinge` must be at least 0"),
    ({"joints.hinge.drive.kpp": 1.0}, "unknown key `kpp` in `joints.hinge.drive`"),
    ({"joints.elbow.drive.kp": 1.0}, "`joints` has no key `elbow`"),
    ({"joints.hinge.drive.kp": "1 kg"}, "found a mass (`1 kg`)"),
])
def test_wrong_value_is_reported_at_the_setting(arm: thingc.RobotFamily, settings: dict[str, Any], words: str) -> None:
    (refused,) = arm.models([settings], mode="standing", visual=True)
    assert isinstance(refused, NoModel)
    (problem,) = refused.problems
    assert words in problem.message and problem.path is not None and problem.path.startswith(f"--set {next(iter(settings))}")


@pytest.mark.parametrize(("old", "values", "new"), [
    ("drive: servo", {"joints.hinge.drive.kp": "3 N*m/rad", "joints.hinge.drive.kv": "1 N*m*s/rad"},
     "drive: {component: servo, kp: 3 N*m/rad, kv: 1 N*m*s/rad}"),
    ("child: tip.origin}", {"joints.wrist.drive.kp": "3 N*m/rad"},
     "child: tip.origin, drive: {kind: position, kp: 3 N*m/rad, effort: 3 N*m}}"),
])
def test_value_is_written_next_to_its_component(folder: Path, old: str, values: dict[str, str], new: str) -> None:
    document = folder / "kept.yaml"
    document.write_text(ARM)
    written = write_values(str(document), values, Options())
    assert written.done, written.found
    assert document.read_text() == ARM.replace(old, new)
