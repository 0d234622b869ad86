"""An imported MJCF robot equals MuJoCo's reading of the same file: in fifty states, for two hundred steps, and from any root."""

from __future__ import annotations

import json
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.as_original import Pair, in_files
from importing.imports import import_cleanly, write_import
from importing.test_mjcf_names import built_from, imported_from
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.update_import import earlier_import

ROBOTS = Path(__file__).parent / "robots"
ROOTS = {
    "cables": ("drum", "hand"), "constructs": ("forearm", "hand", "left", "wheel1", "tip"), "cranks": (), "loops": ("rocker", "mast"),
    "tendons": ("thigh", "foot"), "world": ("one/arm", "two"),
}
EXACT = 1e-9
TOLERANCES = {"contacts": 1e-6, "contacts by iteration": 1e-4, "shapes": 1e-6}
LOST = {
    "cables": [
        "tendon `outside`", "tendon `within`",
    ],
    "constructs": ["`<light>`", "the softness of constraints at the reference of joint `shoulder`, 0.174533"],
    "cranks": [], "loops": ["the softness of contacts of `mast`"], "tendons": [],
    "two_arms": ["contacts of `one/arm` with `world`", "contacts of `two` with `world`"],
}


@dataclass(frozen=True)
class Case:
    imported: Imported
    spec: mujoco.MjSpec
    modes: dict[str, mujoco.MjModel]

    def pair(self, mode: str = "source") -> Pair:
        """Return the file as MuJoCo compiles it and a mode, paired by name; unnamed elements have the name that the import generates."""
        named = {
            "body": {k: self.spec.bodies[k].name for k in range(len(self.spec.bodies))},
            "site": {one.id: one.name for one in self.spec.sites},
            "tendon": {one.id: one.name or "tendon" for one in self.spec.tendons},
            "actuator": {one.id: one.name or one.target for one in self.spec.actuators},
            "joint": {one.id: one.name or f"{one.parent.name}_joint" for one in self.spec.joints},
        }
        return Pair(self.spec.compile(), self.modes[mode], named, in_files(self.imported))


@pytest.fixture(scope="module", params=sorted(ROOTS))
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    name = request.param
    imported = import_cleanly(ROBOTS / f"{name}.xml", ImportRequest(roots=ROOTS[name]))
    compiled = thingc.compile(write_import(imported, tmp_path_factory.mktemp("imported")))
    spec = mujoco.MjSpec.from_file(str(ROBOTS / f"{name}.xml"))
    spec.compile()
    return Case(imported=imported, spec=spec, modes={name: mode.model() for name, mode in compiled.modes.items()})


def test_source_mode_equals_the_source(case: Case) -> None:
    worst = case.pair().compare()
    differ = {kind for kind, far in worst.items() if not far <= TOLERANCES.get(kind, EXACT)}
    assert differ == ({"contacts"} if any(loss.what.startswith("contacts") for loss in case.imported.losses) else set()), worst
    assert {"poses", "mass matrix", "bias", "passive", "actuators", "gravity", "limits", "gains", "dynamics", "trajectory"} <= worst.keys()
    assert "contacts" in worst or case.imported.name in ("cables", "loops", "tendons")


def test_sensors_read_the_same_values(case: Case) -> None:
    """Sensors are matched by name, in states with contacts. Noise and cutoff are equal, too."""
    words = in_files(case.imported).get("sensors", {})
    pair, random = case.pair(), numpy.random.default_rng(7)
    numbers = {one.name or one.objname: one.id for one in case.spec.sensors}
    lost = {loss.what.split("`")[1] for loss in case.imported.losses if loss.what.startswith("sensor")}
    assert set(words) == {*numbers} - lost
    for _ in range(20):
        pair.put(random)
        pair.control(random)
        pair.forward()
        for name, word in words.items():
            theirs, ours = (data.sensor(of) for data, of in ((pair.a, numbers[name]), (pair.b, word)))
            assert ours.data == pytest.approx(theirs.data, abs=EXACT, rel=1e-7), name
    for name, word in words.items():
        theirs, ours = pair.theirs.sensor(numbers[name]), pair.ours.sensor(word)
        assert (float(ours.noise[0]), float(ours.cutoff[0])) == (float(theirs.noise[0]), float(theirs.cutoff[0])), name


