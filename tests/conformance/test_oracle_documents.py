"""Documents of boxes and cylinders, built by the command line, compared with the matrices of `rig.py`."""

from __future__ import annotations

import copy
import io
import json
import re
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest

from conformance import rig, simulation as sim
from conformance.harness import build_here, thingc_here, tree, write

MODES = {"table": "base", "gripped": "grip/finger", "loose": "boom", "pegged": "base"}
"""The root link of each mode."""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("rig"), rig.DOCUMENTS)


@pytest.fixture(scope="module", params=[60, 95], ids=["span60", "span95"])
def built(request: pytest.FixtureRequest, workspace: Path, shared_store: str) -> tuple[float, Path]:
    """The span [m] and the folder of the build."""
    folder = workspace / "build" / str(request.param)
    build_here("rig.yaml", "-o", folder, "-p", f"span={request.param} mm", store=shared_store, cwd=workspace)
    return request.param * rig.MM, folder / "rig"


@pytest.fixture(scope="module")
def models(built: tuple[float, Path]) -> dict[str, mujoco.MjModel]:
    return {mode: mujoco.MjModel.from_xml_path(str(built[1] / "mjcf" / f"rig_{mode}.xml")) for mode in MODES}


def somewhere(source: np.random.Generator) -> dict[str, float]:
    """Return random joint positions. The mimic joint follows the other joint."""
    q = {
        "swing": source.uniform(-2, 1.7), "slide": source.uniform(-0.01, 0.03), "wrist": source.uniform(-6, 6),
        "grip/open": source.uniform(-1.5, 1.5),
    }
    return {**q, "grip/extend": rig.extension(q["grip/open"])}


@pytest.mark.parametrize("mode", MODES)
def test_part_poses_equal_those_of_the_chain(
    built: tuple[float, Path], models: dict[str, mujoco.MjModel], mode: str
) -> None:
    """The poses are in the world, so the pose of the root is tested, too."""
    span, model = built[0], models[mode]
    assert sim.joints(model) == list(rig.JOINTS) and sim.links(model) == sorted(rig.LINKS)
    source = np.random.default_rng(1)
    for _ in range(10):
        q = somewhere(source)
        chain = rig.placed(q, span)
        carrier, X_WC = rig.rooted(mode, span)
        to_world = X_WC @ np.linalg.inv(chain[carrier])
        data = sim.at(model, q)
        if mode == "loose":  # qpos0 of a free base is the identity only where the mode says nothing
            np.testing.assert_allclose(model.qpos0[:3], X_WC[:3, 3], atol=1e-12)
        found = sim.frames(model, data)
        for path in rig.bodies(span):
            name = path if path != "plumb" else "site plumb"
            np.testing.assert_allclose(found[name], to_world @ chain[path], rtol=0, atol=1e-9, err_msg=path)
        tip = to_world @ chain["tool"] @ rig.bodies(span)["tool"].head
        np.testing.assert_allclose(found["site tip"], tip, rtol=0, atol=1e-9)
        for link, members in rig.LINKS.items():
            body = data.body(link)
            np.testing.assert_allclose(sim.pose(body.xpos, body.xmat), to_world @ chain[members[0]], rtol=0, atol=1e-9)


def test_masses_centres_and_inertias_of_links(built: tuple[float, Path], models: dict[str, mujoco.MjModel]) -> None:
    chain = rig.placed(dict.fromkeys(rig.JOINTS, 0.0), built[0])
    for model in models.values():
        for link, members in rig.LINKS.items():
            own = np.linalg.inv(chain[members[0]])
            mass, centre, inertia = rig.added({path: own @ chain[path] for path in members}, built[0])
            found = sim.inertia_of(model, link)
            assert found[0] == pytest.approx(mass, rel=1e-12)
            np.testing.assert_allclose(found[1], centre, rtol=0, atol=1e-12)
            np.testing.assert_allclose(found[2], inertia, rtol=0, atol=1e-9 * np.abs(inertia).max())


