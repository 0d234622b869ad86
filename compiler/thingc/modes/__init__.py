"""Switch modes at run time: convert the state of a robot in one mode to the state of the same robot in another mode.

    from thingc.modes import Modes

    robot = Modes.load("build/arm")                                   # reads build/arm/modes.json
    robot.switch(("bench", bench_data), ("adrift", adrift_data))      # fills the second `mujoco.MjData` from the first
    mujoco.mj_forward(adrift_model, adrift_data)

The coordinates q and velocities v of the joints do not change, because they have the same meaning in every mode. Forward kinematics gives
the pose and the twist of the new root link. The converted state is exact if the new base is free, or if the new root link is held and at
rest. If the new mode holds a link that is moving, the argument `on_motion` of `switch` selects the behaviour. The package requires numpy,
but it does not import MuJoCo.

Poses and velocities follow MuJoCo's conventions. Quaternions have the order (w, x, y, z). The twist of a link is a vector of six numbers:
the linear velocity of the link frame's origin in world axes, then the angular velocity in link axes.
"""

from __future__ import annotations

from thingc.modes.errors import BaseElsewhere, BaseMoves, ModesError, UnknownMode, WrongData
from thingc.modes.impact import Impact, caught
from thingc.modes.robot import Modes, SwitchResult
from thingc.modes.state import RobotState
from thingc.modes.tree import Cut, Hold, Inertias, Joint, Link, Mimic, Mode

__all__ = [
    "BaseElsewhere", "BaseMoves", "Cut", "Hold", "Impact", "Inertias", "Joint", "Link", "Mimic", "Mode", "Modes", "ModesError",
    "RobotState", "SwitchResult", "UnknownMode", "WrongData", "caught",
]
