"""Errors and warnings of MuJoCo about a model are reported at the line that caused them."""

from __future__ import annotations

import dataclasses
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import pytest
from msgspec.structs import replace

from graph.builder import kept
from mjcf.handmade import Made, Piece, Segment, box_part, drive, raw
from mjcf.test_mjcf_model import arm, load
from thingc.base.diagnostics import Diagnostic
from thingc.base.memo import Memo
from thingc.geometry.store.local import Store
from thingc.targets.mjcf.emit import emit


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(str(tmp_path / "store"))


def said(made: Made, store: Store, *modes: tuple[str, str]) -> list[tuple[str, str, int | None, str]]:
    """Code, severity, line and message of all diagnostics of an emission, in document order."""
    request = made.request(store, *modes)
    emit(request)
    return [(d.code.code, d.severity.value, d.span.line if d.span else None, d.message) for d in request.report.sorted_diagnostics()]


def emit_diagnostics(made: Made, store: Store) -> list[Diagnostic]:
    request = made.request(store)
    emit(request)
    return request.report.sorted_diagnostics()


def test_raw_attributes_are_applied(store: Store) -> None:
    """Raw attributes of every kind of element change the compiled model."""
    made = arm(store)
    made.adhesions = (("forearm/sole", "hand/cap", 300.0),)
    made.raw = (
        raw(101, "joint yaw solreflimit", "0.03 1"),
        raw(102, "joint hand.pitch damping", "0.7"),
        raw(103, "geom hand/cap:collision solref", "0.015 1"),
        raw(104, "option iterations", "7"),
        raw(105, "option flag warmstart", "disable"),
        raw(106, "body bracket gravcomp", "1"),
        raw(107, "actuator yaw kp", "33"),
        raw(108, "actuator forearm/sole gain", "2"),
        raw(109, "default collision geom margin", "0.001"),
        raw(110, "default arm joint armature", "0.123"),
        raw(111, "site tip size", "0.02"),
        raw(112, "size memory", "1M"),
        raw(113, "material petg_e6e6fa shininess", "0.25"),
        raw(114, "mesh boxes/Box-4c4c8075_hull maxhullvert", "6"),
        raw(115, "key home time", "1.5"),
        raw(116, "visual global offwidth", "1920"),
    )
    model = load(made.request(store))
    assert list(model.jnt_solref[model.joint("yaw").id]) == [0.03, 1.0]
    assert model.joint("hand/pitch").damping[0] == 0.7
    assert list(model.geom("hand/cap:collision").solref) == [0.015, 1.0]
    assert model.opt.iterations == 7
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_WARMSTART
    assert model.body_gravcomp[model.body("bracket").id] == 1.0
    assert model.actuator("yaw").gainprm[0] == 33.0
    assert model.actuator("forearm/sole").gainprm[0] == 2.0
    assert model.geom("tip:collision").margin == 0.001 and model.geom("tip").margin == 0.0
    assert model.joint("slider").armature[0] == 0.123 and model.joint("yaw").armature[0] == 0.01
    assert model.site("tip").size[0] == 0.02
    assert model.material("petg_e6e6fa").shininess == 0.25
    assert model.key("home").time == 1.5
    assert model.vis.global_.offwidth == 1920


def test_rejected_raw_attributes_are_reported_together(store: Store) -> None:
    """All rejected attributes are reported in one run, each at its own line with MuJoCo's message."""
    made = arm(store)
    made.raw = (
        raw(101, "joint yaw solreflimt", "0.03 1"),
        raw(102, "joint hand/pitch range", "a b"),
        raw(103, "joint yaw limited", "perhaps"),
        raw(104, "option iterations", "many"),
        raw(105, "body bracket sleep", "1 2"),
        raw(106, "joint yaw damping", "0.3"),
        raw(107, "default collision geom solref", "x"),
        raw(108, "option flag contract", "disable"),
        raw(109, "geom plate:collision mesh", "nothing"),
    )
    assert said(made, store, ("bench", "fixed"), ("adrift", "free")) == [
        ("TC702", "error", 101, "MuJoCo rejects `solreflimt` of joint `yaw`: unrecognized attribute: 'solreflimt'"),
        ("TC702", "error", 102, "MuJoCo rejects `range` of joint `hand/pitch`: bad format in attribute 'range'"),
        ("TC702", "error", 103, "MuJoCo rejects `limited` of joint `yaw`: invalid keyword: 'perhaps'"),
        ("TC702", "error", 104, "MuJoCo rejects `iterations` of `option`: bad format in attribute 'iterations'"),
        ("TC702", "error", 105, "MuJoCo rejects `sleep` of body `bracket`: invalid keyword: '1 2'"),
        ("TC702", "error", 107, "MuJoCo rejects `solref` of `geom`: bad format in attribute 'solref'"),
        ("TC702", "error", 108, "MuJoCo rejects `contract` of `flag`: unrecognized attribute: 'contract'"),
        ("TC702", "error", 109, "MuJoCo rejects `mesh` of geom `plate:collision`: mesh 'nothing' not found in geom 1"),
    ]