def test_losses_are_reported(case: Case) -> None:
    assert [loss.what for loss in case.imported.losses] == LOST[case.imported.name]


def test_any_link_can_be_the_root(case: Case) -> None:
    """Compared are poses relative to the root, and the mass matrix with the root fixed."""
    names = json.loads(case.imported.files["import.json"])["names"]
    pair = case.pair()
    for name, (mode, model) in zip(ROOTS[Path(case.imported.robot.where.file).stem], [*case.modes.items()][1:], strict=True):
        assert mode == (names["links"] | names["frames"])[name]
        pair.compare_rooted(model, name)
    assert all(far <= EXACT for far in pair.worst.values()), pair.worst
    assert ("rooted mass matrix" in pair.worst) == (len(case.modes) > 1)


def test_losses_are_listed_with_their_line() -> None:
    imported = import_robot(str(ROBOTS / "floating.xml"), Report())
    assert imported is not None
    said = "".join(f"{loss.where.line}: {loss.what}: {loss.why}\n" for loss in imported.losses)
    assert said == (ROBOTS / "floating.txt").read_text()


def test_omitted_elements_are_not_written(tmp_path: Path) -> None:
    """The floating robot is imported without the elements that its losses name."""
    imported = import_robot(str(ROBOTS / "floating.xml"), Report())
    assert imported is not None
    model = thingc.compile(write_import(imported, tmp_path)).modes["source"].model()
    assert {model.body(k).name for k in range(1, model.nbody)} == {"trunk", "crank", "rod", "end", "rocker", "slider", "ball"}
    assert {model.actuator(k).name for k in range(model.nu)} == {"twist", "strong", "slider/suck", "second", "muscle", "tendon"}
    assert {model.eq(k).name for k in range(model.neq)} == {"close", "half"} and model.tendon(0).name == "pull"
    assert tuple(model.actuator("strong").gear) == (4, 0, 0, 0, 0, 0) and tuple(model.actuator("strong").forcerange) == (-0.75, 0.75)


@pytest.mark.parametrize(("steps", "why"), [
    ('<pulley divisor="2"/><site site="a"/><site site="b"/>', "the tendon starts with a pulley"),
    ('<site site="a"/><site site="b"/><pulley divisor="0"/><site site="a"/><site site="b"/>', "a pulley has the divisor 0"),
    ('<site site="a"/><site site="c"/>', "the tendon uses elements that are not imported"),
])
def test_unsupported_tendon_paths_and_their_drives_are_lost(steps: str, why: str, tmp_path: Path) -> None:
    imported = _imported(tmp_path, f"""\
<mujoco>
  <worldbody>
    <body name="arm"><joint name="j"/><joint name="k" axis="1 0 0"/><geom size="0.1"/><site name="a"/><site name="b" pos="0 0 1"/></body>
    <body name="box" mocap="true"><geom size="0.1"/><site name="c" pos="0 0 1"/></body>
  </worldbody>
  <tendon><spatial name="cord">{steps}</spatial></tendon>
  <actuator><motor name="pull" tendon="cord"/></actuator>
</mujoco>
""")
    lost = [(loss.what, loss.why) for loss in imported.losses]
    assert lost[-2:] == [("tendon `cord`", why), ("actuator `pull`", "the tendon of the actuator is not imported")]


