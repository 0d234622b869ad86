"""Compare the MuJoCo model of an imported robot with the model that MuJoCo compiles from the original MJCF file."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy
from ruamel.yaml import YAML

from thingc.base.inertia import MassProperties
from thingc.tools.importing.importing import Imported

FREE, BALL, HIDDEN = 0, 1, 3
SIZES = {2: 1, 3: 2, 5: 2}
"""The number of size parameters of a sphere, a capsule and a cylinder, by MuJoCo's geom type."""
MISSING = math.inf
DEEP, NOTHING = 1e-3, 1e-6
CLOSED = numpy.zeros((8, 8), bool)
"""Geom types in ascending order whose contacts MuJoCo computes analytically; its convex solver handles all others."""
CLOSED[0] = True
CLOSED[[2, 2, 2, 2, 3, 3, 6], [2, 3, 5, 6, 3, 6, 6]] = True

TENDON = (
    "stiffness", "damping", "frictionloss", "armature", "margin", "limited", "range", "lengthspring", "actfrclimited", "actfrcrange",
    "solref_lim", "solimp_lim", "solref_fri", "solimp_fri",
)


SECTIONS = {"links": "components", "frames": "mounts", "sites": "mounts", "loops": "joints"}


def in_files(imported: Imported) -> dict[str, dict[str, str]]:
    """Return the names that built files use for every element of a source, by kind: the name under `names:` in the document, or else the
    name in the document itself."""
    given = YAML(typ="safe").load(imported.files[imported.document]).get("names", {})
    known = json.loads(imported.files["import.json"])["names"]
    found = {
        kind: {name: given.get(SECTIONS.get(kind, kind), {}).get(word, word) for name, word in words.items()}
        for kind, words in known.items()
    }
    for name, word in known.get("actuators", {}).items():
        usual = given.get("joints", {}) | given.get("tendons", {})
        found["actuators"][name] = given.get("actuators", {}).get(word) or usual.get(word, word)
    return found


def nearest_closed(model: mujoco.MjModel, qpos: numpy.ndarray) -> numpy.ndarray:
    """Return the nearest qpos (rad and m weighted equally) within the joint limits that meets all equalities, computed with MuJoCo's
    Jacobians."""
    model = copy.copy(model)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data, q, back = mujoco.MjData(model), numpy.array(qpos), numpy.zeros(model.nv)
    for _ in range(60):
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        J, error = data.efc_J.reshape(-1, model.nv)[: data.ne], data.efc_pos[: data.ne]
        mujoco.mj_differentiatePos(model, back, 1.0, q, qpos)
        fixed = numpy.zeros(model.nv, bool)
        for _ in range(model.njnt):
            step = numpy.where(fixed, back_to(model, q, back), back)
            step[~fixed] -= numpy.linalg.pinv(J[:, ~fixed], rcond=1e-9) @ (error + J @ step)
            past = beyond(model, q, step) & ~fixed
            if not past.any():
                break
            fixed |= past
        mujoco.mj_integratePos(model, q, step, 1.0)
    return q


def back_to(model: mujoco.MjModel, q: numpy.ndarray, back: numpy.ndarray) -> numpy.ndarray:
    """Return the step that moves every limited joint to the limit that it exceeds or moves towards."""
    step = numpy.array(back)
    for k in (k for k in range(model.njnt) if model.jnt_limited[k] and model.jnt_type[k] > BALL):
        at, dof = int(model.jnt_qposadr[k]), int(model.jnt_dofadr[k])
        low, high = model.jnt_range[k]
        step[dof] = (low if abs(q[at] + back[dof] - low) < abs(q[at] + back[dof] - high) else high) - q[at]
    return step


def beyond(model: mujoco.MjModel, q: numpy.ndarray, step: numpy.ndarray) -> numpy.ndarray:
    """Return which dofs a step moves beyond the limits of their joints."""
    past = numpy.zeros(model.nv, bool)
    for k in (k for k in range(model.njnt) if model.jnt_limited[k] and model.jnt_type[k] > BALL):
        at, dof = int(model.jnt_qposadr[k]), int(model.jnt_dofadr[k])
        past[dof] = not model.jnt_range[k][0] - 1e-12 <= q[at] + step[dof] <= model.jnt_range[k][1] + 1e-12
    return past