def test_info_agrees(built: tuple[float, Path], workspace: Path, shared_store: str) -> None:
    span = built[0]
    ran = thingc_here("info", "rig.yaml", "-p", f"span={1000 * span:g} mm", "--format", "json", store=shared_store, cwd=workspace)
    assert ran.code == 0
    info = ran.answer
    chain = rig.placed(dict.fromkeys(rig.JOINTS, 0.0), span)
    mass, centre, inertia = rig.added(chain, span)
    assert info["mass"] == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(info["centre"], centre, rtol=0, atol=1e-12)
    np.testing.assert_allclose(info["inertia"], inertia, rtol=0, atol=1e-9 * np.abs(inertia).max())
    said = {o["path"]: (o["mass"], o["mass_source"], o["link"]) for o in info["occurrences"]}
    link_of = {path: link for link, members in rig.LINKS.items() for path in members}
    assert said == {
        path: (pytest.approx(body.mass, rel=1e-12), "stated" if path == "plumb" else "derived", link_of[path])
        for path, body in rig.bodies(span).items()
    }


def test_pose_of_the_document(models: dict[str, mujoco.MjModel]) -> None:
    """A nested pose by its name, and a mimic joint, which no pose sets."""
    q = {"swing": 30 * rig.DEG, "slide": 0.012, "wrist": 200 * rig.DEG, "grip/open": 20 * rig.DEG}
    q["grip/extend"] = rig.extension(q["grip/open"])
    for model in models.values():
        key = model.key("up")
        for name, value in q.items():
            assert key.qpos[model.joint(name).qposadr[0]] == pytest.approx(value, abs=1e-15)
    np.testing.assert_array_equal(models["pegged"].opt.gravity, [-9.81, 0, 0])


def test_mimic_joint_follows(models: dict[str, mujoco.MjModel]) -> None:
    """Released with the finger at another angle, the joint reaches the position for the angle of the jaw within half a second. No other
    force or contact acts. The jaw weighs grams, so a constraint of MuJoCo's default softness would take far longer."""
    model = copy.copy(models["table"])
    model.opt.gravity[:] = 0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = sim.at(model, {**dict.fromkeys(rig.JOINTS, 0.0), "grip/open": 0.5, "grip/extend": 0.0})
    for _ in range(250):
        mujoco.mj_step(model, data)
    opening, found = (float(data.joint(name).qpos[0]) for name in ("grip/open", "grip/extend"))
    assert found == pytest.approx(rig.extension(opening), abs=1e-5)


def test_dynamics_with_a_held_link(models: dict[str, mujoco.MjModel]) -> None:
    """With slides, offsets and a nested robot. All modes give the same dynamics, which equal those of the mode that holds the link."""
    source = np.random.default_rng(4)
    for mode, link in MODES.items():
        q, base = somewhere(source), sim.random_pose(source) if mode in ("gripped", "loose") else None
        model = models[mode]
        matrix, torque = sim.own_dynamics(model, q, base)
        gravity = sim.at(model, q, base).body(link).xmat.reshape(3, 3).T @ model.opt.gravity
        for other in models.values():
            M, tau = sim.held(other, q, link, gravity, sim.random_pose(source))
            np.testing.assert_allclose(M, matrix, rtol=0, atol=1e-9 * np.abs(matrix).max())
            np.testing.assert_allclose(tau, torque, rtol=0, atol=1e-9 * np.abs(torque).max())


# --- the same in TOML -------------------------------------------------------------------------------------------------

