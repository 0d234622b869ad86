"""From a document through every pass to MuJoCo, and from MuJoCo's messages back to the line. Components are frames, so no part is
modelled."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import Compilation
from thingc.targets.artifact import Artifacts

BALL = "inertia: {ixx: 1e-3 kg*m^2, iyy: 1e-3 kg*m^2, izz: 1e-3 kg*m^2}"
DOCUMENT = f"""\
thingc: assembly/1
name: swing
components:
  post: {{frame: true, mass: 1 kg, {BALL}, mounts: {{top: {{xyz: 0 0 1 m}}}}}}
  bob: {{frame: true, mass: 2 kg, {BALL}, mounts: {{eye: {{xyz: 0 0 200 mm}}}}}}
joints:
  hook:
    type: revolute
    parent: post.top
    child: bob.eye
    limit: {{lower: -90 deg, upper: 90 deg}}
    drive: {{kind: position, kp: 5 N*m/rad, effort: 2 N*m, velocity: 3 rad/s}}
poses:
  cocked: {{hook: 30 deg}}
modes:
  standing: {{root: post, pose: cocked, simulation: {{integrator: rk4}}}}
  gripped: {{root: bob.eye, base: held}}
simulation: {{timestep: 1 ms, cone: elliptic}}
raw:
  mjcf:
    joint:
      hook: {{armature: 0.01, RAW}}
    option: {{iterations: 17}}
"""


def compile_document(folder: Path, text: str) -> tuple[Compilation, Artifacts | None]:
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    folder.joinpath("swing.yaml").write_text(text)
    with Environment(str(folder / "swing.yaml"), Options(store=str(folder / "store"))) as environment:
        compilation = pipeline.compile(environment)
        return compilation, None if compilation.report.failed else pipeline.build(environment, compilation, ["mjcf"])["mjcf"]


def test_document_compiles_to_mujoco_models(tmp_path: Path) -> None:
    """Options, limits, keyframes, bases and losses of the document appear in the compile_document models."""
    compilation, artifacts = compile_document(tmp_path, DOCUMENT.replace("RAW", "margin: 0.2"))
    assert compilation.report.diagnostics == [] and artifacts is not None
    standing, gripped = (
        mujoco.MjModel.from_xml_string(artifacts.files[f"mjcf/swing_{mode}.xml"].decode())  # type: ignore[union-attr]
        for mode in ("standing", "gripped")
    )
    assert (standing.opt.timestep, standing.opt.integrator) == (0.001, mujoco.mjtIntegrator.mjINT_RK4)
    assert (gripped.opt.cone, gripped.opt.iterations) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 17)
    assert standing.joint("hook").margin == 0.2
    np.testing.assert_allclose(standing.key("cocked").qpos, [np.pi / 6])
    np.testing.assert_allclose(standing.actuator("hook").forcerange, [-2.0, 2.0])
    assert gripped.nmocap == 1 and standing.nmocap == 0
    for model in (standing, gripped):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        eye, post = data.site("bob/eye"), data.body("post")
        # The eye sits on top of the post, whoever stands still.
        np.testing.assert_allclose(eye.xpos, post.xpos + post.xmat.reshape(3, 3) @ [0, 0, 1.0], atol=1e-12)
    assert [(loss.path, loss.what, loss.span.line if loss.span else None) for loss in artifacts.losses] == [
        ("hook", "the velocity limit of 3 rad/s", 7)
    ]


@pytest.mark.parametrize(
    ("attribute", "message"),
    [
        ("limitted: true", "MuJoCo rejects `limitted` of joint `hook`: unrecognized attribute: 'limitted'"),
        ("solreflimit: 1 abc", "MuJoCo rejects `solreflimit` of joint `hook`: bad format in attribute 'solreflimit'"),
    ],
)
def test_mujoco_errors_point_into_the_document(tmp_path: Path, attribute: str, message: str) -> None:
    text = DOCUMENT.replace("RAW", attribute)
    compilation, _ = compile_document(tmp_path, text)
    (found,) = compilation.report.sorted_diagnostics()
    assert (found.code.code, found.message) == ("TC702", message)
    assert found.span is not None and found.span.file == str(tmp_path / "swing.yaml")
    line = text.splitlines()[found.span.line - 1]
    assert line[found.span.column - 1 :].startswith(attribute.partition(": ")[2])