def closed_residual(model: mujoco.MjModel, qpos: numpy.ndarray) -> float:
    """Return the largest residual of the equalities [m, rad]."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    return float(numpy.abs(data.efc_pos[: data.ne]).max(initial=0.0))


@dataclass
class Pair:
    """Two models, and the name in `ours` of each body, joint, site, tendon and actuator of `theirs`. `named` contains the names of
    theirs by number, generated if the file has none; `words` maps them to ours. Elements outside the robot have no contacts in
    theirs."""

    theirs: mujoco.MjModel
    ours: mujoco.MjModel
    named: Mapping[str, Mapping[int, str]]
    words: Mapping[str, Mapping[str, str]]
    worst: dict[str, float] = field(default_factory=dict)
    iterated: bool = False

    def __post_init__(self) -> None:
        self.a, self.b = mujoco.MjData(self.theirs), mujoco.MjData(self.ours)
        known = {**self.words["links"], **self.words["frames"]}
        self.bodies = {k: known[name] for k, name in self.named["body"].items() if name in known}
        sites = {name: word for name, word in self.words.get("sites", {}).items() if not word.endswith(".origin")}  # a body's own frame
        self.sites = {k: sites[name] for k, name in self.named["site"].items() if name in sites}
        self.joints = {k: self.words["joints"][name] for k, name in self.named["joint"].items() if name in self.words["joints"]}
        tendons = self.words.get("tendons", {})
        self.tendons = {k: tendons[name] for k, name in self.named["tendon"].items() if name in tendons}
        drives = self.words.get("actuators", {})
        self.drives = {k: drives[name] for k, name in self.named["actuator"].items() if name in drives}
        free = [k for k in range(self.theirs.njnt) if self.theirs.jnt_type[k] == FREE]
        self.base = [k for k in free if int(self.theirs.jnt_bodyid[k]) in self.bodies]
        self.dofs = [self._addresses(k, word) for k, word in [*self.joints.items(), *((k, self.ours.joint(0).name) for k in self.base)]]
        for geom in range(self.theirs.ngeom):
            body = int(self.theirs.geom_bodyid[geom])
            if body not in self.bodies or body == 0 and self.theirs.geom_type[geom] == 0:
                self.theirs.geom_contype[geom] = self.theirs.geom_conaffinity[geom] = 0

    def _addresses(self, k: int, word: str) -> tuple[slice, slice, slice, slice]:
        """Return the slices of qpos (theirs, ours) and qvel (theirs, ours) of a joint."""
        kind = int(self.theirs.jnt_type[k])
        n, m = (7, 6) if kind == FREE else (4, 3) if kind == BALL else (1, 1)
        ours = self.ours.joint(word)
        places = (int(self.theirs.jnt_qposadr[k]), int(ours.qposadr[0]), int(self.theirs.jnt_dofadr[k]), int(ours.dofadr[0]))
        first, second, third, fourth = (slice(at, at + count) for at, count in zip(places, (n, n, m, m), strict=True))
        return first, second, third, fourth

    def say(self, kind: str, ours: object, theirs: object, *, relative: bool = False) -> None:
        """Record the largest difference of a kind, optionally relative to the largest entry."""
        mine, other = numpy.asarray(ours, float), numpy.asarray(theirs, float)
        size = max(float(numpy.abs(other).max(initial=0.0)), NOTHING) if relative else 1.0
        far = MISSING if mine.shape != other.shape else float(numpy.abs(mine - other).max(initial=0.0)) / size
        self.worst[kind] = max(self.worst.get(kind, 0.0), far)

    def put(self, random: numpy.random.Generator) -> None:
        """Set both to the same random state."""
        for data, model in ((self.a, self.theirs), (self.b, self.ours)):
            mujoco.mj_resetData(model, data)
        for at, here, dof, place in self.dofs:
            n = at.stop - at.start
            q = random.uniform(-1.0, 1.0, n)
            if n > 1:
                q[-4:] = random.normal(size=4)
                q[-4:] /= numpy.linalg.norm(q[-4:])
            self.a.qpos[at] = self.b.qpos[here] = q
            self.a.qvel[dof] = self.b.qvel[place] = random.uniform(-1.0, 1.0, dof.stop - dof.start)

    def control(self, random: numpy.random.Generator) -> None:
        """Set the same controls for all drives that both have; other drives are off."""
        self.a.ctrl[:] = 0.0
        for k, word in self.drives.items():
            low, high = self.theirs.actuator_ctrlrange[k] if self.theirs.actuator_ctrllimited[k] else (-1.0, 1.0)
            self.a.ctrl[k] = self.b.ctrl[self.ours.actuator(word).id] = random.uniform(low, high)

    def forward(self) -> None:
        mujoco.mj_forward(self.theirs, self.a)
        mujoco.mj_forward(self.ours, self.b)

    def compare(self, states: int = 50, steps: int = 200) -> dict[str, float]:
        """Compare everything and return the largest difference by kind."""
        random = numpy.random.default_rng(3)
        rows = [numpy.concatenate([numpy.arange(one[k].start, one[k].stop) for one in self.dofs] or [numpy.array([], int)]) for k in (2, 3)]
        for _ in range(states):
            self.put(random)
            self.control(random)
            self.forward()
            self.poses()
            for k, word in self.tendons.items():
                self.say("tendons", self.b.tendon(word).length, self.a.tendon(k).length)
                self.say("tendons", self.b.tendon(word).velocity, self.a.tendon(k).velocity)
            full = [numpy.zeros((model.nv, model.nv)) for model in (self.theirs, self.ours)]
            mujoco.mj_fullM(self.theirs, self.a, full[0])
            mujoco.mj_fullM(self.ours, self.b, full[1])
            self.say("mass matrix", full[1][numpy.ix_(rows[1], rows[1])], full[0][numpy.ix_(rows[0], rows[0])], relative=True)
            for kind, name in (("bias", "qfrc_bias"), ("passive", "qfrc_passive"), ("actuators", "qfrc_actuator")):
                self.say(kind, getattr(self.b, name)[rows[1]], getattr(self.a, name)[rows[0]], relative=True)
            self.contacts()
            self.a.qvel[:], self.b.qvel[:] = 0.0, 0.0
            self.forward()
            self.say("gravity", self.b.qfrc_bias[rows[1]], self.a.qfrc_bias[rows[0]], relative=True)
        self.shapes()
        self.constants(rows)
        self.keyframes()
        self.trajectory(random, steps)
        return self.worst

    def compare_rooted(
        self, model: mujoco.MjModel, root: str, repaired: Mapping[str, MassProperties] | None = None, states: int = 1,
    ) -> None:
        """Compare with `model`, which is ours rooted at the link named `root` in theirs: poses relative to it, and the mass matrix with
        it fixed. The reference is the mass matrix of theirs with all motions relative to that link. `repaired` contains the masses of
        links that have none in theirs. Ball joints have different axes if traversed backwards, so their positions and velocities are
        zero."""
        random, data = numpy.random.default_rng(5), mujoco.MjData(model)
        body = next(k for k, name in self.named["body"].items() if name == root)
        single = {k: word for k, word in self.joints.items() if self.theirs.jnt_type[k] != BALL}
        ours = [int(model.joint(word).dofadr[0]) for word in single.values()]
        weights = {k: (repaired or {})[name] for k, name in self.named["body"].items() if name in (repaired or {})}
        for _ in range(states):
            self.put(random)
            for k, word in self.joints.items():
                at, here = int(self.theirs.jnt_qposadr[k]), int(model.joint(word).qposadr[0])
                if k not in single:
                    self.a.qpos[at : at + 4] = data.qpos[here : here + 4] = (1.0, 0.0, 0.0, 0.0)
                else:
                    data.qpos[here] = self.a.qpos[at]
            mujoco.mj_forward(model, data)
            mujoco.mj_forward(self.theirs, self.a)
            back, there = (numpy.linalg.inv(one) for one in (_placed(data, self.bodies[body]), _matrix(self.a.body(body))))
            of = {word: self.a.body(k) for k, word in self.bodies.items()} | {word: self.a.site(k) for k, word in self.sites.items()}
            for word, theirs in of.items():
                self.say("rooted poses", back @ _placed(data, word), there @ _matrix(theirs))
            full = numpy.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            dofs = [int(self.theirs.jnt_dofadr[k]) for k in single]
            self.say("rooted mass matrix", full[numpy.ix_(ours, ours)], self._held(body, dofs, weights), relative=True)

    def _held(self, body: int, dofs: list[int], weights: Mapping[int, MassProperties]) -> numpy.ndarray:
        """Return the mass matrix of theirs at the current state with a body fixed: every body moves relative to it."""
        theirs, data = self.theirs, self.a
        held = self._jacobian(body, data.xpos[body])
        full = numpy.diag(theirs.dof_armature)
        for k in self.bodies:
            mass, moments, centre, turn = theirs.body_mass[k], numpy.diag(theirs.body_inertia[k]), data.xipos[k], data.ximat[k]
            if k in weights:
                of = weights[k]
                mass, moments, turn = of.mass, numpy.array(of.inertia), data.xmat[k]
                centre = data.xpos[k] + turn.reshape(3, 3) @ of.centre
            moves, turns = self._jacobian(k, centre)
            moves = moves - held[0] - numpy.cross(held[1].T, centre - data.xpos[body]).T
            turns = turn.reshape(3, 3).T @ (turns - held[1])
            full += mass * moves.T @ moves + turns.T @ moments @ turns
        for k in self.tendons:
            along = numpy.zeros(theirs.nv)
            at, count = data.model.ten_J_rowadr[k], data.model.ten_J_rownnz[k]
            along[data.model.ten_J_colind[at : at + count]] = data.ten_J[at : at + count]
            full += theirs.tendon_armature[k] * numpy.outer(along, along)
        return full[numpy.ix_(dofs, dofs)]

    def _jacobian(self, body: int, point: numpy.ndarray) -> tuple[numpy.ndarray, numpy.ndarray]:
        """Return the Jacobians of the translation of a point on a body of theirs, and of the rotation of the body."""
        moves, turns = numpy.zeros((3, self.theirs.nv)), numpy.zeros((3, self.theirs.nv))
        mujoco.mj_jac(self.theirs, self.a, moves, turns, point, body)
        return moves, turns

    def without_contacts(self) -> Pair:
        """Return the same pair with contacts disabled."""
        models = [copy.copy(model) for model in (self.theirs, self.ours)]
        for model in models:
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        return Pair(*models, self.named, self.words)

    def poses(self) -> None:
        for k, word in self.bodies.items():
            ours = self.b.site(word) if mujoco.mj_name2id(self.ours, mujoco.mjtObj.mjOBJ_SITE, word) >= 0 else self.b.body(word)
            self.say("poses", (*ours.xpos, *ours.xmat), (*self.a.xpos[k], *self.a.xmat[k]))
        for k, word in self.sites.items():
            ours = self.b.site(word)
            self.say("poses", (*ours.xpos, *ours.xmat), (*self.a.site_xpos[k], *self.a.site_xmat[k]))

    def contacts(self) -> None:
        """Compare the penetration depths between bodies. A contact that only one model has differs by its depth. Contacts that MuJoCo
        finds by iteration are compared separately, and only up to a depth of one millimetre, because deeper ones are not unique."""
        ours_of = {k: self._body(word) for k, word in self.bodies.items()}
        theirs, ours = self._deepest(self.theirs, self.a, ours_of), self._deepest(self.ours, self.b, None)
        for key in theirs.keys() | ours.keys():
            there, here = theirs.get(key, 0.0), ours.get(key, 0.0)
            deep = key[-1] and max(there, here) <= -DEEP
            self.say("contacts by iteration" if key[-1] else "contacts", 0.0 if deep else here, 0.0 if deep else there)

    def _deepest(
        self, model: mujoco.MjModel, data: mujoco.MjData, ours_of: Mapping[int, int] | None,
    ) -> dict[tuple[int, int, bool], float]:
        """Return the distance of the deepest contact [m], less its margin, for each pair of bodies (by ours' numbers) and whether it is
        found by iteration."""
        found: dict[tuple[int, int, bool], float] = {}
        for contact, iterated in zip(data.contact, _by_iteration(model, data), strict=True):
            bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
            one, other = sorted(bodies if ours_of is None else (ours_of.get(body, -1) for body in bodies))
            key, dist = (one, other, bool(iterated)), float(contact.dist - contact.includemargin)
            found[key] = min(found.get(key, 0.0), dist)
        return found

    def _body(self, word: str) -> int:
        body = mujoco.mj_name2id(self.ours, mujoco.mjtObj.mjOBJ_BODY, word)
        return body if body >= 0 else int(self.ours.site(word).bodyid[0])

    def shapes(self) -> None:
        """Compare each visual and collision shape with the closest one of its kind on the same link of ours."""
        for data, model in ((self.a, self.theirs), (self.b, self.ours)):
            mujoco.mj_resetData(model, data)
        for at, here, _, _ in self.dofs:
            self.b.qpos[here] = self.a.qpos[at]
        self.forward()
        theirs = self.theirs
        for k in range(theirs.ngeom):
            body, kind = int(theirs.geom_bodyid[k]), int(theirs.geom_type[k])
            shown = theirs.geom_group[k] < HIDDEN and theirs.geom_rgba[k][3] > 0.0 and theirs.geom_matid[k] < 0
            if body in self.bodies and body and kind and (shown or theirs.geom_contype[k] or theirs.geom_conaffinity[k]):
                here = self._body(self.bodies[body])
                alike = [g for g in range(self.ours.ngeom) if self.ours.geom_bodyid[g] == here and self.ours.geom_type[g] == kind]
                form = _form(theirs, self.a, k)
                far = [float(numpy.abs(_form(self.ours, self.b, g) - form).max()) for g in alike]
                self.say("shapes", min(far, default=MISSING), 0.0)

    def constants(self, rows: list[numpy.ndarray]) -> None:
        for k, word in self.joints.items():
            ours = self.ours.joint(word)
            limited = bool(self.theirs.jnt_limited[k])
            self.say("limits", [limited, *(ours.range if limited else (0.0, 0.0))],
                     [bool(ours.limited[0]), *(self.theirs.jnt_range[k] if limited else (0.0, 0.0))])
            self.say("springs", [ours.stiffness[0]], [self.theirs.jnt_stiffness[k]])
        for name in ("dof_damping", "dof_armature", "dof_frictionloss", "dof_solref", "dof_solimp"):
            self.say("dynamics", getattr(self.ours, name)[rows[1]], getattr(self.theirs, name)[rows[0]])
        for k, word in self.tendons.items():
            at = self.ours.tendon(word).id
            for name in TENDON:
                said = {"lengthspring": "stiffness", "range": "limited", "actfrcrange": "actfrclimited"}.get(name)
                if said is not None and not getattr(self.theirs, f"tendon_{said}")[k]:
                    continue
                ours, theirs = (numpy.array(getattr(model, f"tendon_{name}")[i]) for model, i in ((self.ours, at), (self.theirs, k)))
                self.say("tendons", ours, theirs)
        for k, word in self.drives.items():
            at = self.ours.actuator(word).id
            for name in ("gear", "gainprm", "biasprm", "ctrllimited", "forcelimited", "ctrlrange", "forcerange", "dyntype"):
                ours, theirs = (numpy.array(getattr(model, f"actuator_{name}")[i]) for model, i in ((self.ours, at), (self.theirs, k)))
                bound = name.removesuffix("range")
                if name.endswith("range") and not getattr(self.theirs, f"actuator_{bound}limited")[k]:
                    continue
                self.say("gains", ours, theirs)
        for name in (
            "timestep", "gravity", "integrator", "cone", "impratio", "solver", "iterations", "disableflags", "enableflags", "density",
        ):
            self.say("options", getattr(self.ours.opt, name), getattr(self.theirs.opt, name))

    def keyframes(self) -> None:
        for number in range(self.theirs.nkey):
            name = mujoco.mj_id2name(self.theirs, mujoco.mjtObj.mjOBJ_KEY, number) or f"key_{number}"
            if "poses" not in self.words and name == f"key_{number}":
                continue  # room for one, that `<size>` makes
            word = self.words.get("poses", {}).get(name)
            at = -1 if word is None else mujoco.mj_name2id(self.ours, mujoco.mjtObj.mjOBJ_KEY, word)
            if at < 0:
                self.say("keyframes", [MISSING], [0.0])
                continue
            self.keyframe(at, number)
            for k, drive in self.drives.items():
                self.say("keyframes", self.ours.key_ctrl[at][self.ours.actuator(drive).id], self.theirs.key_ctrl[number][k])

    def keyframe(self, at: int, number: int) -> None:
        """Compare a keyframe: values equal those of theirs, or, if theirs violates limits or equalities, ours is the closest state that
        meets them."""
        wanted, q, apart = self.theirs.key_qpos[number], numpy.array(self.theirs.key_qpos[number]), numpy.zeros(self.theirs.nv)
        for qpos, here, _, _ in self.dofs:
            q[qpos] = self.ours.key_qpos[at][here]
        nearest = nearest_closed(self.theirs, wanted)
        mujoco.mj_differentiatePos(self.theirs, apart, 1.0, wanted, q)
        far = numpy.linalg.norm(apart)
        mujoco.mj_differentiatePos(self.theirs, apart, 1.0, wanted, nearest)
        if not (numpy.linalg.norm(apart) > NOTHING and closed_residual(self.theirs, q) < NOTHING and far < 1.05 * numpy.linalg.norm(apart)):
            self.say("keyframes", q, wanted)

    def trajectory(self, random: numpy.random.Generator, steps: int) -> None:
        """Simulate both from the initial state of theirs with random controls, and record whether any contact was found by iteration."""
        for data, model in ((self.a, self.theirs), (self.b, self.ours)):
            mujoco.mj_resetData(model, data)
        for at, here, _, _ in self.dofs:
            self.b.qpos[here] = self.a.qpos[at]
        for step in range(steps):
            if step % 20 == 0:
                self.control(random)
            mujoco.mj_step(self.theirs, self.a)
            mujoco.mj_step(self.ours, self.b)
            self.iterated = self.iterated or any(
                _by_iteration(model, data).any() for data, model in ((self.a, self.theirs), (self.b, self.ours))
            )
        for at, here, _, _ in self.dofs:
            self.say("trajectory", self.b.qpos[here], self.a.qpos[at])


def _form(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> numpy.ndarray:
    """Return what distinguishes a geom from others of its type in the world: for a mesh the bounds of its points along x, y and z [m],
    otherwise its pose and sizes."""
    place, turn = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    mesh = int(model.geom_dataid[geom])
    if mesh < 0:
        return numpy.concatenate([place, turn.ravel(), model.geom_size[geom][: SIZES.get(int(model.geom_type[geom]), 3)]])
    first = int(model.mesh_vertadr[mesh])
    points = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])] @ turn.T + place
    return numpy.concatenate([points.min(axis=0), points.max(axis=0)])


def _by_iteration(model: mujoco.MjModel, data: mujoco.MjData) -> numpy.ndarray:
    """Return for each contact whether MuJoCo's convex solver found it."""
    kinds = numpy.sort(model.geom_type[data.contact.geom], axis=1)
    return ~CLOSED[kinds[:, 0], kinds[:, 1]]


def _placed(data: mujoco.MjData, word: str) -> numpy.ndarray:
    """Return the pose (4, 4) of the site with this name, or else of the body."""
    is_site = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_SITE, word) >= 0
    return _matrix(data.site(word) if is_site else data.body(word))


def _matrix(of: object) -> numpy.ndarray:
    found = numpy.eye(4)
    found[:3, :3], found[:3, 3] = of.xmat.reshape(3, 3), of.xpos
    return found