COUPLED = """\
<mujoco>
  <compiler angle="radian"/>
  <default><geom type="capsule" fromto="0 0 0 0.1 0.2 0" size="0.02"/></default>
  <worldbody>
    <body name="a" pos="0.1 0 0"><joint name="a" axis="0 0 1" ref="0.2"/><geom/>
      <body name="b" pos="0.1 0.2 0" euler="0.4 0 0.3"><joint name="b" axis="0 1 0" ref="-0.3"/><geom/></body>
    </body>
    <body name="c" pos="0 0.3 0" euler="0 0.2 0"><joint name="c" axis="1 0 0" ref="0.5"/><geom/>
      <body name="d" pos="0.1 0.2 0"><joint name="d" axis="0 0 1" ref="-0.7"/><geom/></body>
    </body>
  </worldbody>
  <equality>
    {equality}
  </equality>
  <actuator><motor name="a" joint="a"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("equality", [
    '<joint joint1="a" joint2="b" polycoef="0.3 -1 0 0 0"/>', '<joint joint1="c" joint2="d" polycoef="0.1 0.5 -0.4 0.3 0.2"/>',
    '<connect body1="b" body2="d" anchor="0.1 0.02 0.03"/>', '<weld body1="b" body2="d"/>',
])
def test_equality_residual_equals_the_source(equality: str, tmp_path: Path) -> None:
    """At random coordinates. No `ref` is 0. `a` is driven, so it leads `b` instead."""
    imported = _imported(tmp_path, COUPLED.replace("{equality}", equality))
    source = mujoco.MjModel.from_xml_string(COUPLED.replace("{equality}", equality))
    model = thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()
    rng = numpy.random.default_rng(3)
    for _ in range(5):
        q, found = rng.uniform(-1.0, 1.0, 4), []
        for one in (source, model):
            data = mujoco.MjData(one)
            for name, value in zip("abcd", q, strict=True):
                data.joint(name).qpos[0] = value
            mujoco.mj_forward(one, data)
            found.append(numpy.linalg.norm(data.efc_pos[: data.ne]))
        assert found[0] > 0.01 and found[1] == pytest.approx(found[0], abs=1e-12)


@pytest.mark.parametrize(("joints", "equality"), [
    ('<joint name="x" type="slide" axis="1 0 1"/><joint name="y" type="ball"/>', ""),
    ('<joint name="x" axis="0 1 0" damping="1"/><joint name="y" axis="1 0 0" damping="1"/>',
     '<connect body1="tip" body2="base" anchor="0 0 0.1"/>'),
])
def test_intermediate_links_with_ball_joints_or_on_loops_get_a_small_mass(joints: str, equality: str, tmp_path: Path) -> None:
    text = f"""\
<mujoco>
  <worldbody>
    <body name="base"><geom size="0.1" contype="0"/><joint name="a" axis="0 1 1" damping="1"/>
      <body name="tip" pos="0.3 0 0.1">{joints}<geom type="box" size="0.1 0.05 0.2" pos="0.1 0 0" contype="0"/></body>
    </body>
  </worldbody>
  <equality>{equality}</equality>
</mujoco>
"""
    imported, ends = _imported(tmp_path, text), []
    assert [loss.what for loss in imported.losses if "mass" in loss.what] == ["the missing mass between the joints of body `tip`"]
    for model in (mujoco.MjModel.from_xml_string(text), thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()):
        data = mujoco.MjData(model)
        data.qvel[:] = numpy.linspace(0.5, 1.0, model.nv)
        for _ in range(50):
            mujoco.mj_step(model, data)
        ends.append(data.body("tip").xmat)
    numpy.testing.assert_allclose(ends[1], ends[0], atol=1e-5)
    assert abs(ends[0] - numpy.eye(3).ravel()).max() > 0.05


@pytest.mark.parametrize(("bodies", "why"), [
    ('body1="a" body2="fixed"', "the bodies are fixed to each other"),
    ('body1="a" body2="ball"', "documents do not support loops that contain a free joint"),
    ('body1="ball"', "the equality does not connect two links"),
])
def test_loops_that_documents_do_not_support_are_lost(bodies: str, why: str, tmp_path: Path) -> None:
    imported = _imported(tmp_path, f"""\
<mujoco>
  <worldbody>
    <body name="base"><freejoint/><geom size="0.1"/>
      <body name="a" pos="0.3 0 0"><joint axis="0 1 0"/><geom size="0.1"/>
        <body name="fixed" pos="0.3 0 0"><geom size="0.1"/></body>
      </body>
    </body>
    <body name="ball" pos="0 0 1"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <equality><connect name="tie" {bodies} anchor="0 0 0"/></equality>
</mujoco>
""")
    assert [loss.why for loss in imported.losses if loss.what == "equality `tie`"] == [why]


def test_hidden_wrapping_geom_is_not_a_shape() -> None:
    imported = import_robot(str(ROBOTS / "cables.xml"), Report())
    assert imported is not None
    shapes = {link.name: [shape.kind for shape in link.shapes] for link in imported.robot.links}
    assert shapes["drum"] == [] and shapes["bracket"] == ["cylinder"]


def _imported(folder: Path, text: str) -> Imported:
    """Import a robot from this text, and check that its document compiles."""
    (folder / "robot.xml").write_text(text)
    imported = import_cleanly(folder / "robot.xml")
    thingc.compile(write_import(imported, folder / "out"))
    return imported


def test_generated_names_do_not_collide_with_source_names(tmp_path: Path) -> None:
    """A body has the name of an intermediate link, an inline mesh has the name of a mesh file, and one name is very long."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    imported = _imported(tmp_path, f"""\
