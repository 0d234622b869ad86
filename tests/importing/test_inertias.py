"""Moving links with invalid inertias: checked together with everything fixed to them, repaired on request, and mirror pairs that differ."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.imports import write_import
from thingc.base.diagnostics import Report
from thingc.tools.cli.main import main
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot
from thingc.tools.importing.inertias import nearest

WRONG = Path(__file__).parent / "wrong" / "inertias.urdf"
LINK = """<link name="{name}"><inertial><mass value="{mass}"/>
<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>"""


def written(tmp_path: Path, links: str, joints: str) -> Path:
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="robot">{links}{joints}</robot>')
    return path


def repaired(path: Path, how: str) -> tuple[Imported | None, list[str]]:
    report = Report()
    imported = import_robot(str(path), report, ImportRequest(repair=how))
    return imported, [d.message for d in report.sorted_diagnostics()]


def test_nearest_repair_is_recorded(tmp_path: Path) -> None:
    imported, said = repaired(WRONG, "nearest")
    assert imported is not None and said == []
    record = json.loads(imported.files["import.json"])["repaired"]
    assert [(one["link"], one["line"]) for one in record] == [("arm", 3), ("label", 6), ("hand", 9), ("ghost", 13)]
    arm = record[0]
    assert arm["old"] == {"mass": 1.0, "com": [0, 0, 0], "inertia": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.03]]}
    # second moments 0.015 0.015 -0.005, of which the last becomes 1e-6
    assert numpy.allclose(arm["new"]["inertia"], numpy.diag([0.015001, 0.015001, 0.03]), rtol=1e-12)
    assert record[3]["old"] is None and record[3]["new"]["mass"] == 1e-6
    text = imported.files["inertias.yaml"].decode()
    assert text.count("# repaired (nearest): the original values are in import.json") == 4
    (tmp_path / "inertias.yaml").write_text(text)
    assert thingc.compile(tmp_path / "inertias.yaml").modes["source"].model().nv == 3


def test_shapes_repair_only_links_with_shapes() -> None:
    imported, said = repaired(WRONG, "shapes")
    assert imported is None and len(said) == 2
    assert "moving link `arm` is invalid" in said[0] and said[1] == "the inertia of the moving link `ghost` is invalid: the mass is 0"


@pytest.mark.parametrize(("shape", "moments"), [
    ('<box size="0.1 0.2 0.3"/>', [0.13, 0.10, 0.05]), ('<sphere radius="0.1"/>', [0.048, 0.048, 0.048]),
    ('<cylinder radius="0.1" length="0.3"/>', [0.12, 0.12, 0.06]),
])
def test_shapes_repair_matches_textbook_inertias(tmp_path: Path, shape: str, moments: list[float]) -> None:
    """12 kg: m/12 (b^2 + c^2); 2/5 m r^2; m (3 r^2 + h^2)/12 and m/2 r^2."""
    body = f'<link name="b"><inertial><mass value="12"/></inertial><visual><geometry>{shape}</geometry></visual></link><link name="a"/>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
    imported, said = repaired(written(tmp_path, body, joint), "shapes")
    assert imported is not None and said == []
    assert numpy.allclose(json.loads(imported.files["import.json"])["repaired"][0]["new"]["inertia"], numpy.diag(moments))


def test_links_fixed_to_a_valid_link_are_not_repaired(tmp_path: Path) -> None:
    label = LINK.format(name="label", mass=0.1, ixx=0.0021).replace("0.01", "0.001")
    links = LINK.format(name="arm", mass=1, ixx=0.01) + label + '<link name="a"/>'
    joints = """<joint name="j" type="continuous"><parent link="a"/><child link="arm"/></joint>
        <joint name="k" type="fixed"><parent link="arm"/><child link="label"/></joint>"""
    report = Report()
    imported = import_robot(str(written(tmp_path, links, joints)), report)
    assert imported is not None and report.diagnostics == [] and imported.repaired == ()
    assert thingc.compile(write_import(imported, tmp_path)).diagnostics == ()


@pytest.mark.parametrize(("place", "sound"), [("0 1 0", True), ("1 0 0", False)])
def test_inertia_check_uses_rotated_fixed_links(place: str, sound: bool, tmp_path: Path) -> None:
    """`arm` alone has an ixx that is too large. A mass on its x axis adds to iyy and izz, one on its y axis to ixx. `turned` is rotated
    by 90 degrees about z, so its y axis is the x axis of `arm`."""
    links = '<link name="world"/><link name="turned"/>'
    links += LINK.format(name="arm", mass=1, ixx=0.05) + LINK.format(name="end", mass=1, ixx=0.01)
    joints = f"""<joint name="j" type="continuous"><parent link="world"/><child link="arm"/></joint>
