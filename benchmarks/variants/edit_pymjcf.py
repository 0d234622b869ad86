"""Create variants of a planar arm with PyMJCF (`dm_control.mjcf`), for `beside.py`: `python edit_pymjcf.py MODEL`.

Each line of standard input is a request. The request `save UPPER FORE GAIN FILE` saves a model. The request `time UPPER FORE GAIN ...`
creates a model for each group of three numbers, and prints the CPU time [s].
"""

from __future__ import annotations

import sys
import time
import warnings

warnings.simplefilter("ignore")

import mujoco  # noqa: E402
from dm_control import mjcf  # noqa: E402


def edited(root, upper, fore, gain):
    """Set the numbers and the values that depend on them in a PyMJCF model, and return the compiled model."""
    for name, length, mass in (("upper_arm", upper, 0.1 + 0.9 * upper), ("forearm", fore, 0.08 + 0.7 * fore)):
        inertial = root.find("body", name).inertial
        inertial.mass = mass
        inertial.pos = [length / 2, 0.0, 0.0]
    root.find("body", "forearm").pos = [upper, 0.0, 0.0]
    root.find("site", "tip").pos = [fore, 0.0, 0.0]
    for actuator in root.find_all("actuator"):
        actuator.kp = gain
    return mjcf.Physics.from_mjcf_model(root).model.ptr


def main():
    """Answer the requests on standard input until its end."""
    root = mjcf.from_path(sys.argv[1])
    for line in sys.stdin:
        what, *words = line.split()
        if what == "save":
            mujoco.mj_saveModel(edited(root, *map(float, words[:3])), words[3])
            print("saved", flush=True)
            continue
        begun = time.process_time()
        for at in range(0, len(words), 3):
            edited(root, *map(float, words[at: at + 3]))
        print(time.process_time() - begun, flush=True)


if __name__ == "__main__":
    main()
