"""A separate process that writes builds and is killed repeatedly. It prints the findings as JSON.

    python killed_writer.py FOLDER every exchange|renames      a kill at every step that Python can observe, one after the other

    python killed_writer.py FOLDER random SEED COUNT           kills at random times during an endless sequence of builds"""

from __future__ import annotations

import hashlib
import json
import os
import random
import select
import signal
import sys
import time

from thingc.driver import output

NOT_COUNTED = ("object.", "code.", "compile", "marshal.", "cpython.", "sys._getframe", "import")


def build(version: int) -> dict[str, bytes]:
    """A build in which every byte depends on the version; the set of files changes with it."""
    files = {f"mjcf/assets/{k}.obj": f"{version} {k} ".encode() * 500 for k in range(6)}
    files[f"stl/only_{version}.stl"] = b"x" * version
    files["bom.csv"] = f"version {version}\n".encode()
    listed = {path: hashlib.sha256(data).hexdigest() for path, data in files.items()}
    manifest = {"name": "arm", "document": "arm.yaml", "files": listed, "version": version}
    return files | {"manifest.json": json.dumps(manifest).encode()}


class NoStore:
    """A store without content."""

    def read(self, sha256: str) -> bytes:
        raise KeyError(sha256)


def write(folder: str, version: int) -> None:
    output.write_build(folder, "arm", build(version), NoStore(), "arm.yaml")


def standing(folder: str) -> int | None:
    """The version of the build in the folder, or None if there is no complete build."""
    manifest = output.verify(os.path.join(folder, "arm"))
    return None if manifest is None else int(manifest["version"])


def elsewhere(folder: str, place: object) -> bool:
    """Whether an argument is a path outside the folder. Accesses of Python itself are not counted as steps, because they vary."""
    return isinstance(place, str) and os.path.isabs(place) and not place.startswith(folder)


def killed_at(folder: str, step: int, version: int) -> tuple[bool, str | None]:
    """Fork a child that writes a build and kills itself at its `step`-th system call. Returns whether it died, and at which event."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        steps = 0

        def hook(event: str, arguments: tuple[object, ...]) -> None:
            nonlocal steps
            if event.startswith(NOT_COUNTED) or arguments and elsewhere(folder, arguments[0]):
                return
            steps += 1
            if steps == step:
                os.write(writer, event.encode())
                os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)
        try:
            write(folder, version)
        finally:
            os._exit(0)
    os.close(writer)
    with open(reader, "rb") as stream:
        event = stream.read().decode()
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status), event or None


def every(folder: str, how: str) -> dict[str, object]:
    """Kill at step 1, 2, 3, ... until a build completes. After each kill, check the folder and let the next build repair it."""
    if how == "renames":
        def refuse(a: str, b: str) -> None:
            raise NotImplementedError
        output.exchange = refuse
    write(folder, 1)
    damaged: list[str] = []
    litter: list[str] = []
    absent = 0
    events: list[str] = []
    old, step = 1, 0
    while True:
        step += 1
        died, event = killed_at(folder, step, old + 1)
        if not died:
            break
        events.append(event or "")
        found = standing(folder)
        if found is None and how == "renames" and not os.path.lexists(os.path.join(folder, "arm")):
            absent += 1
        elif found not in (old, old + 1):
            damaged.append(f"step {step} ({event}): {found}")
        old += 2
        write(folder, old)
        if standing(folder) != old:
            damaged.append(f"after step {step} ({event}) the next build did not get through")
        if os.listdir(folder) != ["arm"]:
            litter.append(f"after step {step}: {sorted(os.listdir(folder))}")
    return {"steps": step, "damaged": damaged, "litter": litter, "absent": absent, "events": events}


def at_random(folder: str, seed: int, count: int) -> dict[str, object]:
    """Let a child build versions continuously and kill it after a random time."""
    chance = random.Random(seed)
    write(folder, -1)
    began = time.perf_counter()
    for version in (0, 1):
        write(folder, version)
    # a few builds long, however slow the machine is at the moment: the kills are to come at different places
    longest = 3.0 * (time.perf_counter() - began)
    damaged: list[str] = []
    versions: set[int] = set()
    for _ in range(count):
        start = standing(folder) or 1
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            version = start
            os.write(writer, b"!")
            while True:
                version += 1
                write(folder, version)
        os.read(reader, 1)
        select.select([], [], [], chance.uniform(0.0, longest))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reader)
        os.close(writer)
        found = standing(folder)
        if found is None or found < start:
            damaged.append(f"{start} -> {found}: {sorted(os.listdir(folder))}")
            break
        versions.add(found)
    write(folder, 10**6)
    return {"damaged": damaged, "different": len(versions), "left": sorted(os.listdir(folder))}


if __name__ == "__main__":
    place, what, *rest = sys.argv[1:]
    print(json.dumps(every(place, rest[0]) if what == "every" else at_random(place, int(rest[0]), int(rest[1]))))