<joint name="f" type="fixed"><parent link="arm"/><child link="turned"/><origin rpy="0 0 1.5707963267948966"/></joint>
<joint name="g" type="fixed"><parent link="turned"/><child link="end"/><origin xyz="{place}"/></joint>"""
    report = Report()
    imported = import_robot(str(written(tmp_path, links, joints)), report)
    assert (imported is not None, [d.message.partition(":")[0] for d in report.sorted_diagnostics()]) == (
        (True, []) if sound else (False, ["the inertia of the moving link `arm` is invalid"])
    )


def test_new_root_requires_inertia_of_the_old_root(tmp_path: Path) -> None:
    links = LINK.format(name="arm", mass=1, ixx=0.01) + '<link name="a"/>'
    path = written(tmp_path, links, '<joint name="j" type="continuous"><parent link="a"/><child link="arm"/></joint>')
    for roots, said in (([], []), (["arm"], ["the inertia of the moving link `a` is invalid: the mass is 0"])):
        report = Report()
        import_robot(str(path), report, ImportRequest(roots=roots))
        assert [d.message for d in report.sorted_diagnostics()] == said


def test_static_link_may_lack_inertia_but_not_be_invalid(tmp_path: Path) -> None:
    """Documents reject such an inertia too. A mass without an inertia is allowed."""
    links = LINK.format(name="arm", mass=1, ixx=0.01) + '<link name="a"><inertial><mass value="3"/></inertial></link>'
    links += LINK.format(name="plate", mass=1, ixx=0.03)
    joints = """<joint name="j" type="continuous"><parent link="a"/><child link="arm"/></joint>
        <joint name="k" type="fixed"><parent link="a"/><child link="plate"/></joint>"""
    path, report = written(tmp_path, links, joints), Report()
    assert import_robot(str(path), report) is None
    assert [d.message for d in report.sorted_diagnostics()] == [
        "the inertia of the fixed link `a` is invalid: the largest principal moment (0.03 kg m^2) exceeds the sum of the other two "
        "(0.01 + 0.01)",
    ]
    imported, said = repaired(path, "nearest")
    assert imported is not None and said == [] and [one.link.name for one in imported.repaired] == ["a", "plate"]
    assert thingc.compile(write_import(imported, tmp_path)).diagnostics == ()
    path.write_text(path.read_text().replace("0.03", "0.01"))
    assert import_robot(str(path), Report()) is not None


def test_rounding_noise_in_products_of_inertia_is_dropped(tmp_path: Path) -> None:
    """With moments of 0.01 kg m^2, products below 1e-17 are noise; small but intended products are written."""
    links = LINK.format(name="arm", mass=1, ixx=0.01).replace('ixy="0" ixz="0"', 'ixy="-4e-18" ixz="-4e-12"')
    imported = import_robot(str(written(tmp_path, links, "")), Report())
    assert imported is not None
    assert "inertia: {ixx: 0.01 kg*m^2, iyy: 0.01 kg*m^2, izz: 0.01 kg*m^2, ixz: -4e-12 kg*m^2}" in imported.files["robot.yaml"].decode()


def test_nearest_repair_is_optimal() -> None:
    """None of a thousand nearby valid inertias is closer. A valid inertia is not changed."""
    random = numpy.random.default_rng(3)
    turn, _ = numpy.linalg.qr(random.normal(size=(3, 3)))
    wrong = turn @ numpy.diag([0.01, 0.02, 0.05]) @ turn.T
    best = numpy.array(nearest(tuple(map(tuple, wrong)), 1e-6))

    def second(inertia: numpy.ndarray) -> numpy.ndarray:
        return numpy.trace(inertia) / 2.0 * numpy.eye(3) - inertia

    distance = numpy.linalg.norm(second(best) - second(wrong))
    for _ in range(1000):
        near = second(best) + random.normal(scale=0.003, size=(3, 3))
        near = (near + near.T) / 2.0
        if numpy.linalg.eigvalsh(near)[0] >= 0.0:
            assert numpy.linalg.norm(near - second(wrong)) >= distance - 1e-9
    sound = ((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.025))
    assert numpy.allclose(nearest(sound, 1.0), sound, atol=1e-15)


def test_repaired_inertia_is_accepted_by_simulators(tmp_path: Path) -> None:
    """A light link that is static in the source moves if another link is the root."""
    (tmp_path / "tiny.xml").write_text("""<mujoco model="tiny"><worldbody><body name="base">
        <inertial pos="0 0 0" mass="1e-10" diaginertia="5e-20 5e-20 5e-20"/>
        <body name="arm" pos="0 0 .1"><joint name="k" axis="0 1 0"/><geom size=".1" mass="1"/></body></body></worldbody></mujoco>""")
    helps = {}
    for how in (None, "shapes", "nearest"):
        report = Report()
        found = import_robot(str(tmp_path / "tiny.xml"), report, ImportRequest(roots=["arm"], repair=how))  # type: ignore[arg-type]
        helps[how] = [one.help for one in report.diagnostics]
    assert found is not None and found.repaired[0].new.mass == 1e-10 and min(found.repaired[0].new.inertia[k][k] for k in range(3)) >= 1e-14
    assert helps["nearest"] == [] and "--repair inertia=nearest" in str(helps[None]) and "--repair inertia=nearest" in str(helps["shapes"])
    data = mujoco.MjData(thingc.compile(write_import(found, tmp_path)).modes["arm"].model())
    mujoco.mj_step(data.model, data, 10)
    assert numpy.isfinite(data.qpos).all()


def test_differing_mirror_pairs_are_warnings(tmp_path: Path) -> None:
    links = "".join(LINK.format(name=name, mass=mass, ixx=ixx) for name, mass, ixx in (
        ("base", 1, 0.01), ("left_arm", 1, 0.01), ("right_arm", 1.02, 0.01), ("leg_left", 1, 0.012), ("leg_right", 1.001, 0.0121),
        ("LeftEye", 1, 0.01), ("RightEye", 1, 0.0102),
    ))
    names = ("left_arm", "right_arm", "leg_left", "leg_right", "LeftEye", "RightEye")
    joints = "".join(f'<joint name="{name}" type="fixed"><parent link="base"/><child link="{name}"/></joint>' for name in names)
    report = Report()
    assert import_robot(str(written(tmp_path, links, joints)), report) is not None
    assert [(d.code.code, d.message) for d in report.sorted_diagnostics()] == [
        ("TC955", "`left_arm` and `right_arm` have different masses"),
        ("TC955", "`LeftEye` and `RightEye` have different moments of inertia"),
    ]


def test_unknown_repair_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(WRONG), "--repair", "mass=nearest"]) == 2
    assert "expected `inertia=nearest` or `inertia=shapes`, found `mass=nearest`" in capsys.readouterr().err


def test_robot_without_name_is_named_after_its_file(tmp_path: Path) -> None:
    path = tmp_path / "crane.urdf"
    path.write_text('<robot><link name="a"/></robot>')
    imported = import_robot(str(path), Report())
    assert imported is not None and imported.name == "crane" and [loss.what for loss in imported.losses] == ["`name` of `<robot>`"]


def test_joints_that_exclude_zero_start_in_the_middle(tmp_path: Path) -> None:
    links = "".join(LINK.format(name=name, mass=1, ixx=0.01) for name in ("a", "b"))
    limit = '<limit lower="0.5" upper="1" effort="1" velocity="1"/>'
    joint = f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{limit}</joint>'
    imported = import_robot(str(written(tmp_path, links, joint)), Report(), ImportRequest(roots=["b"]))
    assert imported is not None
    text = imported.files["robot.yaml"].decode()
    assert "  start: {j: 0.75 rad}  # from the source" in text
    assert "  source: {root: a, base: fixed, pose: start}" in text and "  b: {root: b, base: held, pose: start}" in text


def test_computed_rotation_keeps_full_precision(tmp_path: Path) -> None:
    """The frame of a planar joint is computed from its axis: written in degrees if they are round, otherwise as a quaternion."""
    links = "".join(LINK.format(name=name, mass=1, ixx=0.01) for name in ("a", "b"))
    for axis, words in (("1 0 0", "rpy: 90 0 90 deg"), ("0.6 0 0.8", "quat: [")):
        joint = f'<joint name="j" type="planar"><parent link="a"/><child link="b"/><axis xyz="{axis}"/></joint>'
        imported = import_robot(str(written(tmp_path, links, joint)), Report())
        assert imported is not None
        text = imported.files["robot.yaml"].decode()
        assert words in text, text
        (tmp_path / "robot.yaml").write_text(text)
        model = thingc.compile(tmp_path / "robot.yaml").modes["source"].model()
        axes = model.jnt_axis[:3] @ numpy.array([float(x) for x in axis.split()])
        assert sorted(numpy.abs(axes)) == pytest.approx([0.0, 0.0, 1.0], abs=1e-14)


def test_nearly_aligned_axes_are_not_rounded(tmp_path: Path) -> None:
    """A deviation of 1e-6 rad is kept; 1e-13 is rounding."""
    links = "".join(LINK.format(name=name, mass=1, ixx=0.01) for name in ("a", "b"))
    for axis, plain in (("0 1e-6 1", False), ("0 1e-13 1", True)):
        joint = f'<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="{axis}"/></joint>'
        imported = import_robot(str(written(tmp_path, links, joint)), Report())
        assert imported is not None and ("axis: [0, 0, 1]\n" in imported.files["robot.yaml"].decode()) is plain
