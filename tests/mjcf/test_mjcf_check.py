"""What MuJoCo says against a model is shown where its cause was written."""

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
    """Code, severity, line and message of everything that emitting says, in the order of the document."""
    request = made.request(store, *modes)
    emit(request)
    return [(d.code.code, d.severity.value, d.span.line if d.span else None, d.message) for d in request.report.ordered()]


def hints(made: Made, store: Store) -> list[Diagnostic]:
    request = made.request(store)
    emit(request)
    return request.report.ordered()


def test_raw_attributes_arrive(store: Store) -> None:
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


def test_raw_attributes_that_mujoco_refuses(store: Store) -> None:
    """All of them in one run, each at its own line, in MuJoCo's words."""
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


def test_a_raw_value_that_only_the_compiler_refuses(store: Store) -> None:
    """MuJoCo's words name the joint, not the attribute: of three raw attributes there, the one to blame is found."""
    made = arm(store)
    made.raw = (raw(101, "joint yaw damping", "1"), raw(102, "joint yaw axis", "0 0 0"), raw(103, "joint yaw margin", "0.1"))
    assert said(made, store) == [("TC702", "error", 102, "MuJoCo rejects `axis` of joint `yaw`: axis too small in joint")]


def test_unknown_and_refused_in_one_run(store: Store) -> None:
    made = arm(store)
    made.raw = (raw(101, "joint yow damping", "1"), raw(102, "joint yaw damping", "much"))
    assert said(made, store) == [
        ("TC701", "error", 101, "`mjcf` has no joint `yow`"),
        ("TC702", "error", 102, "MuJoCo rejects `damping` of joint `yaw`: bad format in attribute 'damping'"),
    ]


def test_a_keyframe_that_does_not_fit(store: Store) -> None:
    """An error that MuJoCo gives without a line: found by its name."""
    made = arm(store)
    made.raw = (raw(101, "key home qpos", "1 2 3 4"),)
    assert said(made, store) == [
        ("TC702", "error", 101, "MuJoCo rejects `qpos` of key `home`: keyframe 'home': invalid qpos size, expected 3, got 4"),
    ]


def test_what_no_raw_attribute_caused(store: Store) -> None:
    """A mesh of noise in the store: the error is at the occurrence that first uses it."""
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


def test_innocent_raw_attributes_are_not_blamed(store: Store) -> None:
    made = arm(store)
    made.segments[1].axis = (0.0, 0.0, 0.0)
    made.raw = (raw(101, "joint yaw margin", "0.1"), raw(102, "option iterations", "20"))
    found = said(made, store)
    assert found == [("TC702", "error", 31, "MuJoCo rejects joint `yaw`: axis too small in joint")]


def test_an_inertia_that_mujoco_refuses_is_at_the_link(store: Store) -> None:
    made = arm(store)
    request = made.request(store)
    properties = request.assembly.links[2].properties
    msgspec.structs.force_setattr(request.assembly.links[2], "properties", replace(properties, mass=1e-20))
    emit(request)
    assert [(d.span.line if d.span else None, d.path, d.message) for d in request.report.ordered()] == [
        (12, "forearm", "MuJoCo rejects body `forearm`: mass and inertia of moving bodies must be larger than mjMINVAL"),
    ]