TOML = {
    "materials.toml": """
        thingc = "materials/1"
        [materials]
        pine = {density = "500 kg/m^3", color = "burlywood"}
        brass = {density = "8500 kg/m^3", color = "#b5a642"}
    """,
    "grip.toml": """
        thingc = "assembly/1"
        name = "grip"
        parameters = {reach = "20 mm"}
        materials = ["materials.toml"]

        [components]
        palm = {part = "solids:Block", params = {x = "24 mm", y = "16 mm", z = "6 mm"}}
        jaw = {part = "solids:Block", params = {x = "12 mm", y = "10 mm", z = "=reach"}}
        finger = {part = "solids:Rod", params = {radius = "2 mm", length = "=reach"}, material = "brass"}

        [joints.open]
        type = "revolute"
        parent = "palm.top"
        child = "jaw.under"
        turn = "-20 deg"
        limit = {lower = "-90 deg", upper = "90 deg"}

        [joints.extend]
        type = "prismatic"
        parent = "jaw.top"
        child = "finger.foot"
        offset = "1.5 mm"
        mimic = {joint = "open", multiplier = "10 mm/rad", offset = "2 mm"}

        [mounts]
        seat = "palm.under"
        tip = "finger.head"

        [poses]
        closed = {open = "20 deg"}
    """,
    "rig.toml": """
        thingc = "assembly/1"
        name = "rig"
        materials = ["materials.toml"]

        [parameters]
        span = {value = "60 mm", min = "20 mm", max = "200 mm"}

        [defaults]
        component = {material = "pine"}

        [components]
        base = {part = "solids:Block", params = {x = "80 mm", y = "60 mm", z = "12 mm"}}

        [components.post]
        part = "solids:Rod"
        params = {radius = "6 mm", length = "=span"}
        material = "brass"
        attach = {mount = "foot", to = "base.top", turn = "35 deg", gap = "2 mm"}

        [components.shelf]
        part = "solids:Block"
        params = {x = "30 mm", y = "20 mm", z = "8 mm"}
        at = {in = "post.flank", xyz = "3 4 5 mm", rpy = "20 -40 70 deg"}

        [components.peg]
        repeat = {count = 3, as = "i"}
        part = "solids:Rod"
        params = {radius = "=2 mm + i * 1 mm", length = "10 mm"}
        at = {in = "base.origin", xyz = ["=i * 20 mm", "5 mm", 0], rpy = ["180 deg", 0, "=i * 10 deg"]}

        [components.boom]
        part = "solids:Rod"
        params = {radius = "4 mm", length = "=2 * span"}

        [components.slider]
        part = "solids:Block"
        params = {x = "10 mm", y = "12 mm", z = "14 mm"}

        [components.grip]
        assembly = "grip.toml"
        parameters = {reach = "=span / 2"}

        [components.tool]
        part = "solids:Rod"
        params = {radius = "1 mm", length = "25 mm"}
        attach = {foot = "grip.tip"}

        [components.plumb]
        frame = true
        mass = "7 g"
        at = {in = "grip.jaw.top", xyz = "1 2 3 mm"}

        [joints.swing]
        type = "revolute"
        parent = "post.head"
        child = "boom.foot"
        turn = "15 deg"
        gap = "3 mm"
        offset = "25 deg"
        limit = {lower = "-120 deg", upper = "100 deg"}
        dynamics = {armature = "0.001 kg*m^2"}

        [joints.slide]
        type = "prismatic"
        parent = "boom.flank"
        child = "slider.under"
        turn = "-30 deg"
        gap = "1 mm"
        offset = "4 mm"
        limit = {lower = "-10 mm", upper = "30 mm"}

        [joints.wrist]
        type = "continuous"
        parent = "boom.head"
        child = "grip.seat"
        offset = "-50 deg"

        [mounts]
        tip = "tool.head"

        [poses]
        up = {swing = "30 deg", slide = "12 mm", wrist = "200 deg", grip = "closed"}

        [modes]
        table = {root = "base", pose = "up", at = {xyz = "100 -50 20 mm", rpy = "10 20 30 deg"}}
        gripped = {root = "grip.tip", base = "held"}
        loose = {root = "boom", base = "free", at = {xyz = "0 0 300 mm", rpy = [0, "90 deg", 0]}}
        pegged = {root = "peg_1.foot", gravity = "wall"}
    """,
}


def test_toml_documents_give_the_same_bytes(workspace: Path, shared_store: str) -> None:
    """Except for names of documents in outputs, and the properties of documents in the manifest."""
    write(workspace, TOML)
    seen = {}
    for kind in ("yaml", "toml"):
        build_here(f"rig.{kind}", "-o", workspace / kind, store=shared_store, cwd=workspace)
        files = dict(tree(workspace / kind / "rig"))
        for path in [path for path in files if path.endswith(".mjz")]:
            with zipfile.ZipFile(io.BytesIO(files.pop(path))) as archive:
                files.update({f"{path}/{name}": archive.read(name) for name in archive.namelist()})
        manifest = json.loads(files.pop("manifest.json"))
        assert sorted(manifest.pop("documents")) == [f"grip.{kind}", f"materials.{kind}", f"rig.{kind}"]
        assert manifest.pop("document") == f"rig.{kind}"
        assert {*manifest.pop("files"), "manifest.json"} == tree(workspace / kind / "rig").keys()
        for loss in manifest["losses"]:
            loss.pop("line"), loss.pop("file")
        seen[kind] = {path: re.sub(rb"\b(rig|grip|materials)\.toml\b", rb"\1.yaml", data) for path, data in files.items()}
        seen[kind]["manifest"] = json.dumps(manifest).encode()
    assert seen["yaml"].keys() == seen["toml"].keys()
    assert [path for path in seen["yaml"] if seen["yaml"][path] != seen["toml"][path]] == []
