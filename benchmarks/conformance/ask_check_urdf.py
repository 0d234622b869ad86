"""Check that `check_urdf`, the parser of ROS, accepts a URDF file and finds every link: `python ask_check_urdf.py REQUESTS ANSWERS`."""

from __future__ import annotations

import re
import subprocess
import sys


def answer(asked):
    done = subprocess.run(["check_urdf", asked["file"]], check=False, capture_output=True, text=True)
    if done.returncode:
        raise ValueError((done.stderr or done.stdout).strip().splitlines()[0])
    links = re.findall(r"(?:root Link:|child\(\d+\):)\s+(\S+)", done.stdout)
    missing = sorted(set(asked["frames"]) - set(links))
    if missing:
        raise ValueError(f"no links {', '.join(missing)}")
    return {}


if __name__ == "__main__":
    from asking import serve

    serve(answer, "of liburdfdom", sys.argv)
