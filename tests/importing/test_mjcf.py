"""What is imported of MJCF is the robot that MuJoCo reads in the same file: in fifty states, for two hundred steps, and from any root."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.as_original import BALL, Pair
from thingc.diagnostics import Report
from thingc.importing import Imported, import_robot

ROBOTS = Path(__file__).parent / "robots"
ROOTS = {
    "constructs": ("forearm", "hand", "left", "wheel1", "tip"), "cranks": (), "loops": ("rocker", "mast"), "tendons": ("thigh", "foot"),
    "world": ("one/arm", "two"),
}
EXACT, TOUCHING = 1e-9, 1e-6
LOST = {
    "constructs": ["`<light>`", "how soft constraints are at the reference of joint `shoulder`, 0.174533"],
    "cranks": [], "loops": ["how soft contacts of `mast` are"], "tendons": [],
    "two_arms": ["contacts of `one/arm` with `world`", "contacts of `two` with `world`"],
}


@dataclass(frozen=True)
class Case:
    imported: Imported
    spec: mujoco.MjSpec
    modes: dict[str, mujoco.MjModel]

    def pair(self, mode: str = "source") -> Pair:
        """The file as MuJoCo compiles it, and a mode; what the source gives no name has the one that it is given by the import."""
        named = {
            "body": {k: self.spec.bodies[k].name for k in range(len(self.spec.bodies))},
            "site": {one.id: one.name for one in self.spec.sites},
            "actuator": {one.id: one.name or one.target for one in self.spec.actuators},
            "joint": {one.id: one.name or f"{one.parent.name}_joint" for one in self.spec.joints},
        }
        words = json.loads(self.imported.files["import.json"])["names"]
        return Pair(self.spec.compile(), self.modes[mode], named, words)


@pytest.fixture(scope="module", params=sorted(ROOTS))
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    name, report = request.param, Report()
    imported = import_robot(str(ROBOTS / f"{name}.xml"), report, roots=ROOTS[name])
    assert imported is not None and report.diagnostics == []
    folder = tmp_path_factory.mktemp("imported")
    for path, content in imported.files.items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_bytes(content)
    compiled = thingc.compile(folder / imported.document)
    spec = mujoco.MjSpec.from_file(str(ROBOTS / f"{name}.xml"))
    spec.compile()
    return Case(imported=imported, spec=spec, modes={name: mode.model() for name, mode in compiled.modes.items()})


def test_the_source_mode_is_the_source(case: Case) -> None:
    worst = case.pair().compare()
    differ = {kind for kind, far in worst.items() if not far <= (TOUCHING if kind == "contacts" else EXACT)}
    assert differ == ({"contacts"} if any(loss.what.startswith("contacts") for loss in case.imported.losses) else set()), worst
    assert {"poses", "mass matrix", "bias", "passive", "actuators", "gravity", "limits", "gains", "dynamics", "trajectory"} <= worst.keys()
    assert "contacts" in worst or case.imported.name in ("loops", "tendons")


def test_sensors_read_the_same(case: Case) -> None:
    """By name, in states with contacts; noise and cutoffs stand there."""
    words = json.loads(case.imported.files["import.json"])["names"].get("sensors", {})
    pair, random = case.pair(), numpy.random.default_rng(7)
    numbers = {one.name or one.objname: one.id for one in case.spec.sensors}
    assert set(words) == ({*numbers} if case.imported.name == "constructs" else set())
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


def test_what_is_lost_is_said(case: Case) -> None:
    assert [loss.what for loss in case.imported.losses] == LOST[case.imported.name]


def test_any_link_can_be_the_root(case: Case) -> None:
    """Poses relative to the root, and the mass matrix with it held: that of the original with a base that floats, projected. A ball that is
    crossed backwards has other axes in MuJoCo: it stays at 0, and its velocities are not compared."""
    names = json.loads(case.imported.files["import.json"])["names"]
    pair, random = case.pair(), numpy.random.default_rng(5)
    pair.put(random)
    free = _floating(case)
    for mode in [*case.modes][1:]:
        model, (name, word) = case.modes[mode], next((a, b) for a, b in (names["links"] | names["frames"]).items() if b == mode)
        data = mujoco.MjData(model)
        for k, joint in pair.joints.items():
            at, here = pair.theirs.jnt_qposadr[k], model.joint(joint).qposadr[0]
            count = 4 if pair.theirs.jnt_type[k] == BALL else 1
            if count == 4:
                pair.a.qpos[at : at + count] = (1.0, 0.0, 0.0, 0.0)
            data.qpos[here : here + count] = pair.a.qpos[at : at + count]
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(pair.theirs, pair.a)
        back, there = (numpy.linalg.inv(one) for one in (_pose(model, data, word), _matrix(pair.a.body(name))))
        of = {word: ("body", k) for k, word in pair.bodies.items()} | {word: ("site", k) for k, word in pair.sites.items()}
        for one, (kind, k) in of.items():
            theirs = _matrix(pair.a.body(k) if kind == "body" else pair.a.site(k))
            assert numpy.abs(back @ _pose(model, data, one) - there @ theirs).max() < EXACT, (mode, one)
        if free is not None and mode in ("forearm", "wheel1", "rocker", "mast", "thigh", "foot"):
            _held(pair, free, model, data, name)


def _floating(case: Case) -> mujoco.MjModel | None:
    """The original with a base that floats; None where that is the world."""
    spec, root = case.spec.copy(), case.imported.robot.root
    if root == "world":
        return None
    if not spec.body(root).joints:
        spec.body(root).add_freejoint()
    return spec.compile()


def _held(pair: Pair, free: mujoco.MjModel, model: mujoco.MjModel, data: mujoco.MjData, root: str) -> None:
    """The mass matrix with a link held."""
    floating = mujoco.MjData(free)
    rows, ours = list[int](), list[int]()
    for k, word in pair.joints.items():
        joint = free.joint(pair.theirs.joint(k).name) if pair.theirs.joint(k).name else free.joint(k)
        count, many = (4, 3) if pair.theirs.jnt_type[k] == BALL else (1, 1)
        floating.qpos[joint.qposadr[0] :][:count] = pair.a.qpos[pair.theirs.jnt_qposadr[k] :][:count]
        rows += range(joint.dofadr[0], joint.dofadr[0] + many)
        ours += range(model.joint(word).dofadr[0], model.joint(word).dofadr[0] + many)
    mujoco.mj_forward(free, floating)
    full, mine, jacobian = numpy.zeros((free.nv, free.nv)), numpy.zeros((model.nv, model.nv)), numpy.zeros((6, free.nv))
    mujoco.mj_fullM(free, floating, full)
    mujoco.mj_fullM(model, data, mine)
    mujoco.mj_jacBody(free, floating, jacobian[:3], jacobian[3:], free.body(root).id)
    still = numpy.vstack((-numpy.linalg.solve(jacobian[:, :6], jacobian[:, rows]), numpy.eye(len(rows))))
    theirs = still.T @ full[numpy.ix_([*range(6), *rows], [*range(6), *rows])] @ still
    assert numpy.abs(mine[numpy.ix_(ours, ours)] - theirs).max() <= EXACT * numpy.abs(theirs).max()


def _pose(model: mujoco.MjModel, data: mujoco.MjData, word: str) -> numpy.ndarray:
    """4 x 4, of the site of that name, else the body."""
    is_site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, word) >= 0
    return _matrix(data.site(word) if is_site else data.body(word))


def _matrix(of: object) -> numpy.ndarray:
    found = numpy.eye(4)
    found[:3, :3], found[:3, 3] = of.xmat.reshape(3, 3), of.xpos
    return found


def test_what_a_document_cannot_say_is_listed_with_its_line() -> None:
    imported = import_robot(str(ROBOTS / "floating.xml"), Report())
    assert imported is not None
    said = "".join(f"{loss.where.line}: {loss.what}: {loss.why}\n" for loss in imported.losses)
    assert said == (ROBOTS / "floating.txt").read_text()


def test_nothing_of_what_is_left_out_is_written(tmp_path: Path) -> None:
    """The floating robot without all that its losses name is the one that comes back."""
    imported = import_robot(str(ROBOTS / "floating.xml"), Report())
    assert imported is not None
    (tmp_path / imported.document).write_bytes(imported.files[imported.document])
    compiled = thingc.compile(tmp_path / imported.document)
    model = compiled.modes["source"].model()
    assert {model.body(k).name for k in range(1, model.nbody)} == {"trunk", "crank", "rod", "end", "rocker", "slider"}
    assert {model.actuator(k).name for k in range(model.nu)} == {"crank", "rocker", "slider/suck", "second", "muscle", "tendon"}
    assert {model.eq(k).name for k in range(model.neq)} == {"close:loop", "slider:mimic"} and model.tendon(0).name == "pull"
    assert tuple(model.actuator("rocker").gear) == (4, 0, 0, 0, 0, 0) and tuple(model.actuator("rocker").forcerange) == (-0.75, 0.75)


def _imported(folder: Path, text: str) -> Imported:
    """A robot of a file with that text, whose document compiles."""
    (folder / "robot.xml").write_text(text)
    report = Report()
    imported = import_robot(str(folder / "robot.xml"), report)
    assert imported is not None and report.diagnostics == []
    for path, content in imported.files.items():
        (folder / "out" / path).parent.mkdir(exist_ok=True, parents=True)
        (folder / "out" / path).write_bytes(content)
    thingc.compile(folder / "out" / imported.document)
    return imported


def test_names_of_the_source_and_names_made_up_are_others(tmp_path: Path) -> None:
    """A body called as the link between two joints would be, a mesh in the file itself called as a file is, and a name without end."""
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
    assert [(one.parent, one.child) for one in imported.robot.hangings] == [
        ("world", "arm yaw_"), ("arm yaw_", "arm"), ("arm", "arm yaw"),
    ]
    assert [name for name in imported.files if name.startswith("meshes/")] == ["meshes/a.obj", "meshes/a_2.obj"]
    assert imported.files["meshes/a_2.obj"] == (tmp_path / "a.obj").read_bytes() != imported.files["meshes/a.obj"]
    assert [loss.what for loss in imported.losses] == ["a `timestep` of -1", "`<statistic>`", "`<extension>`", "mesh `a` as it is"]


@pytest.mark.parametrize(("inside", "words"), [
    ('<replicate count=" +2000000000"><geom size="0.1"/></replicate>', "this makes 2,000,000,000 of what is in it, and 10,000 are read"),
    (f'<replicate count="9000">{"<site/>" * 12}</replicate>', "the model has more than 100,000 elements"),
])
def test_models_are_read_within_bounds(inside: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody><body><joint/>{inside}</body></worldbody></mujoco>")
    report = Report()
    assert import_robot(str(tmp_path / "robot.xml"), report) is None
    assert len(report.diagnostics) == 1 and words in report.diagnostics[0].message


def test_thousands_of_things_take_no_longer_each_than_ten(tmp_path: Path) -> None:
    """Bodies, sites and names that are made up are found by their numbers, not by looking through all of them."""
    one = '<body pos="0 0 1"><joint/><geom size="0.1"/>{}</body>'
    seconds = []
    for count in (100, 1000):
        text = f"<mujoco><worldbody><body><geom size='1'/><joint/>{one.format('<site/>' * 20) * count}</body></worldbody></mujoco>"
        (tmp_path / "robot.xml").write_text(text)
        began = time.process_time()
        assert import_robot(str(tmp_path / "robot.xml"), Report()) is not None
        seconds.append(time.process_time() - began)
    assert seconds[1] < 40.0 * seconds[0]


def test_the_same_file_gives_the_same_bytes(case: Case) -> None:
    again = import_robot(case.imported.robot.where.file, Report(), roots=ROOTS[Path(case.imported.robot.where.file).stem])
    assert again is not None and again.files == case.imported.files
