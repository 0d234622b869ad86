"""Models of a robot that is held by its front foot, in three formulations: a soft weld, a stiff weld, and the foot as the root.

All models are compiled from one document. The models with a weld use the mode `crawl`, which has a free base, and add a MuJoCo `weld`
between the foot and the world. The rooted model is the mode `front_foot`. Contacts are disabled, because only the attachment of the foot is
compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from pathlib import Path

import mujoco
import numpy as np

import thingc

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "assemblies" / "minchw" / "minchw.yaml"
FOOT, SOLE, TIP = "front/foot", "front/sole", "rear/sole"
"""The body that is held, the site at which it is held, and the site at which the error of the robot is measured."""

INTEGRATORS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
TIMESTEPS = (0.0005, 0.001, 0.002, 0.005)
SOFT, STIFF, ROOTED = "weld, default", "weld, stiff", "rooted"
FORMULATIONS = (SOFT, STIFF, ROOTED)
SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The MuJoCo parameter `solimp` of the stiff weld, with the largest impedance that MuJoCo accepts."""

REACHING = {"front/yaw": 35, "front/knee": 40, "front/ankle": 60, "rear/yaw": -50, "rear/knee": 70, "rear/ankle": 20}
"""Joint angles [deg] of an additional posture in which the legs are not in one plane."""

Vector = np.ndarray


@dataclass(frozen=True)
class Settings:
    """Settings of a simulation: the timestep [s], the name of the integrator, and the time constant of the stiff weld in timesteps."""

    timestep: float
    integrator: str
    stiffness: float = 2.0


class Formulation:
    """A MuJoCo model of the robot on its front foot. Vectors of joint values (q, v, torque) are in the order of `Study.joints`
    in each formulation.
    """

    def __init__(self, name: str, model: mujoco.MjModel, study: Study) -> None:
        self.name, self.model, self.study = name, model, study
        self.q = np.array([model.joint(joint).qposadr[0] for joint in study.joints])
        self.v = np.array([model.joint(joint).dofadr[0] for joint in study.joints])
        self.free = model.nv > len(study.joints)
        self.drives = [model.actuator(joint).id for joint in study.joints]
        self.foot, self.sole, self.tip = model.body(FOOT).id, model.site(SOLE).id, model.site(TIP).id
        self.friction = model.dof_frictionloss.copy()
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT

    def configure(self, settings: Settings, gravity: str, friction: bool, drives: bool = False) -> None:
        """Set the simulation options of the model. All other options are those of the document, including damping and armature."""
        option, flag = self.model.opt, int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        option.timestep, option.integrator = settings.timestep, INTEGRATORS[settings.integrator]
        option.gravity = self.study.gravity[gravity]
        option.disableflags = option.disableflags & ~flag if drives else option.disableflags | flag
        self.model.dof_frictionloss[:] = self.friction if friction else 0.0
        if self.name == STIFF:
            option.disableflags |= mujoco.mjtDisableBit.mjDSBL_REFSAFE
            option.iterations, option.ls_iterations, option.tolerance = 200, 100, 1e-12
            self.model.eq_solref[0] = settings.stiffness * settings.timestep, 1.0
            self.model.eq_solimp[0] = SOLIMP

    def stand(self, q: Vector) -> mujoco.MjData:
        """Return the simulation state at rest at joint positions `q` [rad], with the foot exactly at its held pose."""
        data = mujoco.MjData(self.model)
        self.place(data, q)
        data.ctrl[self.drives] = q
        mujoco.mj_forward(self.model, data)
        return data

    def place(self, data: mujoco.MjData, q: Vector) -> None:
        """Write joint positions. If the base is free, also write the pose of the base that the rooted model has at these joint
        positions.
        """
        data.qpos[self.q] = q
        if self.free:
            data.qpos[:7] = self.study.body_pose(q)

    def torque(self, data: mujoco.MjData, torque: Vector) -> None:
        """Apply joint torques [N m]. No forces are applied to a free base."""
        data.qfrc_applied[self.v] = torque

    def places(self, data: mujoco.MjData) -> tuple[Vector, Vector]:
        """Return positions (3, 3) [m] and the rotation matrix of the held body. The rows are the held sole, the frame of the held body, and
        the free sole.
        """
        mujoco.mj_kinematics(self.model, data)
        points = np.array([data.site_xpos[self.sole], data.xpos[self.foot], data.site_xpos[self.tip]])
        return points, data.xmat[self.foot].reshape(3, 3).copy()


