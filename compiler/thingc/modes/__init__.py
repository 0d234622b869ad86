"""Switch modes at run time: convert the state of a robot in one mode to the state of the same robot in another mode.

    from thingc.modes import Modes

    robot = Modes.load("build/arm")                                   # reads build/arm/modes.json
    robot.switch(("bench", bench_data), ("adrift", adrift_data))      # fills the second `mujoco.MjData` from the first
    mujoco.mj_forward(adrift_model, adrift_data)

The coordinates q and velocities v of the joints do not change, because they have the same meaning in every mode. The pose and the twist of
the new base are computed by forward kinematics. The conversion is exact for a free base, and for a held base whose root link is at rest. If
the base is held while its link moves, the argument `on_motion` of `switch` selects the behaviour. The package requires numpy, but it does
not import MuJoCo.

The package uses MuJoCo's conventions. Quaternions are (w, x, y, z). The twist of a link is a vector of six numbers, as for a free
joint: the linear velocity of the origin of its frame in world axes, followed by its angular velocity in its own axes.
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