def test_compiler_error_is_traced_to_the_raw_attribute(store: Store) -> None:
    """MuJoCo's message names the joint, not the attribute. Of three raw attributes there, the cause is found."""
    made = arm(store)
    made.raw = (raw(101, "joint yaw damping", "1"), raw(102, "joint yaw axis", "0 0 0"), raw(103, "joint yaw margin", "0.1"))
    assert said(made, store) == [("TC702", "error", 102, "MuJoCo rejects `axis` of joint `yaw`: axis too small in joint")]


def test_unknown_and_rejected_attributes_in_one_run(store: Store) -> None:
    made = arm(store)
    made.raw = (raw(101, "joint yow damping", "1"), raw(102, "joint yaw damping", "much"))
    assert said(made, store) == [
        ("TC701", "error", 101, "`raw.mjcf` refers to the unknown joint `yow`"),
        ("TC702", "error", 102, "MuJoCo rejects `damping` of joint `yaw`: bad format in attribute 'damping'"),
    ]


def test_keyframe_error_is_traced_by_name(store: Store) -> None:
    """MuJoCo reports the error without a line, so the attribute is found by the name of the keyframe."""
    made = arm(store)
    made.raw = (raw(101, "key home qpos", "1 2 3 4"),)
    assert said(made, store) == [
        ("TC702", "error", 101, "MuJoCo rejects `qpos` of key `home`: keyframe 'home': invalid qpos size, expected 3, got 4"),
    ]


def test_invalid_mesh_is_reported_at_its_occurrence(store: Store) -> None:
    """The store contains an invalid mesh. The error is at the first occurrence that uses it."""
    made = arm(store)
    part = made.segments[2].pieces[0].part
    broken = kept(store, b"nothing that is a mesh\n", 4, 4)
    made.segments[3].pieces[0].part = dataclasses.replace(
        part,
        definition=replace(part.definition, text="boxes:Box(high=9)"),
        record=replace(part.record, text="boxes:Box(high=9)", meshes={**part.record.meshes, "visual": broken}),
    )
    found = said(made, store)
    assert [(code, severity, line) for code, severity, line, _ in found] == [("TC702", "error", 24)]
    assert found[0][3].startswith("MuJoCo rejects mesh `boxes.Box-")


def test_unrelated_raw_attributes_are_not_blamed(store: Store) -> None:
    made = arm(store)
    made.segments[1].axis = (0.0, 0.0, 0.0)
    made.raw = (raw(101, "joint yaw margin", "0.1"), raw(102, "option iterations", "20"))
    found = said(made, store)
    assert found == [("TC702", "error", 31, "MuJoCo rejects joint `yaw`: axis too small in joint")]


def test_rejected_inertia_is_reported_at_the_link(store: Store) -> None:
    made = arm(store)
    request = made.request(store)
    properties = request.assembly.links[2].properties
    msgspec.structs.force_setattr(request.assembly.links[2], "properties", replace(properties, mass=1e-20))
    emit(request)
    assert [(d.span.line if d.span else None, d.path, d.message) for d in request.report.sorted_diagnostics()] == [
        (12, "forearm", "MuJoCo rejects body `forearm`: mass and inertia of moving bodies must be larger than mjMINVAL"),
    ]