<mujoco>
  <option timestep="-1"/>
  <statistic meaninertia="2"/>
  <extension/>
  <asset><mesh name="a" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/><mesh name="b" file="a.obj"/></asset>
  <worldbody>
    <body name="arm">
      <joint name="yaw" axis="0 0 1"/><joint name="pitch" axis="0 1 0"/>
      <geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/>
      <body name="arm yaw"><joint name="{'x' * 2000}"/><geom size="0.1"/></body>
    </body>
  </worldbody>
</mujoco>
""")
    assert [(one.parent, one.child) for one in imported.robot.attachments] == [
        ("world", "arm yaw_"), ("arm yaw_", "arm"), ("arm", "arm yaw"),
    ]
    assert [name for name in imported.files if name.startswith("meshes/")] == ["meshes/a.obj", "meshes/a_2.obj"]
    assert imported.files["meshes/a_2.obj"] == (tmp_path / "a.obj").read_bytes() != imported.files["meshes/a.obj"]
    assert [loss.what for loss in imported.losses] == [
        "a `timestep` of -1", "`<statistic>`", "`<extension>`", "the original file of mesh `a`",
    ]


@pytest.mark.parametrize(("second", "exact"), [(0.4, True), (0.9, False)])
def test_gravity_compensation_of_fixed_bodies(second: float, exact: bool, tmp_path: Path) -> None:
    """Bodies that are fixed to each other, or to the world, are one link: their force has the same sum, and different values are a loss."""
    imported = _imported(tmp_path, f"""\
<mujoco>
  <worldbody>
    <geom type="box" size="1 1 0.1" pos="0 0 -3"/>
    <body name="post" gravcomp="0.9">
      <geom size="0.1"/>
      <body name="arm" gravcomp="0.4" pos="0.2 0 0">
        <joint name="lift" type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/>
        <body name="tip" gravcomp="{second}" pos="0.2 0 0"><geom size="0.05" mass="3"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
""")
    assert [loss.what for loss in imported.losses if "gravcomp" in loss.what] == [
        "the different `gravcomp` of bodies fixed to `arm`",
    ] * (not exact)
    model = thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.qfrc_gravcomp[0] == pytest.approx(9.81 * (1 * 0.4 + 3 * second), rel=1e-9)


def test_mesh_with_several_objects_collides_as_a_whole(tmp_path: Path) -> None:
    """MuJoCo uses the points of all objects for the convex hull, but only the faces of the first."""
    one = "o a\nv 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "two.obj").write_text(f"{one}o b\nv 0 0 -9\nf 1 2 5\nf 2 1 5\n")
    imported = _imported(tmp_path, """\
<mujoco>
  <asset><mesh name="two" file="two.obj"/></asset>
  <worldbody><body name="arm"><joint/><geom type="mesh" mesh="two"/></body></worldbody>
