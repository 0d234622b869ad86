"""Switch modes at run time: convert the state of a robot in one mode to the state of the same robot in another mode.

    from thingc.modes import Modes

    robot = Modes.load("build/arm")                                   # reads build/arm/modes.json
    robot.switch(("bench", bench_data), ("adrift", adrift_data))      # fills the second `mujoco.MjData` from the first
    mujoco.mj_forward(adrift_model, adrift_data)

q and v of the joints do not change, because they have the same meaning in every mode. Forward kinematics gives the pose and twist of the
new base. This is exact for a free base, and for a held base whose root link is at rest. If the base is held while its link moves, the
argument `on_motion` of `switch` selects the behaviour. The package requires numpy, but it does not import MuJoCo.

Conventions are MuJoCo's. Quaternions are (w, x, y, z). The twist of a link is the linear velocity of its frame's origin in world axes,
followed by the angular velocity in the link's own axes, as for a free joint.
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
