"""Read original SDF files with Drake: `python ask_drake.py < REQUEST > ANSWER`. Request and answer are JSON.

For each state, the answer contains the poses of all links and frames, and the mass matrix, the bias forces and the gravity forces of the
joints. For some links, the answer also contains the mass matrix of a robot with a free base when this link is held. Requires
`pip install drake`.
"""

import json
import sys

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable


def answer(asked):
    plant = MultibodyPlant(0.001)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    model, *_ = Parser(plant).AddModels(asked["file"])
    plant.Finalize()
    around = plant.GetModelInstanceName(model)

    def found(get, name):
        if name == "world" and get == plant.GetFrameByName:
            return plant.world_frame()
        *inside, own = name.split("::")
        return get(own, plant.GetModelInstanceByName("::".join([around, *inside])))

    joints = [found(plant.GetJointByName, name) for name in asked["joints"]]
    dofs, places = [joint.velocity_start() for joint in joints], [joint.position_start() for joint in joints]
    free = [plant.GetUniqueFloatingBaseBodyOrThrow(model)] if plant.HasUniqueFloatingBaseBody(model) else []
    base = [free[0].floating_velocities_start_in_v() + k for k in range(6)] if free else []
    context = plant.CreateDefaultContext()
    states = []
    for q_of, v_of in asked["states"]:
        q, v = plant.GetPositions(context), np.zeros(plant.num_velocities())
        q[places], v[dofs] = q_of, v_of
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        frames = {
            name: found(plant.GetFrameByName, name).CalcPoseInWorld(context).GetAsMatrix4().tolist() for name in asked["links"]
        }
        full, torque = plant.CalcMassMatrix(context), -plant.CalcGravityGeneralizedForces(context)
        bias = plant.CalcBiasTerm(context) + torque
        held = {}
        for root in asked["roots"] if free else ():
            frame = found(plant.GetFrameByName, root)
            jacobian = plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kV, frame, np.zeros(3), plant.world_frame(), plant.world_frame(),
            )
            still = np.vstack((-np.linalg.solve(jacobian[:, base], jacobian[:, dofs]), np.eye(len(dofs))))
            rows = [*base, *dofs]
            held[root] = (still.T @ full[np.ix_(rows, rows)] @ still).tolist()
        states.append({
            "frames": frames, "mass_matrix": full[np.ix_(dofs, dofs)].tolist(), "held": held, "bias": bias[dofs].tolist(),
            "gravity": torque[dofs].tolist(),
        })
    limits = [(joint.position_lower_limits()[0], joint.position_upper_limits()[0]) for joint in joints]
    ends = {name: [float(lower), float(upper)] for name, (lower, upper) in zip(asked["joints"], limits)}
    return {"states": states, "ends": ends}


if __name__ == "__main__":
    json.dump(answer(json.load(sys.stdin)), sys.stdout)