</mujoco>
""")
    assert imported.losses == () and imported.files["meshes/two.obj"] == (tmp_path / "two.obj").read_bytes()
    theirs = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    ours = thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()
    corners = []
    for model in (ours, theirs):
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        (touching,) = (k for k in range(model.ngeom) if model.geom_contype[k])
        points = model.mesh_vert @ data.geom_xmat[touching].reshape(3, 3).T + data.geom_xpos[touching]
        corners.append([points.min(axis=0), points.max(axis=0)])
    assert numpy.allclose(*corners, atol=1e-6) and (ours.nmeshface, theirs.nmeshface) == (6, 4)


@pytest.mark.parametrize(("inside", "words"), [
    ('<replicate count=" +2000000000"><geom size="0.1"/></replicate>', "the number of copies (2,000,000,000) exceeds the maximum (10,000)"),
    (f'<replicate count="9000">{"<site/>" * 12}</replicate>', "the number of elements exceeds the maximum (100,000)"),
])
def test_model_size_is_limited(inside: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody><body><joint/>{inside}</body></worldbody></mujoco>")
    report = Report()
    assert import_robot(str(tmp_path / "robot.xml"), report) is None
    assert len(report.diagnostics) == 1 and words in report.diagnostics[0].message


@pytest.mark.parametrize("said", ['inttotal="1e12"', 'timestep="1e-300"', 'timestep="0"'])
def test_muscle_length_search_is_limited(said: str, tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(f"""<mujoco><compiler><lengthrange {said}/></compiler>
<worldbody><body><joint name="j"/><geom size="1"/></body></worldbody><actuator><muscle joint="j"/></actuator></mujoco>""")
    report = Report()
    assert import_robot(str(tmp_path / "robot.xml"), report) is None
    assert [one.message for one in report.diagnostics] == ["the element requires more than 100,000 simulation steps per muscle"]


def test_mujoco_warnings_become_errors_of_a_link(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text("""<mujoco><worldbody><body name="arm"><joint/><geom size="1"/>
<body name="tip"><joint/><joint type="slide"/><joint type="slide"/><geom size="0.1" mass="1e-12"/></body></body></worldbody></mujoco>""")
    report = Report()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert import_robot(str(tmp_path / "robot.xml"), report) is None
    assert [
        one.message for one in report.diagnostics
    ] == [
        "the inertia of the moving link `tip` is invalid: the smallest moment (4e-15 kg m^2) is below the minimum of simulators "
        "(1e-14 kg m^2)",
    ]


def test_import_time_is_linear_in_the_number_of_elements(tmp_path: Path) -> None:
    """Bodies, sites and generated names are looked up by number, not by a linear search."""
    one = '<body pos="0 0 1"><joint/><geom size="0.1"/>{}</body>'
    seconds = []
    for count in (50, 500):
        text = f"<mujoco><worldbody><body><geom size='1'/><joint/>{one.format('<site/>' * 10) * count}</body></worldbody></mujoco>"
        (tmp_path / "robot.xml").write_text(text)
        began = time.process_time()
        assert import_robot(str(tmp_path / "robot.xml"), Report()) is not None
        seconds.append(time.process_time() - began)
    assert seconds[1] < 40.0 * seconds[0]


def test_import_is_deterministic(case: Case) -> None:
    again = import_robot(case.imported.robot.where.file, Report(), ImportRequest(roots=ROOTS[Path(case.imported.robot.where.file).stem]))
    assert again is not None and again.files == case.imported.files


def test_modes_start_at_a_keyframe_if_zero_is_out_of_range(tmp_path: Path) -> None:
    """The first keyframe within the limits is used. A keyframe outside the limits is clamped to them."""
    text = """\
<mujoco model="leg">
  <worldbody>
    <body name="hip"><geom size="0.1"/><body name="shin"><joint name="knee" axis="0 1 0" range="-90 -30"/><geom size="0.1"/></body></body>
  </worldbody>
  <keyframe>KEYS</keyframe>