def test_warnings_are_repeated(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """A warning is at the raw attribute that it mentions, also when nothing changed. Nothing is printed, and no log file is written."""
    monkeypatch.chdir(tmp_path)
    made = arm(store)
    made.raw = (raw(101, "option iterations", "20"), raw(102, "statistic meaninertia", "2"))
    for _ in range(2):
        assert said(made, store) == [
            (
                "TC703",
                "warning",
                102,
                "MuJoCo warns of `meaninertia` of `statistic`: statistic attribute 'meaninertia' is deprecated and will be "
                "removed in a future release: it does not affect simulation",
            ),
        ]
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
    assert capfd.readouterr() == ("", "")


def test_user_warning_handler_is_restored(store: Store) -> None:
    collect_warnings: list[str] = []
    mujoco.set_mju_user_warning(collect_warnings.append)
    try:
        before = mujoco.get_mju_user_warning()
        emit(arm(store).request(store))
        assert mujoco.get_mju_user_warning() is before
    finally:
        mujoco.set_mju_user_warning(None)


UNKNOWN = [
    ("joint yow damping", "`raw.mjcf` refers to the unknown joint `yow`", "did you mean `yaw`?"),
    ("joint hand/pich damping", "`raw.mjcf` refers to the unknown joint `hand/pich`", "did you mean `hand/pitch`?"),
    ("jiont yaw damping", "unknown kind of element `jiont` in `raw.mjcf`", "did you mean `joint`?"),
    ("geom hand/cap:colision solref", "`raw.mjcf` refers to the unknown geom `hand/cap:colision`", "did you mean `hand/cap:collision`?"),
    ("body q gravcomp", "`raw.mjcf` refers to the unknown body `q`", "known bodies: `bracket`, `forearm`, `plate`, `tip`"),
    ("default colision geom solref", "`raw.mjcf` refers to the unknown class `colision`", "did you mean `collision`?"),
    (
        "joint damping",
        "`raw.mjcf.joint.damping` must be the path of an attribute of one joint",
        "write `joint: {NAME: {ATTRIBUTE: VALUE}}`",
    ),
    ("option", "`raw.mjcf.option` must be the path of an attribute of `option`", "write `option: {ATTRIBUTE: VALUE}`"),
    (
        "default collision solref",
        "`raw.mjcf.default.collision.solref` must be the path of an attribute in a default class",
        "write `default: {CLASS: {ELEMENT: {ATTRIBUTE: VALUE}}}`",
    ),
]


@pytest.mark.parametrize(("path", "message", "hint"), UNKNOWN)
def test_unknown_raw_elements_are_errors_with_a_hint(store: Store, path: str, message: str, hint: str) -> None:
    made = arm(store)
    made.raw = (raw(101, path, "1"),)
    assert [(d.code.code, d.span.line if d.span else None, d.message, d.help) for d in emit_diagnostics(made, store)] == [
        ("TC701", 101, message, hint)
    ]


def test_raw_attributes_of_absent_elements_are_ignored(store: Store) -> None:
    """A drive that no selected mode has, the joint of a free base, and a keyframe of another mode are no errors and have no effect."""
    made = arm(store)
    made.present = ("slider",)
    made.raw = (raw(101, "actuator yaw kp", "33"), raw(102, "joint root group", "2"))
    assert said(made, store) == []
    assert said(made, store, ("adrift", "free")) == []


def test_raw_attributes_of_other_targets_are_ignored(store: Store) -> None:
    made = arm(store)
    made.raw = (replace(raw(101, "joint nothing damping", "1"), target="urdf"),)
    assert said(made, store) == []


def test_raw_names_of_nested_documents_resolve(store: Store) -> None:
    """`link` prefixes every name with the path of the nested document, also names that are not occurrences."""
    made = arm(store)
    made.raw = (
        raw(101, "default hand/collision geom margin", "0.002"),
        raw(102, "option hand/flag warmstart", "disable"),
        raw(103, "material hand/petg_e6e6fa shininess", "0.25"),
        raw(104, "joint hand/pitch damping", "0.4"),
    )
    model = load(made.request(store))
    assert model.geom("tip:collision").margin == 0.002
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_WARMSTART
    assert model.material("petg_e6e6fa").shininess == 0.25
    assert model.joint("hand/pitch").damping[0] == 0.4


def unit_box(store: Store) -> object:
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    return dataclasses.replace(part, definition=replace(part.definition, text="boxes:Box"))


def test_clashing_asset_names_are_an_error(store: Store) -> None:
    one, other = unit_box(store), unit_box(store)
    one = dataclasses.replace(one, definition=replace(one.definition, reference="a/b.step", text="a/b.step", label="a/b.step"))  # type: ignore
    other = dataclasses.replace(other, definition=replace(other.definition, reference="a.b.step", text="a.b.step", label="a.b.step"))  # type: ignore
    made = Made(segments=[Segment("a", [Piece("a", one), Piece("b", other)])])  # type: ignore[arg-type]
    assert said(made, store) == [
        ("TC751", "error", 21, "`a.b.step` and `a/b.step` have the same file name (`mjcf/assets/a.b.step.obj`)"),
    ]


# --- what need not be asked again ------------------------------------------------------------------------------------


def compiled(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Record the size of the asset files of each compilation, and assert that all run on one thread.

    MuJoCo sometimes returns the model of another thread when several threads compile with the same files."""
    from thingc.targets.mjcf import verify

    counted: list[int] = []
    sizes: list[int] = []
    true, in_memory, thread = verify.attempt, verify.in_memory, threading.get_ident()

    def sized(data: dict[str, bytes]) -> Any:
        sizes.append(sum(map(len, data.values())))
        return in_memory(data)

    def counting(text: str, files: Any) -> verify.CompileResult:
        counted.append(sizes[-1])
        assert threading.get_ident() == thread
        return true(text, files)

    monkeypatch.setattr(verify, "in_memory", sized)
    monkeypatch.setattr(verify, "attempt", counting)
    return counted


def test_verified_models_are_not_compiled_again(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """An unchanged model is not compiled again. After a change of a limit, it is compiled without the known meshes."""
    counted = compiled(monkeypatch)
    made = arm(store)
    modes = (("bench", "fixed"), ("adrift", "free"))
    assert said(made, store, *modes) == []
    assert len(counted) == 2
    assert said(made, store, *modes) == []
    assert len(counted) == 2
    made.segments[1].limit = replace(made.segments[1].limit, upper=2.5)
    assert said(made, store, *modes) == []
    assert len(counted) == 4
    assert counted[2] < counted[0] / 3, "meshes that are known are not read again"


def test_warning_of_several_models_is_reported_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = compiled(monkeypatch)
    made = arm(store)
    made.raw = (raw(102, "statistic meaninertia", "2"),)
    modes = (("bench", "fixed"), ("adrift", "free"), ("loose", "free"))
    assert [(code, line) for code, _, line, _ in said(made, store, *modes)] == [("TC703", 102)]
    assert len(counted) == 3


def test_start_check_is_shared_by_similar_modes(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes that differ only in name and gravity are all compiled, but the initial state of only one is checked. A model with findings
    is checked again."""
    from thingc.targets.mjcf import verify

    looked: list[str] = []
    counted = compiled(monkeypatch)
    true = verify.initial_state_checks.check_state

    def looking(model: Any, robot: Any) -> verify.initial_state_checks.InitialState:
        looked.append(robot.mode.name)
        return true(model, robot)

    monkeypatch.setattr(verify.initial_state_checks, "check_state", looking)

    def of_three(made: Made) -> list[str]:
        request = made.request(store, ("floor", "fixed"), ("wall", "fixed"), ("adrift", "free"))
        floor, wall, adrift = request.robots
        request = replace(request, robots=(floor, replace(wall, gravity=(9.81, 0.0, 0.0)), adrift))
        emit(request)
        return [d.code.code for d in request.report.sorted_diagnostics()]

    assert of_three(arm(store)) == []
    assert len(counted) == 3 and looked == ["floor", "adrift"]
    chattering = arm(store)
    assert chattering.segments[1].actuator is not None
    chattering.segments[1].actuator = replace(chattering.segments[1].actuator, kp=1e9)
    for _ in range(2):  # nothing that is not in order is known
        assert of_three(chattering) == ["TC612"]
    assert looked[2:] == 2 * ["floor", "adrift"]


def test_session_compiles_one_of_similar_modes(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a change of the damping, one mode of each kind is compiled. With a changed limit as well, each mode has a new value and is
    compiled."""
    counted = compiled(monkeypatch)
    made, memo = arm(store), Memo()

    def of_three() -> int:
        request = replace(made.request(store, ("floor", "fixed"), ("wall", "fixed"), ("adrift", "free")), memo=memo)
        floor, wall, adrift = request.robots
        before = len(counted)
        emit(replace(request, robots=(floor, replace(wall, gravity=(9.81, 0.0, 0.0)), adrift)))
        assert request.report.diagnostics == []
        return len(counted) - before

    assert of_three() == 3
    made.segments[1].dynamics = replace(made.segments[1].dynamics, damping=0.31)
    assert of_three() == 2
    made.segments[1].dynamics = replace(made.segments[1].dynamics, damping=0.32)
    made.segments[1].limit = replace(made.segments[1].limit, upper=2.5)
    assert of_three() == 3


def test_start_check_reads_only_collision_meshes(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """The visual mesh is enlarged by a comment. It is already verified and does not affect the start, so it is not read again."""
    made = arm(store)
    record, text = made.segments[0].pieces[0].part.record, b"#" + 90_000 * b"x" + b"\n"
    drawn = kept(store, text + store.read(record.meshes["visual"].sha256), 8, 12)
    made.segments[0].pieces[0].part = dataclasses.replace(
        made.segments[0].pieces[0].part, record=replace(record, meshes={**record.meshes, "visual": drawn}),
    )
    counted = compiled(monkeypatch)
    assert said(made, store) == []
    made.segments[1].axis = (0.0, 1.0, 0.0)
    assert said(made, store) == []
    assert counted[0] > 90_000 > 5 * counted[1] and counted[1] > 3000


def test_textures_are_generated_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    from thingc.targets.mjcf import verify

    pixels: list[int] = []
    true = verify.attempt

    def painting(text: str, files: Any) -> verify.CompileResult:
        verdict = true(text, files)
        pixels.append(verdict.model.ntexdata)
        return verdict

    monkeypatch.setattr(verify, "attempt", painting)
    assert said(arm(store), store, ("bench", "fixed"), ("adrift", "free")) == []
    assert pixels[0] > 100_000 and pixels[1] < 100


def test_changed_mesh_is_verified(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """One part is replaced by an invalid mesh after verification. It is read and rejected."""
    made = arm(store)
    assert said(made, store) == []
    part = made.segments[0].pieces[0].part
    broken = kept(store, b"v 0 0 0\nf 1 1 1\n", 4, 4)
    made.segments[0].pieces[0].part = dataclasses.replace(
        part, record=replace(part.record, meshes={**part.record.meshes, "visual": broken}),
    )
    assert [(code, line) for code, _, line, _ in said(made, store)] == [("TC702", 20)]


def test_session_reads_only_new_meshes(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = compiled(monkeypatch)
    made, memo = arm(store), Memo()

    def found(segment: int, mesh: bytes) -> list[tuple[str, int | None]]:
        piece = made.segments[segment].pieces[0]
        meshes = {**piece.part.record.meshes, "visual": kept(store, mesh, 4, 4)}
        piece.part = dataclasses.replace(piece.part, record=replace(piece.part.record, meshes=meshes))
        request = replace(made.request(store), memo=memo, repeated=True)
        emit(request)
        return [(d.code.code, d.span.line if d.span else None) for d in request.report.sorted_diagnostics()]

    good = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    assert found(0, good) == []
    assert found(0, b"# " + b"x" * 9000 + b"\n" + good) == []
    assert found(1, b"# " + b"y" * 5000 + b"\n" + good) == []
    assert len(counted) == 3 and counted[1] > 9000 and 5000 < counted[2] < 9000
    assert found(0, b"v 0 0 0\nf 1 1 1\n") == [("TC702", 20)]


def test_raw_mesh_attributes_are_verified_with_the_mesh(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    made = arm(store)
    assert said(made, store) == []
    counted = compiled(monkeypatch)
    made.raw = (raw(101, "mesh boxes.Box-4c4c8075_hull scale", "1 1 0"),)
    found = said(made, store)
    assert [(code, line) for code, _, line, _ in found] == [("TC702", 101)]
    assert counted[0] > 5000


def test_unchanged_model_does_not_import_mujoco(store: Store, tmp_path: Path) -> None:
    """If nothing needs verification, neither MuJoCo nor numpy is imported."""
    emit(arm(store).request(store))
    program = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "import pickle\n"
        "request = pickle.load(open(sys.argv[1], 'rb'))\n"
        "from thingc.targets.mjcf.emit import emit\n"
        "emit(request); assert not request.report.diagnostics, request.report.diagnostics\n"
        "print([name for name in ('mujoco', 'numpy') if name in sys.modules])\n"
    )
    kept_request = tmp_path / "request.pickle"
    kept_request.write_bytes(pickle.dumps(arm(store).request(store)))
    tests = str(Path(__file__).resolve().parent.parent)
    run = subprocess.run(
        [sys.executable, "-c", program, str(kept_request), tests, *sys.path[1:]],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert (run.stdout, run.returncode) == ("[]\n", 0), run.stderr


def test_velocity_drive_without_gain_is_valid(store: Store) -> None:
    made = arm(store)
    made.segments[2].actuator = drive("velocity")
    assert said(made, store) == []


def test_chain_beyond_xml_depth_limit_is_an_error(store: Store) -> None:
    """MuJoCo's XML parser supports 500 levels. This is reported, and thingc itself does not exceed the recursion limit."""
    part = unit_box(store)

    def chain(count: int) -> Made:
        return Made(
            segments=[
                Segment(f"s{k}", [Piece(f"p{k}", part)], parent=k - 1 if k else None, joint=f"j{k}" if k else None)  # type: ignore[arg-type]
                for k in range(count)
            ],
            excluded=tuple((k, k + 1) for k in range(count - 1)),
        )

    assert said(chain(400), store) == []
    found = said(chain(1500), store)
    assert [(code, severity, message) for code, severity, _, message in found] == [
        (
            "TC702",
            "error",
            "MuJoCo rejects body `s496`: XML parser error XML_ELEMENT_DEPTH_EXCEEDED (a chain of links "
            "has more than 500 levels)",
        )
    ]
