"""The study of conformance: its questions to every reader, and that it detects changed files."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from emit import sdf_answers, usd_answers
from loops.test_loop_joints import FOURBAR
from thingc.tools.cli.main import main

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "conformance"
FEW = 4
"""The number of configurations for our SDF reader, which is slow."""

SEEDS = (0, 3, 20)
"""In the last robot, a joint without limits follows a joint with limits."""


@pytest.fixture(scope="module", autouse=True)
def on_path():
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory, shared_store: str):
    """Questions to all modes of three random robots in files of each format."""
    from reference import question
    from robots import document

    base = tmp_path_factory.mktemp("conformance")
    questions = {"URDF": [], "SDF": [], "USD": []}
    for seed in SEEDS:
        path = base / f"random_{seed}.yaml"
        path.write_text(document(seed))
        assert main(["build", str(path), "--emit", "mjcf,urdf,sdf,usd", "-o", str(base / "out"), "--store", shared_store]) == 0
        folder = base / "out" / path.stem
        for file in sorted((folder / "urdf").glob("*.urdf")):
            questions["URDF"].append(question(file, folder / "mjcf" / f"{file.stem}.xml"))
        for file in sorted((folder / "sdf").glob("*/model.sdf")):
            questions["SDF"].append(question(file, folder / "mjcf" / f"{file.parent.name}.xml", count=FEW))
        for file in sorted((folder / "usd").glob("*.usda")):
            questions["USD"].append(question(file, folder / "mjcf" / f"{file.stem}.xml", count=FEW))
    assert [len(of) for of in questions.values()] == [3 * len(SEEDS)] * 3
    return questions


@pytest.fixture
def asked(both):
    return both["URDF"]


ROBOT = """\
thingc: assembly/1
name: r
components:
  base: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
  arm: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}}
  hand:
    frame: true
    mass: 1 kg
    inertia: {ixx: 1 kg*mm^2, iyy: 1 kg*mm^2, izz: 1 kg*mm^2}
    mounts: {far: {xyz: [100 mm, 0 mm, 0 mm]}}
joints:
  lift: {type: prismatic, parent: base.origin, child: arm.origin, limit: {lower: 0 mm, upper: 100 mm}}
  turn:
    {type: revolute, parent: arm.origin, child: hand.origin, limit: {lower: 0 rad, upper: 1 rad}, mimic: {joint: lift, multiplier: 5 rad/m}}
