"""The main module of a process that renders small pictures of variants, all with the same camera: `python -m thingc.batch.thumbnails`.

MuJoCo selects a graphics library when the module `mujoco` is imported. The driver does not render pictures itself, because a graphics
library can crash. The process reads lines of JSON from standard input: `{"measure": [model, ...], "pose": ...}`, then `{"draw": [[model,
picture], ...], "points": [...], ...}`. The process writes its answers to standard output: the points that must be visible, then a line for
each picture. The process ends when its input ends.
"""

from __future__ import annotations

import json
import os
import sys

from thingc.base.filesystem import listing
from thingc.base.json_lines_process import connect_to_parent
from thingc.batch.folder_layout import NEW, read_file
from thingc.targets.render.picture import NoGraphics, allow_rendering, extent, ready, small_picture


def load_pictures(path: str) -> tuple[str, dict[str, bytes]]:
    """Read the MuJoCo model file at `path`.

    Return the XML text of the model, and the contents of its mesh files by file name. Raises `OSError` if a file cannot be read.
    """
    folder = os.path.join(os.path.dirname(path), "assets")
    return read_file(path).decode(), {name: read_file(os.path.join(folder, name)) for name in listing(folder)}


def main() -> None:
    """Run the main loop of the rendering process: read a line of standard input, and write the answers to standard output."""
    answer = connect_to_parent()
    allow_rendering()
    os.environ.setdefault("MUJOCO_GL", "egl")
    request = json.loads(sys.stdin.readline() or "null")
    if request is None:
        return
    measured = []
    for path in request["measure"]:
        try:
            measured.append(extent(*load_pictures(path), request["pose"]))
        except (OSError, ValueError):  # the file is missing, or MuJoCo rejects the model
            measured.append(([], (0.0, 0.0, 0.0)))
    answer(measured)
    request = json.loads(sys.stdin.readline() or "null")
    if request is None:
        return
    try:
        ready()
    except NoGraphics as fault:
        answer({"fault": str(fault), "hint": fault.diagnostic.help})
        return
    for path, picture in request["draw"]:
        data = small_picture(*load_pictures(path), request["pose"], request["points"], request["gravity"])
        temporary = os.path.join(os.path.dirname(picture), f"{NEW}{os.path.basename(picture)}-{os.getpid()}")
        with open(temporary, "wb") as stream:
            stream.write(data)
        os.replace(temporary, picture)
        answer({"drawn": picture})


if __name__ == "__main__":
    main()