def test_warnings(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """At the raw attribute that they name; every time, though nothing changed; nothing printed, no log in the folder."""
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


def test_the_users_warning_handler_stays(store: Store) -> None:
    heard: list[str] = []
    mujoco.set_mju_user_warning(heard.append)
    try:
        before = mujoco.get_mju_user_warning()
        emit(arm(store).request(store))
        assert mujoco.get_mju_user_warning() is before
    finally:
        mujoco.set_mju_user_warning(None)


UNKNOWN = [
    ("joint yow damping", "`mjcf` has no joint `yow`", "did you mean `yaw`?"),
    ("joint hand/pich damping", "`mjcf` has no joint `hand/pich`", "did you mean `hand/pitch`?"),
    ("jiont yaw damping", "there are no raw attributes of `jiont`", "did you mean `joint`?"),
    ("geom hand/cap:colision solref", "`mjcf` has no geom `hand/cap:colision`", "did you mean `hand/cap:collision`?"),
    ("body q gravcomp", "`mjcf` has no body `q`", "known bodies: `bracket`, `forearm`, `plate`, `tip`"),
    ("default colision geom solref", "`mjcf` has no class `colision`", "did you mean `collision`?"),
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
def test_raw_attributes_of_nothing(store: Store, path: str, message: str, hint: str) -> None:
    made = arm(store)
    made.raw = (raw(101, path, "1"),)
    assert [(d.code.code, d.span.line if d.span else None, d.message, d.help) for d in hints(made, store)] == [
        ("TC701", 101, message, hint)
    ]


def test_raw_attributes_of_what_only_other_modes_have(store: Store) -> None:
    """A drive that no chosen mode has, the joint of a free base, a keyframe of another mode: no error, no effect."""
    made = arm(store)
    made.present = ("slider",)
    made.raw = (raw(101, "actuator yaw kp", "33"), raw(102, "joint root group", "2"))
    assert said(made, store) == []
    assert said(made, store, ("adrift", "free")) == []


def test_raw_attributes_of_other_targets_are_left_alone(store: Store) -> None:
    made = arm(store)
    made.raw = (replace(raw(101, "joint nothing damping", "1"), target="urdf"),)
    assert said(made, store) == []


def test_raw_names_of_a_nested_document(store: Store) -> None:
    """`link` puts the nested document's path before every name, of things that are no occurrence too."""
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


def plain(store: Store) -> object:
    part = box_part(store, (0, 0, 0), (0.1, 0.1, 0.1))
    return dataclasses.replace(part, definition=replace(part.definition, text="boxes:Box"))


def test_two_definitions_of_one_file_name(store: Store) -> None:
    one, other = plain(store), plain(store)
    one = dataclasses.replace(one, definition=replace(one.definition, reference="a/b.step", text="a/b.step", label="a/b.step"))  # type: ignore
    other = dataclasses.replace(other, definition=replace(other.definition, reference="a.b.step", text="a.b.step", label="a.b.step"))  # type: ignore
    made = Made(segments=[Segment("a", [Piece("a", one), Piece("b", other)])])  # type: ignore[arg-type]
    assert said(made, store) == [
        ("TC751", "error", 21, "`a.b.step` and `a/b.step` would both be written as `mjcf/assets/a.b.step.obj`"),
    ]


# --- what need not be asked again ------------------------------------------------------------------------------------


def compiled(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The sizes of the asset files of every compilation from now on, all by one thread: of several that compile with the same files MuJoCo
    gives one the model of another, now and then."""
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


def test_a_model_is_compiled_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_one_of_several_models_is_warned_of(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = compiled(monkeypatch)
    made = arm(store)
    made.raw = (raw(102, "statistic meaninertia", "2"),)
    modes = (("bench", "fixed"), ("adrift", "free"), ("loose", "free"))
    assert [(code, line) for code, _, line, _ in said(made, store, *modes)] == [("TC703", 102)]
    assert len(counted) == 3


def test_modes_that_differ_in_names_and_gravity_start_alike(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are all compiled, and one of them is looked at in its first instant."""
    from thingc.targets.mjcf import verify

    looked: list[str] = []
    counted = compiled(monkeypatch)
    true = verify.initial_state_checks.look

    def looking(model: Any, robot: Any) -> verify.initial_state_checks.InitialState:
        looked.append(robot.mode.name)
        return true(model, robot)

    monkeypatch.setattr(verify.initial_state_checks, "look", looking)

    def of_three(made: Made) -> list[str]:
        request = made.request(store, ("floor", "fixed"), ("wall", "fixed"), ("adrift", "free"))
        floor, wall, adrift = request.robots
        request = replace(request, robots=(floor, replace(wall, gravity=(9.81, 0.0, 0.0)), adrift))
        emit(request)
        return [d.code.code for d in request.report.ordered()]

    assert of_three(arm(store)) == []
    assert len(counted) == 3 and looked == ["floor", "adrift"]
    chattering = arm(store)
    assert chattering.segments[1].actuator is not None
    chattering.segments[1].actuator = replace(chattering.segments[1].actuator, kp=1e9)
    for _ in range(2):  # nothing that is not in order is known
        assert of_three(chattering) == ["TC612"]
    assert looked[2:] == 2 * ["floor", "adrift"]


def test_of_modes_that_start_alike_one_is_compiled_again_in_a_session(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another damping, then a limit as well: with that, each mode has something of its own that nobody has seen yet."""
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


def test_of_what_starts_otherwise_only_what_touches_is_read_again(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawn mesh of a part is longer by a comment. It is known then, and no start depends on it."""
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


def test_textures_are_painted_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_a_new_mesh_is_read(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """One part changed into noise after everything was known: that one is read, and refused."""
    made = arm(store)
    assert said(made, store) == []
    part = made.segments[0].pieces[0].part
    broken = kept(store, b"v 0 0 0\nf 1 1 1\n", 4, 4)
    made.segments[0].pieces[0].part = dataclasses.replace(
        part, record=replace(part.record, meshes={**part.record.meshes, "visual": broken}),
    )
    assert [(code, line) for code, _, line, _ in said(made, store)] == [("TC702", 20)]


def test_of_the_next_model_of_a_session_new_meshes_are_read_and_no_others(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = compiled(monkeypatch)
    made, memo = arm(store), Memo()

    def found(segment: int, mesh: bytes) -> list[tuple[str, int | None]]:
        piece = made.segments[segment].pieces[0]
        meshes = {**piece.part.record.meshes, "visual": kept(store, mesh, 4, 4)}
        piece.part = dataclasses.replace(piece.part, record=replace(piece.part.record, meshes=meshes))
        request = replace(made.request(store), memo=memo, repeated=True)
        emit(request)
        return [(d.code.code, d.span.line if d.span else None) for d in request.report.ordered()]

    good = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    assert found(0, good) == []
    assert found(0, b"# " + b"x" * 9000 + b"\n" + good) == []
    assert found(1, b"# " + b"y" * 5000 + b"\n" + good) == []
    assert len(counted) == 3 and counted[1] > 9000 and 5000 < counted[2] < 9000
    assert found(0, b"v 0 0 0\nf 1 1 1\n") == [("TC702", 20)]


def test_raw_attributes_of_meshes_are_tried_on_the_mesh(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    made = arm(store)
    assert said(made, store) == []
    counted = compiled(monkeypatch)
    made.raw = (raw(101, "mesh boxes.Box-4c4c8075_hull scale", "1 1 0"),)
    found = said(made, store)
    assert [(code, line) for code, _, line, _ in found] == [("TC702", 101)]
    assert counted[0] > 5000


def test_an_unchanged_model_needs_no_mujoco(store: Store, tmp_path: Path) -> None:
    """Nothing of MuJoCo or numpy is imported when there is nothing to ask."""
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


def test_a_velocity_drive_may_have_no_gain(store: Store) -> None:
    made = arm(store)
    made.segments[2].actuator = drive("velocity")
    assert said(made, store) == []


def test_a_chain_longer_than_mujoco_reads(store: Store) -> None:
    """Its XML reader stops at 500 levels: that is said, and nothing of ours runs out of stack."""
    part = plain(store)

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
            "MuJoCo rejects body `s496`: its XML parser reports XML_ELEMENT_DEPTH_EXCEEDED (it supports 500 levels: a chain of links "
            "is too long)",
        )
    ]