mounts: {tip: hand.far}
poses: {up: {lift: 80 mm}, low: {lift: 10 mm}}
modes: {m: {root: base, base: fixed}}
"""


def test_package_with_wrong_poses_is_detected(tmp_path: Path, shared_store: str) -> None:
    import packages
    from study import Judged

    (tmp_path / "r.yaml").write_text(ROBOT)
    assert main(["build", str(tmp_path / "r.yaml"), "--emit", "mjcf,ros", "-o", str(tmp_path / "out"), "--store", shared_store]) == 0
    (asked,) = packages.questions(tmp_path / "out" / "r")
    assert asked.request["poses"] == ["up", "low"] and "tip" in asked.request["frames"]

    def answer(srdf: str):
        """Answer with MuJoCo on URDF, with the states of the group of all joints."""
        unfused = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'  # else frames are no bodies; a package does not ask for it
        model = mujoco.MjModel.from_xml_string(Path(asked.request["file"]).read_text().replace("</robot>", unfused))
        data = mujoco.MjData(model)
        found = []
        for pose in asked.request["poses"]:
            lift = float(re.search(rf'<group_state name="{pose}" group="r">\s+<joint name="lift" value="([^"]+)"', srdf)[1])
            data.joint("lift").qpos, data.joint("turn").qpos = lift, 5.0 * lift
            mujoco.mj_forward(model, data)
            found.append([packages._pose(data.body(name)).tolist() for name in asked.request["frames"]])
        return {"frames": found}

    text = Path(asked.request["srdf"]).read_text()
    for srdf, faults in ((text, 0), (text.replace('"0.08"', '"0.07"'), 1)):
        verdict = Judged()
        verdict.add(asked.name, answer(srdf), asked.answer, [])
        assert len(verdict.faults) == faults, verdict.faults


def judged(asked, change: Callable[[str], str] = str):
    """Return the findings of the study for changed URDF files that MuJoCo reads, and for changed SDF and USD files that our own readers
    read."""
    import ask_mujoco
    from study import Judged

    answers = {"URDF": ask_mujoco.answer, "SDF": sdf_answers.answer, "USD": usd_answers.answer}
    verdict = Judged(floats=asked[0].format == "USD")
    for one in asked:
        file = Path(one.request["file"])
        text = file.read_text()
        changed = file.with_name(f"changed_{file.name}")
        changed.write_text(change(text))
        assert change is str or changed.read_text() != text, "something was changed"
        verdict.add(one.name, answers[one.format]({**one.request, "file": str(changed)}), one.answer, one.request["joints"])
        changed.unlink()
    return verdict


def test_all_files_describe_one_robot(both) -> None:
    for format, asked in both.items():
        verdict = judged(asked)
        assert verdict.faults == [] and verdict.files == len(asked)
        more = {"mimic", "effort"} if format != "URDF" else set()
        assert {*verdict.worst} == {"frames", "mass", "centre", "mass_matrix", "torque", "range"} | more
        assert 0.0 < verdict.worst["frames"] < (1e-6 if format == "USD" else 1e-12)


def flipped(text: str) -> str:
    """Reverse the last axis."""
    before, _, after = text.rpartition('<axis xyz="')
    values, _, rest = after.partition('"')
    return f'{before}<axis xyz="{" ".join(str(-float(x)) for x in values.split())}"{rest}'


def turned(text: str) -> str:
    """Rotate every inertia by a quarter turn about z, as if its frame had been ignored."""
    def quarter(match: re.Match[str]) -> str:
        xx, xy, xz, yy, yz, zz = (float(one) for one in re.findall(r'="(\S+?)"', match[0]))
        values = {"ixx": yy, "ixy": -xy, "ixz": -yz, "iyy": xx, "iyz": xz, "izz": zz}
        return "<inertia " + " ".join(f'{name}="{value!r}"' for name, value in values.items()) + "/>"

    return re.sub(r"<inertia .*?/>", quarter, text)


def shifted(text: str) -> str:
    """Move the first centre of mass by a millimetre."""
    return re.sub(r'(<inertial>\s*<origin xyz=")(\S+)', lambda match: f"{match[1]}{float(match[2]) + 0.001!r}", text, count=1)


def heavier(text: str) -> str:
    """Change the mass of a link."""
    return re.sub(r'<mass value="0\.', '<mass value="1.', text, count=1)



@pytest.mark.parametrize(("change", "seen"), [
    (flipped, {"frames"}), (turned, {"mass matrix"}), (shifted, {"centre of mass"}), (heavier, {"total mass"}),
], ids=lambda one: one.__name__ if callable(one) else "")
def test_changed_urdf_file_is_detected(asked, change: Callable[[str], str], seen: set[str]) -> None:
    """A reversed axis, a rotated inertia, a moved centre, another mass."""
    faults = judged(asked, change).faults
    assert {one.name for one in asked} == {fault.partition(":")[0] for fault in faults}, "in every file"
    assert any(word in fault for fault in faults for word in seen)


@pytest.mark.parametrize(("pattern", "other"), [('mass="0.', 'mass="1.'), ("0 0 -9.81", "0 0 -9.8")])
def test_model_with_other_motion_is_detected(both, pattern: str, other: str) -> None:
    """The positions of joints after some steps differ."""
    from asking import started
    from reference import question, stepped
    from study import Judged

    files = [Path(one.request["file"]) for one in both["URDF"]]
    models = [file.parents[1] / "mjcf" / f"{file.stem}.xml" for file in files]
    mjcf = next(file for file in models if "fixed" in file.stem and pattern in file.read_text())
    one = stepped(question(mjcf, mjcf, count=1))
    for text, faults in ((mjcf.read_text(), 0), (mjcf.read_text().replace(pattern, other), 1)):
        changed = mjcf.with_name("changed.xml")
        changed.write_text(text)
        model, data = started({**one.request, "file": str(changed)})
        mujoco.mj_step(model, data, one.request["steps"])
        verdict = Judged(floats=True)
        verdict.add(one.name, {"steps": data.qpos.tolist()}, one.answer, [])
        assert len(verdict.faults) == faults, verdict.faults


def flipped_sdf(text: str) -> str:
    """Reverse the last axis."""
    before, _, after = text.rpartition("<xyz>")
    values, _, rest = after.partition("<")
    return f"{before}<xyz>{' '.join(str(-float(x)) for x in values.split())}<{rest}"


def turned_sdf(text: str) -> str:
    """Rotate every inertia by a quarter turn about z."""
    def quarter(match: re.Match[str]) -> str:
        xx, xy, xz, yy, yz, zz = (float(one) for one in re.findall(r">(\S+?)</", match[0]))
        values = {"ixx": yy, "ixy": -xy, "ixz": -yz, "iyy": xx, "iyz": xz, "izz": zz}
        return "<inertia>" + "".join(f"<{name}>{value!r}</{name}>" for name, value in values.items()) + "</inertia>"

    return re.sub(r"<inertia>.*?</inertia>", quarter, text, flags=re.S)


def unheld_sdf(text: str) -> str:
    """Remove the joint that fixes the base."""
    return re.sub(r'<joint name="root" type="fixed">.*?</joint>', "", text, flags=re.S)


def alone_sdf(text: str) -> str:
    """Remove all mimics."""
    return re.sub(r"<mimic .*?</mimic>", "", text, flags=re.S)


def wider_sdf(text: str) -> str:
    """Change a limit."""
    return re.sub(r"<upper>(.*?)<", lambda match: f"<upper>{float(match[1]) + 0.1!r}<", text, count=1)


@pytest.mark.parametrize(("change", "seen"), [
    (flipped_sdf, "frames"), (turned_sdf, "mass matrix"), (unheld_sdf, "frames"), (alone_sdf, "mimics"), (wider_sdf, "limits"),
], ids=lambda one: one.__name__ if callable(one) else "")
def test_changed_sdf_file_is_detected(both, change: Callable[[str], str], seen: str) -> None:
    """A reversed axis, a rotated inertia, a base that is not fixed, a removed mimic, another limit, in every file that has such an
    element."""
    concerned = [one for one in both["SDF"] if change(text := Path(one.request["file"]).read_text()) != text]
    faults = judged(concerned, change).faults
    assert len(concerned) >= 3 and {one.name for one in concerned} == {fault.partition(":")[0] for fault in faults}
    assert any(seen in fault for fault in faults)


def test_joint_zeros_of_an_sdf_file_with_a_loop(tmp_path: Path, shared_store: str) -> None:
    """At the values that the study uses as 0, MuJoCo has every link at the pose in the file."""
    from reference import _zeros

    (tmp_path / "fourbar.yaml").write_text(FOURBAR)
    out = tmp_path / "out"
    assert main(["build", str(tmp_path / "fourbar.yaml"), "--emit", "mjcf,sdf", "-o", str(out), "--store", shared_store]) == 0
    for mode in ("bench", "other"):
        model = mujoco.MjModel.from_xml_path(str(out / "fourbar" / "mjcf" / f"fourbar_{mode}.xml"))
        file = out / "fourbar" / "sdf" / f"fourbar_{mode}" / "model.sdf"
        data = mujoco.MjData(model)
        zeros = _zeros(model, file)
        assert set(zeros) == {model.joint(k).name for k in range(model.njnt)} and any(abs(q) > 0.1 for q in zeros.values())
        for path, q in zeros.items():
            data.joint(path).qpos = q
        mujoco.mj_forward(model, data)
        places = {link.get("name"): place for link in ElementTree.parse(file).iter("link") if (place := link.find("pose")) is not None}
        assert len(places) == 3
        for name, place in places.items():
            link, other = data.body(name), data.body(place.get("relative_to"))
            expected = [float(one) for one in (place.text or "").split()[:3]]
            assert other.xmat.reshape(3, 3).T @ (link.xpos - other.xpos) == pytest.approx(expected, abs=1e-9)
            quaternion = np.empty(4)
            mujoco.mju_euler2Quat(quaternion, [float(one) for one in (place.text or "").split()[3:]], "XYZ")
            turned = np.empty(9)
            mujoco.mju_quat2Mat(turned, quaternion)
            assert other.xmat.reshape(3, 3).T @ link.xmat.reshape(3, 3) == pytest.approx(turned.reshape(3, 3), abs=1e-9)


NUMBERS = r"\((\S+), (\S+), (\S+), (\S+)\)"


def times(text: str, attribute: str, other: tuple[float, float, float, float], count: int = 0) -> str:
    """Multiply the last `count` quaternions of a name in a USD file (0: all) by another one."""
    a, b, c, d = other

    def product(match: re.Match[str]) -> str:
        w, x, y, z = (float(one) for one in match.groups()[1:])
        q = (w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a)
        return f"{match[1]}({', '.join(map(repr, q))})"

    found = list(re.finditer(rf"({attribute}\d? = ){NUMBERS}", text))
    for match in found[-count:][::-1]:
        text = text[: match.start()] + product(match) + text[match.end() :]
    return text


def flipped_usd(text: str) -> str:
    """Reverse the last axis."""
    return times(text, "localRot", (0.0, 1.0, 0.0, 0.0), 2)


def turned_usd(text: str) -> str:
    """Rotate all principal axes by a quarter turn about z."""
    return times(text, "principalAxes", (0.5**0.5, 0.0, 0.0, 0.5**0.5))


def unheld_usd(text: str) -> str:
    """Move the base a millimetre away from the place where it is fixed."""
    return re.sub(r'(FixedJoint "root".*?localPos0 = \()(\S+),', lambda one: f"{one[1]}{float(one[2]) + 0.001!r},", text, flags=re.S)


def alone_usd(text: str) -> str:
    """Remove all mimics."""
    return re.sub(r"rel newton:mimicJoint = .*", "", text)


def wider_usd(text: str) -> str:
    """Change a limit."""
    return re.sub(r"(upperLimit = )(\S+)", lambda match: f"{match[1]}{float(match[2]) + 0.1!r}", text, count=1)


@pytest.mark.parametrize(("change", "seen"), [
    (flipped_usd, "frames"), (turned_usd, "mass matrix"), (unheld_usd, "frames"), (alone_usd, "mimics"), (wider_usd, "limits"),
], ids=lambda one: one.__name__ if callable(one) else "")
def test_changed_usd_file_is_detected(both, change: Callable[[str], str], seen: str) -> None:
    """A reversed axis, rotated principal axes, a moved base, a removed mimic, another limit, in every file that has such an element."""
    concerned = [one for one in both["USD"] if change(text := Path(one.request["file"]).read_text()) != text]
    faults = judged(concerned, change).faults
    assert len(concerned) >= 3 and {one.name for one in concerned} == {fault.partition(":")[0] for fault in faults}
    assert any(seen in fault for fault in faults)


def test_ignored_mimic_is_detected(asked) -> None:
    """Only for readers that state which mimics they support."""
    from study import difference

    expected = [one for question in asked for one in question.answer["mimic"]]
    assert any(expected)
    assert difference("mimic", expected, expected, []) == 0.0
    assert difference("mimic", [None] * len(expected), expected, []) > 1.0
    other = [one and (one[0], one[1], one[2] + 0.01) for one in expected]
    assert difference("mimic", other, expected, []) == pytest.approx(0.01)


def test_known_refusals_are_in_the_row_of_a_reader() -> None:
    from study import Judged, table

    verdict = Judged("is newer than")
    for _ in range(2):
        verdict.add("arm_bench", {"cannot": "ValueError: SDFormat 1.11 is newer than 1.9"}, {}, [])
    verdict.add("arm_drawing", {"mass": 1.0}, {"mass": 1.0}, [])
    assert verdict.faults == []
    rows = {("libsdformat", "SDF"): ("12.3.0", {"arm": verdict})}
    row = list(table(rows, ""))[2]
    assert row.startswith("| libsdformat 12.3.0 | SDF | arm | 3 |")
    assert row.endswith("| no differences, not supported: 2 (SDFormat 1.11 is newer than 1.9) |")
    drake = "| drake 1.0 | SDF | arm | 3 |"
    lines = list(table(rows, f"| libsdformat 12.2.0 | SDF | arm | 3 |\n{drake}"))
    assert row in lines and drake in lines and not any("12.2.0" in line for line in lines)


def test_missing_reader_is_skipped_with_a_message(tmp_path: Path) -> None:
    from environments import succeeds
    from study import Reader, judged, rows_of

    assert succeeds("true") and not succeeds("false") and not succeeds("no-such-program --version")
    version, groups = judged(Reader("other", ("SDF",), needs=("no-such-program --version",)), tmp_path, [])
    assert version == "not available (no-such-program --version)" and groups == {}
    assert list(rows_of("other", "SDF", version, groups))[0].startswith(f"| other | SDF | {version} |")


def test_errors_of_readers_are_quoted() -> None:
    from study import Judged

    verdict = Judged()
    verdict.add("arm_bench", {"cannot": "ValueError: no such joint"}, {}, [])
    assert verdict.faults == ["arm_bench: reader cannot: ValueError: no such joint"]


def test_meshes_are_compared_as_boxes_by_name() -> None:
    """One mesh is rotated by a quarter turn about z, and another one is not. Exchanged meshes are detected."""
    import mujoco
    from reference import _box, _meshes, _shape
    from study import BOUNDS, difference

    corners = " ".join(f"{x} {y} {z}" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3))
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><asset><mesh name="m" vertex="{corners}"/></asset><worldbody>
          <geom name="hand/cap" type="mesh" mesh="m" pos="1 2 3" quat="1 0 0 1"/><geom name="hand/cap:collision_1" type="mesh" mesh="m"/>
          <geom name="ball" size="1"/>
        </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert [_shape(name, "SDF") for name in _meshes(model)] == ["hand_cap_visual", "hand_cap_collision_1"]
    assert [_shape(name, "URDF") for name in _meshes(model)] == ["hand/cap", "hand/cap:collision_1"]
    boxes = [_box(data, k) for k in _meshes(model).values()]
    assert boxes[0] == pytest.approx([0.8, 2, 3, 1, 2.1, 3.3], abs=1e-7) and boxes[1] == pytest.approx([0, 0, 0, 0.1, 0.2, 0.3], abs=1e-7)
    assert difference("meshes", boxes[::-1], boxes, []) > BOUNDS["meshes"]