</mujoco>
"""
    found = {}
    for keys in ('<key name="bent" qpos="-1.2"/><key name="more" qpos="-1.4"/>', '<key name="zero" qpos="0"/>', ""):
        imported = _imported(tmp_path, text.replace("KEYS", keys))
        model = thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()
        found[keys[11:15]] = [(model.key(k).name, float(model.key(k).qpos[0])) for k in range(model.nkey)][:1]
    assert found["bent"] == [("bent", -1.2)]
    assert found["zero"] == [("zero", pytest.approx(-numpy.pi / 6))] and found[""] == [("start", pytest.approx(-numpy.pi / 6, abs=1e-6))]


def test_plugins_are_losses_and_the_rest_is_imported(tmp_path: Path) -> None:
    """One actuator refers to an instance of a plugin, which MuJoCo can load."""
    path, report = tmp_path / "p.xml", Report()
    path.write_text("""<mujoco model="p">
      <extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="40"/></instance></plugin></extension>
      <worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size=".1"/></body></worldbody>
      <actuator><plugin name="p" plugin="mujoco.pid" instance="pid" joint="j"/><motor name="m" joint="j" gear="3"/></actuator>
    </mujoco>""")
    assert mujoco.MjModel.from_xml_path(str(path)).nu == 2
    found = import_robot(str(path), report)
    assert found is not None and report.diagnostics == []
    assert [(loss.what, loss.where.line) for loss in found.losses] == [
        ("the indices of `data.ctrl`", 1), ("`<extension>`", 2), ("actuator `p`", 4),
    ]
    assert [one.drive.name for hanging in found.robot.attachments for one in hanging.joints if one.drive is not None] == ["m"]


ARM = """<mujoco model="arm"><compiler angle="radian" meshdir="assets"/><include file="defaults.xml"/>
<asset><mesh name="m" file="m.obj"/></asset>
<worldbody><body name="link"><inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>
<joint name="j" axis="0 1 0" range="-1 1"/><geom type="mesh" mesh="m"/></body></worldbody>
<actuator><motor name="mo" joint="j"/></actuator></mujoco>"""
ATTACHING = """<mujoco model="top"><asset><model name="arm" file="parts/arm.xml"/></asset><worldbody><body name="base"><freejoint/>
<geom size=".1" mass="1"/><frame pos="0 0 .5"><attach model="arm" body="link" prefix="l_"/></frame>
<frame pos="0 .3 .5" euler="0 0 90"><attach model="arm" body="link" prefix="r_"/></frame></body></worldbody></mujoco>"""


def attaching(tmp_path: Path) -> Path:
    (tmp_path / "parts" / "assets").mkdir(parents=True)
    (tmp_path / "parts" / "assets" / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (tmp_path / "parts" / "defaults.xml").write_text("<mujoco><default><joint damping='0.3'/></default></mujoco>")
    (tmp_path / "parts" / "arm.xml").write_text(ARM)
    (tmp_path / "top.xml").write_text(ATTACHING)
    return tmp_path / "top.xml"


def test_attached_models_match_mujoco(tmp_path: Path) -> None:
    path = attaching(tmp_path)
    found = import_cleanly(path)
    assert found.name == "top"
    models = mujoco.MjModel.from_xml_path(str(path)), thingc.compile(write_import(found, tmp_path / "out")).modes["source"].model()
    states = [mujoco.MjData(model) for model in models]
    for data in states:
        data.joint("l_j").qpos[0], data.joint("r_j").qpos[0] = 0.3, -0.5
        mujoco.mj_forward(data.model, data)
        assert data.model.joint("l_j").damping[0] == 0.3 and tuple(data.model.joint("r_j").range) == (-1.0, 1.0)
        assert [data.model.actuator(k).name for k in range(data.model.nu)] == ["l_mo", "r_mo"]
    for name in ("l_link", "r_link"):
        assert abs(states[0].body(name).xpos - states[1].body(name).xpos).max() < 1e-12
        assert abs(states[0].body(name).xmat - states[1].body(name).xmat).max() < 1e-12
    (link,) = (one for one in found.robot.links if one.name == "l_link")
    assert (Path(link.where.file).name, link.where.line) == ("arm.xml", 3)


@pytest.mark.parametrize(("where", "old", "new", "line", "message"), [
    ("parts/arm.xml", "m.obj", "none.obj", 2, "there is no file `parts/assets/none.obj`"),
    ("parts/arm.xml", "<worldbody>", "<asset><model name='a' file='arm.xml'/></asset><worldbody>", 3, "`arm.xml` is included a second"),
    ("top.xml", "parts/arm.xml", "parts/leg.xml", 1, "there is no file `parts/leg.xml`"),
    ("top.xml", '<frame pos="0 0 .5">', "<replicate count='9999'>", 2, "the number of elements exceeds the maximum (100,000)"),
])
def test_errors_in_attached_models(tmp_path: Path, where: str, old: str, new: str, line: int, message: str) -> None:
    path, report = attaching(tmp_path), Report()
    text = (tmp_path / where).read_text().replace(old, new)
    (tmp_path / where).write_text(text if "replicate" not in new else text.replace("</frame>", "</replicate>", 1))
    assert import_robot(str(path), report) is None
    first = report.sorted_diagnostics()[0]
    assert first.span is not None and first.span.line == line and first.message.startswith(message), report.sorted_diagnostics()


TWO_LINKS = """\
<mujoco model="r">
  <option><flag filterparent="disable"/></option>
  <worldbody><body name="a">
    <geom size="0.1"/><site name="s"/>
    <body name="b" pos="0.15 0 0">
      <joint name="j" axis="0 1 0"/><geom size="0.1"/><site name="t"/>
      <body name="c" pos="0 0 0.15"><geom size="0.1" contype="0" conaffinity="0"/></body>
      <body name="d" pos="0.3 0 0"><joint name="k" axis="0 1 0"/><geom size="0.1" mass="1"/></body>
    </body>
  </body></worldbody>
  <tendon>
    <spatial name="cord" range="-2 -1" limited="true"><site site="s"/><site site="t"/></spatial>
    <fixed name="y"><joint joint="j" coef="1"/></fixed>
    <fixed name="z"><joint joint="k" coef="1"/></fixed>
  </tendon>
  <equality><tendon name="equal" tendon1="y" tendon2="z"/></equality>
