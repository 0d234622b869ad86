"""`python -m thingc.batch.thumbnails`: small pictures of variants, all by one camera, in a process of its own.

Drawing needs a graphics library that is chosen when MuJoCo is imported, and that may crash: neither is the driver's. Lines of JSON
on standard input, `{"measure": [model, ...], "pose": ...}` and then `{"draw": [[model, picture], ...], "points": [...], ...}`; answers
on standard output: the points that a camera has to see, then a line for each picture. When its input ends, it ends.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

from thingc.base.filesystem import listing
from thingc.batch.folder_layout import NEW
from thingc.targets.render.picture import NoGraphics, extent, ready, small_picture


def load_pictures(path: str) -> tuple[str, dict[str, bytes]]:
    """A model's XML and its meshes, by the names that it has for them. Raises `OSError`."""
    with open(path, encoding="utf-8") as stream:
        xml = stream.read()
    folder = os.path.join(os.path.dirname(path), "assets")
    assets: dict[str, bytes] = {}
    for name in listing(folder):
        with open(os.path.join(folder, name), "rb") as mesh:
            assets[name] = mesh.read()
    return xml, assets


def main() -> None:
    """Answer the lines of standard input on standard output until it ends."""
    answers = os.dup(1)
    os.dup2(2, 1)  # whatever libraries print goes to standard error
    os.environ.setdefault("MUJOCO_GL", "egl")

    def answer(value: Any) -> None:
        try:
            os.write(answers, json.dumps(value).encode() + b"\n")
        except BrokenPipeError:
            os._exit(0)

    asked = json.loads(sys.stdin.readline() or "null")
    if asked is None:
        return
    measured = []
    for path in asked["measure"]:
        try:
            measured.append(extent(*load_pictures(path), asked["pose"]))
        except (OSError, ValueError):  # gone, or no model for MuJoCo
            measured.append(([], (0.0, 0.0, 0.0)))
    answer(measured)
    asked = json.loads(sys.stdin.readline() or "null")
    if asked is None:
        return
    try:
        ready()
    except NoGraphics as fault:
        answer({"fault": fault.message, "hint": fault.hint})
        return
    for path, picture in asked["draw"]:
        data = small_picture(*load_pictures(path), asked["pose"], asked["points"], asked["gravity"])
        aside = os.path.join(os.path.dirname(picture), f"{NEW}{os.path.basename(picture)}-{os.getpid()}")
        with open(aside, "wb") as stream:
            stream.write(data)
        os.replace(aside, picture)
        answer({"drawn": picture})


if __name__ == "__main__":
    main()
