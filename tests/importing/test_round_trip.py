"""An imported URDF robot equals MuJoCo's own reading of the file: in fifty states, and from any root."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy
import pytest

import thingc
from importing.as_original import in_files
from importing.imports import import_cleanly, write_import
from thingc.base.diagnostics import Report
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.importing import Imported, import_robot

SOURCE = Path(__file__).parent / "robots" / "constructs.urdf"
ROOTS = ("upper", "wheel", "rack", "camera mount", "1st_tool", "root")
EXTENSION = '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco>'
STATES = 50


@dataclass(frozen=True)
class Model:
    """A MuJoCo model with its state, accessed by the names of the source."""

    model: mujoco.MjModel
    data: mujoco.MjData

    def put(self, q: dict[str, float], v: dict[str, float]) -> None:
        for name in q:
            self.data.joint(name).qpos[0], self.data.joint(name).qvel[0] = q[name], v[name]
        mujoco.mj_forward(self.model, self.data)

    def dofs(self, names: tuple[str, ...]) -> list[int]:
        return [int(self.model.joint(name).dofadr[0]) for name in names]

    def mass_matrix(self) -> numpy.ndarray:
        full = numpy.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return full

    def pose(self, name: str) -> numpy.ndarray:
        """Return the pose (4, 4) in the world of the site or body with this name."""
        is_site = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, name) >= 0
        one = self.data.site(name) if is_site else self.data.body(name)
        pose = numpy.eye(4)
        pose[:3, :3], pose[:3, 3] = one.xmat.reshape(3, 3), one.xpos
        return pose


@dataclass(frozen=True)
class Case:
    imported: Imported
    original: Model
    free: Model
    modes: dict[str, Model]
    links: dict[str, str]
    joints: dict[str, str]
    words: dict[str, str]

    def states(self) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
        random = numpy.random.default_rng(7)
        for _ in range(STATES):
            yield tuple({name: float(random.uniform(-1.0, 1.0)) for name in self.joints} for _ in range(2))

    def put(self, model: Model, q: dict[str, float], v: dict[str, float]) -> None:
        model.put(*({self.joints[name]: value for name, value in one.items()} for one in (q, v)))


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    imported = import_cleanly(SOURCE, ImportRequest(roots=ROOTS))
    names, words = in_files(imported), json.loads(imported.files["import.json"])["names"]
    compiled = thingc.compile(write_import(imported, tmp_path_factory.mktemp("imported")))
    text = SOURCE.read_text().replace("</robot>", f"{EXTENSION}</robot>")
    fixed, floating = mujoco.MjSpec.from_string(text), mujoco.MjSpec.from_string(text)
    floating.body("base-link").add_freejoint()
    models = [one.compile() for one in (fixed, floating)]
    return Case(
        imported=imported, original=Model(models[0], mujoco.MjData(models[0])), free=Model(models[1], mujoco.MjData(models[1])),
        modes={name: Model(model := mode.model(), mujoco.MjData(model)) for name, mode in compiled.modes.items()},
        links=names["links"] | names["frames"], joints=names["joints"],
        words=words["links"] | words["frames"],
    )


def test_all_links_and_joints_are_imported(case: Case) -> None:
    model = case.original.model
    assert set(case.links) | {"world"} == {model.body(k).name for k in range(model.nbody)}
    assert set(case.joints) == {model.joint(k).name for k in range(model.njnt)}
    assert case.words["base-link"] == "base_link" and case.words["1st_tool"] == "link_1st_tool" and case.words["root"] == "root_link"


def test_source_mode_has_the_dynamics_of_the_source(case: Case) -> None:
    ours, names = case.modes["source"], tuple(case.joints)
    mine, theirs = ours.dofs(tuple(case.joints.values())), case.original.dofs(names)
    for q, v in case.states():
        case.original.put(q, v)
        case.put(ours, q, v)
        for name, word in case.links.items():
            assert numpy.abs(ours.pose(word) - case.original.pose(name)).max() < 1e-9, name
        close(ours.mass_matrix()[numpy.ix_(mine, mine)], case.original.mass_matrix()[numpy.ix_(theirs, theirs)])
        close(ours.data.qfrc_bias[mine], case.original.data.qfrc_bias[theirs])
        close(ours.data.qfrc_passive[mine], case.original.data.qfrc_passive[theirs])


@pytest.mark.parametrize("root", ROOTS)
def test_any_link_can_be_the_root(case: Case, root: str) -> None:
    """Compared are poses relative to the root, and the mass matrix with the root fixed: the projected matrix of the floating original."""
    ours = case.modes[case.words[root]]
    mine, theirs = ours.dofs(tuple(case.joints.values())), case.free.dofs(tuple(case.joints))
    body = case.free.model.body(root).id
    for q, v in list(case.states())[:10]:
        case.free.put(q, v)
        case.put(ours, q, v)
        at, here = numpy.linalg.inv(case.free.pose(root)), numpy.linalg.inv(ours.pose(case.links[root]))
        for name, word in case.links.items():
            assert numpy.abs(here @ ours.pose(word) - at @ case.free.pose(name)).max() < 1e-9, name
        jacobian = numpy.zeros((6, case.free.model.nv))
        mujoco.mj_jacBody(case.free.model, case.free.data, jacobian[:3], jacobian[3:], body)
        still = numpy.vstack((-numpy.linalg.solve(jacobian[:, :6], jacobian[:, theirs]), numpy.eye(len(theirs))))
        rows = [*range(6), *theirs]
        close(ours.mass_matrix()[numpy.ix_(mine, mine)], still.T @ case.free.mass_matrix()[numpy.ix_(rows, rows)] @ still)
    assert numpy.abs(ours.pose(case.links[root]) - numpy.eye(4)).max() < 1e-12


def test_limits_drives_and_couplings(case: Case) -> None:
    """The expected values are copied from the file."""
    model = case.modes["source"].model
    ranges = {name: tuple(model.joint(name).range) for name in case.joints if model.joint(name).limited[0]}
    assert ranges == {
        "shoulder": (-1.2, 1.5707963267948966), "elbow": (-0.4, 2.0), "slide": (-0.02, 0.15), "grip": (-0.1, 0.8), "pull": (-0.05, 0.05),
    }
    assert {name: (model.joint(name).damping[0], model.joint(name).frictionloss[0]) for name in ("shoulder", "spin", "slide")} == {
        "shoulder": (0.7, 0.2), "spin": (0.01, 0.0), "slide": (2.0, 1.0),
    }
    force = {model.actuator(k).name: model.actuator(k).ctrlrange[1] for k in range(model.nu)}
    assert force == {"shoulder": 30.0, "elbow": 12.0, "spin": 3.0, "slide": 40.0}
    couplings = {model.joint(model.eq_obj1id[k]).name: tuple(model.eq_data[k][:2]) for k in range(model.neq)}
    assert couplings == {"grip": (0.05, -0.4), "pull": (0.0, 0.02)}


def test_import_is_deterministic(case: Case) -> None:
    again = import_robot(str(SOURCE), Report(), ImportRequest(roots=ROOTS))
    assert again is not None and again.files == case.imported.files


def close(ours: numpy.ndarray, theirs: numpy.ndarray) -> None:
    assert numpy.abs(ours - theirs).max() <= 1e-9 * numpy.abs(theirs).max()


def test_documentation_example_is_up_to_date(root: Path, tmp_path: Path) -> None:
    blocks = re.findall(r"```(xml|yaml)\n(.*?)```", (root / "docs" / "import.md").read_text(), re.DOTALL)
    (_, source), (_, shown) = blocks[:2]
    (tmp_path / "pendulum.urdf").write_text(source)
    imported = import_robot(str(tmp_path / "pendulum.urdf"), Report(), ImportRequest(roots=["tip"]))
    assert imported is not None and imported.files["pendulum.yaml"].decode() == shown.removeprefix("# pendulum.yaml\n")