</mujoco>
"""


@pytest.mark.parametrize(("masks", "touching"), [("", True), (' contype="0" conaffinity="0"', False)])
def test_contacts_across_a_joint_are_lost_if_shapes_can_touch(masks: str, touching: bool, tmp_path: Path) -> None:
    """`c` belongs to the link of `b`, and its shape has no contacts."""
    text = TWO_LINKS.replace('axis="0 1 0"/><geom size="0.1"', f'axis="0 1 0"/><geom size="0.1"{masks}')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert [{model.body(int(model.geom_bodyid[geom])).name for geom in pair} for pair in data.contact.geom] == [{"a", "b"}] * touching
    lost = [loss.what for loss in imported_from(text, tmp_path).losses]
    assert ("contacts of `b` with `a`" in lost) == touching


def test_tendon_limit_that_is_always_exceeded_is_preserved(tmp_path: Path) -> None:
    """The length of a path is never negative, so a limit of a document cannot have this range."""
    model = built_from(TWO_LINKS, tmp_path)
    number = model.tendon("cord").id
    assert tuple(model.tendon_range[number]) == (-2.0, -1.0) and model.tendon_limited[number]


def test_tendon_equality_is_lost_if_a_joint_has_a_reference(tmp_path: Path) -> None:
    assert "equality `equal`" not in [loss.what for loss in imported_from(TWO_LINKS, tmp_path).losses]
    referred = TWO_LINKS.replace('name="j"', 'name="j" ref="10"')
    assert "equality `equal`" in [loss.what for loss in imported_from(referred, tmp_path).losses]


DRAG = """\
<mujoco>
  <option density="1000"/>
  <worldbody>
    <body name="tilted"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="2e-2 2e-2 1e-2" quat="0.8 0.1 0.2 0.3"/></body>
    <body name="aligned" pos="1 0 0"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="2e-2 2e-2 1e-2" quat="1 0 1 0"/></body>
    <body name="unequal" pos="2 0 0"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="3e-2 2e-2 1e-2" quat="0.8 0.1 0.2 0.3"/></body>
    <body name="ball" pos="3 0 0"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="2e-2 2e-2 2e-2" quat="0.8 0.1 0.2 0.3"/></body>
    <body name="full" pos="4 0 0"><freejoint/><inertial pos="0 0 0" mass="1" fullinertia="16e-3 19e-3 16e-3 -2e-3 -4e-3 -2e-3"/></body>
  </worldbody>