class Study:
    """The compiled document, and data that all formulations share: joints, postures, exact kinematics and torques."""

    def __init__(self, store: str | None = None) -> None:
        compiled = thingc.compile(str(DOCUMENT), modes=["front_foot", "front_foot_wall", "crawl"], store=store)
        self.modes = compiled.modes
        self.assembly = compiled.assembly
        self.exact = self.rooted_model()
        self.exact.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.joints = [self.exact.joint(k).name for k in range(self.exact.njnt)]
        self.gravity = {"floor": self.exact.opt.gravity.copy(), "wall": self.modes["front_foot_wall"].model().opt.gravity.copy()}
        self.friction = self.exact.dof_frictionloss.copy()
        self.scratch = mujoco.MjData(self.exact)
        self.postures = {
            name: np.array([self.exact.key(name).qpos[k] for k in range(self.exact.nq)])
            for name in ("stretched", "arched", "step_rear")
        }
        self.postures["reaching"] = self.vector({joint: radians(angle) for joint, angle in REACHING.items()})

    def vector(self, values: Mapping[str, float]) -> Vector:
        """Convert values by joint name to a vector. Missing joints have the value 0."""
        return np.array([values.get(joint, 0.0) for joint in self.joints])

    def rooted_model(self) -> mujoco.MjModel:
        """Return the MuJoCo model of the mode `front_foot`, without changes."""
        return self.modes["front_foot"].model()

    def weld_xml(self, xml: str, foot: str = FOOT) -> str:
        """Add a weld between the foot and the world to a model with a free base, and return its MJCF text. The foot is welded at the pose
        of the rooted model, with MuJoCo's default softness.
        """
        foot_pose = np.concatenate([self.exact.body(FOOT).pos, self.exact.body(FOOT).quat])
        back, turn = np.zeros(3), np.zeros(4)
        mujoco.mju_negPose(back, turn, foot_pose[:3], foot_pose[3:])
        relative = " ".join(repr(float(x)) for x in (*back, *turn))
        weld = f'<equality><weld name="hold" body1="{foot}" relpose="{relative}"/></equality>'
        return xml.replace("</mujoco>", f"{weld}</mujoco>")

    def welded_model(self) -> mujoco.MjModel:
        """Return the MuJoCo model of the mode `crawl` with the weld. The anchor of the weld is the middle of the sole, at the origin of the
        world.
        """
        crawl = self.modes["crawl"]
        return mujoco.MjModel.from_xml_string(self.weld_xml(crawl.mjcf()), crawl.assets())

    def formulation(self, name: str) -> Formulation:
        """Return a new model of the formulation with this name, one of `FORMULATIONS`."""
        return Formulation(name, self.rooted_model() if name == ROOTED else self.welded_model(), self)

    def body_pose(self, q: Vector) -> Vector:
        """Return the exact position [m] and quaternion of the main body in the world when the foot is held."""
        self.scratch.qpos[:] = q
        mujoco.mj_kinematics(self.exact, self.scratch)
        body = self.scratch.body("body")
        return np.concatenate([body.xpos, body.xquat])

    def tip(self, q: Vector) -> Vector:
        """Return the exact position (3,) [m] of the sole of the free foot."""
        self.scratch.qpos[:] = q
        mujoco.mj_kinematics(self.exact, self.scratch)
        return self.scratch.site(TIP).xpos.copy()

    def inverse(self, q: Vector, v: Vector, a: Vector, gravity: str, friction: bool) -> Vector:
        """Return the joint torques [N m] of a motion, computed with inverse dynamics of the rooted model."""
        self.exact.opt.gravity = self.gravity[gravity]
        self.exact.dof_frictionloss[:] = self.friction if friction else 0.0
        data = self.scratch
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(self.exact, data)
        return data.qfrc_inverse.copy()

    def holding(self, q: Vector, gravity: str) -> Vector:
        """Return the joint torques [N m] that keep a posture at rest."""
        rest = np.zeros_like(q)
        return self.inverse(q, rest, rest, gravity, friction=False)
