"""Simulate the walking robot in MuJoCo. The angles of hips and ankles are sine waves with a phase difference of a quarter of a period.

    thingc build my_robot.yaml
    python walk.py                  (--show opens MuJoCo's viewer; macOS: mjpython walk.py --show)
"""

import sys
import time
from math import cos, pi, radians, sin
from pathlib import Path

import mujoco

FOLDER = Path(__file__).parent / "build" / "my_robot" / "mjcf"
PERIOD = 1.0
"""Duration of two steps [s]."""
LEAN, SWING = radians(18), radians(20)
"""Amplitude [rad] of the ankle angles, which tilt the robot to one side, and amplitude of the hip angles."""
SECONDS = 10


def gait(t: float) -> dict[str, float]:
    """Return the target angle of each joint [rad] at a time [s].

    The robot leans on one foot and turns about it, so the other foot moves forwards.
    """
    phase, slowly = 2 * pi * t / PERIOD, min(t / PERIOD, 1.0)
    lean, swing = slowly * LEAN * sin(phase), -slowly * SWING * cos(phase)
    return {"left/ankle": lean, "right/ankle": lean, "left/hip": swing, "right/hip": swing}


def main() -> None:
    """Simulate `SECONDS` seconds, and print the distance that the robot walked."""
    if not FOLDER.exists():
        sys.exit("build the robot first: thingc build my_robot.yaml")
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "scene_walking.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    viewer = None
    if "--show" in sys.argv:
        from mujoco.viewer import launch_passive

        viewer = launch_passive(model, data)
    began = time.monotonic()
    while data.time < SECONDS and (viewer is None or viewer.is_running()):
        for joint, angle in gait(data.time).items():
            data.actuator(joint).ctrl = angle
        mujoco.mj_step(model, data)
        if viewer is not None:
            viewer.sync()
            time.sleep(max(0.0, data.time - (time.monotonic() - began)))
    x, y, z = data.body("body").xpos
    print(f"after {data.time:.0f} s: {100 * x:.0f} cm ahead, {100 * abs(y):.0f} cm to the side, head {100 * z:.0f} cm above the floor")


if __name__ == "__main__":
    main()