</mujoco>
"""


def test_arbitrary_axes_of_drag_are_losses(tmp_path: Path) -> None:
    """MuJoCo computes drag for a box along the principal axes, and chooses the axes of equal moments when it reads the built model."""
    imported = _imported(tmp_path, DRAG)
    ours = thingc.compile(tmp_path / "out" / imported.document).modes["source"].model()
    theirs, drags = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml")), []
    names = [theirs.body(k).name for k in range(1, theirs.nbody)]
    for model in (theirs, ours):
        data = mujoco.MjData(model)
        for name in names:
            first = int(model.joint(int(model.body(name).jntadr[0])).dofadr[0])
            data.qvel[first : first + 3] = 0.3, 1.0, -0.6
        mujoco.mj_forward(model, data)
        drags.append(numpy.array([data.qfrc_passive[int(model.body(name).dofadr[0]) :][:3] for name in names]))
    changed = {name for name, one, other in zip(names, *drags, strict=True) if not numpy.allclose(one, other, rtol=1e-6)}
    assert changed == {"tilted", "ball"} and numpy.abs(drags[0]).min() > 1e-3
    lost = {loss.what for loss in imported.losses if "drag" in loss.what}
    assert lost == {f"the orientation of the drag of `{name}`" for name in changed}
    assert not [loss for loss in _imported(tmp_path, DRAG.replace("density", "viscosity")).losses if "drag" in loss.what]


KEPT = """\
<mujoco>
  <option density="1.2"/>
  <worldbody>
    <body name="arm" gravcomp="0.4">
      <joint name="lift" type="slide" axis="0 0 1" range="-1 1"/><geom name="one" size="0.05" mass="1"/>
      <body name="tip" gravcomp="0.8" pos="0.2 0 0"><geom name="two" size="0.05" mass="3"/></body>
    </body>
    <body name="other" pos="0 1 0"><joint name="turn"/><geom name="three" type="box" size="0.05 0.06 0.07" pos="0.1 0 0" mass="1"/></body>
  </worldbody>
  <contact><exclude body1="arm" body2="other"/><exclude body1="tip" body2="other"/></contact>
  <sensor><framepos name="seen" objtype="body" objname="tip"/></sensor>
</mujoco>
"""


def test_kept_links_do_not_lose_properties_of_single_bodies(tmp_path: Path) -> None:
    """With `keep`, also that of an earlier import, no values are averaged, and no losses of merged bodies are reported."""
    file, folder = tmp_path / "robot.xml", tmp_path / "out"
    file.write_text(KEPT)
    merged, kept = import_cleanly(file), import_cleanly(file, ImportRequest(keep=True))
    of_arm = {
        "the different `gravcomp` of bodies fixed to `arm`", "drag of `arm`, computed for each body", "the softness of contacts of `arm`",
    }
    assert {loss.what for loss in merged.losses} >= of_arm
    assert [loss.what for loss in kept.losses if "indices" not in loss.what] == []
    document = write_import(kept, folder)
    again = import_cleanly(file, ImportRequest(update=True, earlier=lambda _: earlier_import(str(folder))))
    assert again.losses == kept.losses and again.files[again.document] == document.read_bytes()
    model = thingc.compile(document).modes["source"].model()
    assert [float(model.body_gravcomp[model.body(name).id]) for name in ("arm", "tip", "other")] == [0.4, 0.8, 0.0]
    excluded = {frozenset(model.body(int(half)).name for half in divmod(int(pair), 1 << 16)) for pair in model.exclude_signature}
    assert excluded >= {frozenset({"arm", "other"}), frozenset({"tip", "other"})}
    assert model.sensor("seen").objid[0] == model.body("tip").id


CHAIN = (
    "<mujoco><worldbody>{}</worldbody><actuator>{}</actuator><sensor>{}</sensor></mujoco>",
    "<body name='b{0}'><joint name='j{0}'/><geom size='.1'/><site name='b{0}/s'/></body>",
    "<adhesion name='m{0}' body='b{0}' ctrlrange='0 1'/>", "<gyro name='g{0}' site='b{0}/s'/>",
)
PLATES = (
    "<robot name='r'><link name='base'/>{}{}</robot>",
    "<link name='b{0}'><inertial><mass value='1'/></inertial><visual><geometry><sphere radius='1'/></geometry></visual></link>",
    "<joint name='j{0}' type='fixed'><parent link='base'/><child link='b{0}'/></joint>",
)


@pytest.mark.parametrize(("texts", "file"), [(CHAIN, "robot.xml"), (PLATES, "robot.urdf")])
def test_time_for_naming_is_linear(tmp_path: Path, texts: tuple[str, ...], file: str) -> None:
    """Each comparison of names without case calls `lower`. Comparing each name with all other names would call `lower` four times as often
    for twice as many names."""
    counts = []
    for number in (40, 80):
        whole, *elements = texts
        (tmp_path / file).write_text(whole.format(*("".join(map(element.format, range(number))) for element in elements)))
        calls: list[str] = []
        sys.setprofile(lambda _, event, thing, calls=calls: calls.append("") if event == "c_call" and thing.__name__ == "lower" else None)
        try:
            import_robot(str(tmp_path / file), Report())
        finally:
            sys.setprofile(None)
        counts.append(len(calls))
    assert counts[0] > 40 and counts[1] < 2.2 * counts[0], counts
