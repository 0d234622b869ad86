"""`thingc motion`: replay of a motion in MuJoCo, with and without a window."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import glfw
import mujoco.viewer
import numpy as np
import pytest

from loops.test_loop_joints import FOURBAR
from thingc.tools.cli.main import main

ARM = """\
thingc: assembly/1
name: arm
components:
  base: {frame: true}
  upper: {frame: true, mass: 0.7 kg, com: 120 0 0 mm, inertia: {ixx: 1e-3 kg*m^2, iyy: 4e-3 kg*m^2, izz: 4e-3 kg*m^2},
    mounts: {elbow: {xyz: 250 0 0 mm}}}
  lower: {frame: true, mass: 0.4 kg, com: 90 0 0 mm, inertia: {ixx: 5e-4 kg*m^2, iyy: 2e-3 kg*m^2, izz: 2e-3 kg*m^2}}
joints:
  shoulder: {type: continuous, parent: base.origin, child: upper.origin, axis: [0, -1, 0], drive: SHOULDER,
    dynamics: {damping: 0.4 N*m*s/rad}}
  elbow: {type: continuous, parent: upper.elbow, child: lower.origin, axis: [0, -1, 0], drive: ELBOW,
    dynamics: {damping: 0.4 N*m*s/rad}}
poses: {low: {shoulder: -40 deg, elbow: 10 deg}, high: {shoulder: 70 deg, elbow: 100 deg}}
motions: {swing: [{pose: low, time: 0.5 s}, {pose: high, time: 1.3 s}]}
modes: {bench: {root: base}}
simulation: {timestep: 0.5 ms, integrator: implicitfast}
"""
MOTOR, STIFF = "{kind: motor, effort: 30 N*m}", "{kind: position, kp: 20000 N*m/rad, kv: 50 N*m*s/rad}"
SPEED = "{kind: velocity, kv: 500 N*m*s/rad}"
PENDULUM = """\
thingc: assembly/1
name: pendulum
components:
  post: {frame: true, mounts: {top: {xyz: 0 0 300 mm}}}
  arm: {frame: true, mass: 200 g, com: 100 0 0 mm, inertia: {ixx: 20 kg*mm^2, iyy: 700 kg*mm^2, izz: 700 kg*mm^2}}
joints:
  lift: {type: revolute, parent: post.top, child: arm.origin, axis: [0, -1, 0], limit: {lower: -90 deg, upper: 90 deg}, drive: DRIVE}
poses: {down: {lift: -45 deg}, up: {lift: 45 deg}}
motions: {wave: [{pose: down, time: 1 s}, {pose: up, time: 1.9 s}]}
modes: {bench: {root: post}}
"""


def run(folder: Path, text: str, *words: str) -> tuple[int, str]:
    """Return the exit code and the combined output."""
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    folder.joinpath("arm.yaml").write_text(text)
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(["motion", str(folder / "arm.yaml"), *words, "--store", str(folder / "store")])
    return code, out.getvalue() + err.getvalue()


@pytest.mark.parametrize(("shoulder", "elbow"), [(STIFF, STIFF), (SPEED, STIFF), (MOTOR, MOTOR)])
def test_every_drive_kind_follows_a_motion(tmp_path: Path, shoulder: str, elbow: str) -> None:
    """The commands of motors come from inverse dynamics, so a simulation without feedback follows the motion."""
    text = ARM.replace("SHOULDER", shoulder).replace("ELBOW", elbow)
    code, out = run(tmp_path, text, "swing", "--format", "json", "--csv", str(tmp_path / "tracked.csv"))
    joints = {one["joint"]: one["error"] for one in json.loads(out)["joints"]}
    assert code == 0 and set(joints) == {"shoulder", "elbow"} and max(joints.values()) < np.radians(2.0), joints
    rows = list(csv.reader((tmp_path / "tracked.csv").read_text().splitlines()))
    assert rows[0] == ["time [s]", "shoulder [deg]", "elbow [deg]"] and len(rows) == 1 + 1600 + 1
    assert [float(one) for one in rows[1]] == pytest.approx([0.5, -40.0, 10.0])
    assert [float(one) for one in rows[-1]] == pytest.approx([1.3, 70.0, 100.0], abs=2.0)


def test_tracked_csv_can_be_used_as_a_motion(tmp_path: Path) -> None:
    """A joint that mimics another joint has no column."""
    text = ARM.replace("SHOULDER", STIFF).replace("ELBOW", STIFF).replace(
        "poses:", "  wheel: {type: continuous, parent: base.origin, child: wheel.origin, mimic: {joint: elbow, multiplier: 2}}\nposes:"
    ).replace("joints:", "  wheel: {frame: true, mass: 1 g, inertia: {ixx: 1e-5 kg*m^2, iyy: 1e-5 kg*m^2, izz: 1e-5 kg*m^2}}\njoints:")
    assert run(tmp_path, text, "--csv", str(tmp_path / "tracked.csv"))[0] == 0
    assert (tmp_path / "tracked.csv").read_text().partition("\n")[0] == "time [s],shoulder [deg],elbow [deg]"
    text = text.replace("motions: {", "motions: {again: {file: tracked.csv}, ")
    code, out = run(tmp_path, text, "--csv", str(tmp_path / "next.csv"), "again")  # an argument can follow the options
    assert code == 0 and (tmp_path / "next.csv").exists(), out


def test_loop_of_a_mode_stays_closed(tmp_path: Path) -> None:
    text = FOURBAR.replace("modes:\n", "motions: {turn: [{pose: at_20, time: 0}, {pose: at_130, time: 2 s}]}\nmodes:\n")
    code, out = run(tmp_path, text, "--format", "json", "--csv", str(tmp_path / "tracked.csv"))
    errors = {one["joint"]: one["error"] for one in json.loads(out)["joints"]}
    assert code == 0 and max(errors.values()) < np.radians(5.0), errors


def diverges(kp: float, kv: float, most: float, rotor: float, speed: bool) -> float:
    """Return the time [s] when the pendulum, in steps of 2 ms with explicit forces, deviates by more than half a turn from the motion in
    one step."""
    turned, rate, off, step = -math.pi / 4.0, 0.0, 0.0, 0.002
    for count in range(1, 450):
        s = count * step / 0.9
        wanted = -math.pi / 4.0 + math.pi / 2.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        command = math.pi / 2.0 * 30.0 * (s**2 - 2.0 * s**3 + s**4) / 0.9 if speed else 0.0
        torque = min(most, max(-most, kp * (wanted - turned) + kv * (command - rate))) - 0.2 * 9.81 * 0.1 * math.cos(turned)
        rate += step * torque / (7e-4 + 0.2 * 0.1**2 + rotor)
        turned += step * rate
        before, off = off, turned - wanted
        if abs(off - before) > math.pi:
            return 1.0 + count * step
    raise AssertionError("does not diverge")


@pytest.mark.parametrize(("drive", "values"), [
    ("{kind: velocity, kv: 5 N*m*s/rad}", (0.0, 5.0, math.inf, 0.0, True)),
    ("{kind: position, kp: 2e6 N*m/rad, kv: 0.5 N*m*s/rad, effort: 1e9 N*m, armature: 4e-4 kg*m^2}", (2e6, 0.5, 1e9, 4e-4, False)),
    ("{kind: position, kp: 1e7 N*m/rad, kv: 100 N*m*s/rad, effort: 1e6 N*m, armature: 1e-6 kg*m^2}", (1e7, 100.0, 1e6, 1e-6, False)),
])
def test_diverging_simulation_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, drive: str, values: tuple[float, float, float, float, bool],
) -> None:
    """The simulation stops. In the last case, MuJoCo does not warn, because the effort limit bounds the acceleration.

    Commands are interpolated between samples of the motion, so the time can differ by one step."""
    monkeypatch.chdir(tmp_path)
    code, out = run(tmp_path, PENDULUM.replace("DRIVE", drive), "--csv", "tracked.csv")
    said = re.match(r"error\[TC612\]: the simulation of motion `wave` diverges at ([\d.]+) s at joint `lift`\n", out)
    assert code == 1 and said is not None and float(said[1]) == pytest.approx(diverges(*values), abs=0.0021), out
    assert "arm.yaml:7:" in out and not {"tracked.csv", "MUJOCO_LOG.TXT"} & {one.name for one in tmp_path.iterdir()}


def test_fast_motion_does_not_count_as_divergence(tmp_path: Path) -> None:
    """The motion turns the joint by more than half a turn per time step, and the drive is too weak to follow."""
    text = PENDULUM.replace("limit: {lower: -90 deg, upper: 90 deg}, ", "").replace("revolute", "continuous")
    drive = "{kind: position, kp: 20 N*m/rad, kv: 0.5 N*m*s/rad, effort: 1 N*m}"
    text = text.replace("up: {lift: 45", "up: {lift: 1e6").replace("DRIVE", drive)
    code, out = run(tmp_path, text, "--format", "json", "--csv", str(tmp_path / "tracked.csv"))
    assert code == 0 and json.loads(out)["joints"][0]["error"] > np.radians(9e5), out


def test_too_long_motion_is_an_error(tmp_path: Path) -> None:
    text = PENDULUM.replace("DRIVE", "{kind: position, kp: 20 N*m/rad, kv: 0.5 N*m*s/rad}").replace("1.9 s", "1000001 s")
    code, out = run(tmp_path, text, "--csv", str(tmp_path / "tracked.csv"))
    assert code == 2 and "the number of time steps (5e+08) exceeds the maximum (1000000)" in out, out


def test_note_lists_drive_properties_not_simulated(tmp_path: Path) -> None:
    drive = "{kind: position, kp: 20 N*m/rad, kv: 0.5 N*m*s/rad, stall: 2 N*m, velocity: 6 rad/s, delay: 4 ms, noise: 0.1 deg}"
    code, out = run(tmp_path, PENDULUM.replace("DRIVE", drive), "--csv", str(tmp_path / "tracked.csv"))
    line = "note: MuJoCo does not simulate some properties of drives (`stall` of `lift`; `noise` of `lift`; `velocity` of `lift`)\n"
    assert code == 0 and line in out, out


@pytest.mark.parametrize(("words", "said"), [
    (("swin",), "there is no motion `swin`"), (("swing", "--mode", "benc"), "no mode `benc`"), (("--csv", "no/t.csv"), "cannot write"),
])
def test_invalid_command_lines(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    code, out = run(tmp_path, ARM.replace("SHOULDER", STIFF).replace("ELBOW", STIFF), *words)
    assert code == 2 and said in out, out


def test_document_without_motions_is_an_error(tmp_path: Path) -> None:
    text = "".join(line for line in ARM.splitlines(keepends=True) if not line.startswith("motions"))
    code, out = run(tmp_path, text.replace("SHOULDER", STIFF).replace("ELBOW", STIFF))
    assert code == 2 and "the document has no motions" in out


class Window:
    """A mock window that closes after the motion has been shown once."""

    def __init__(self, data: Any) -> None:
        self.data, self.shown = data, [data.qpos.copy()]

    def is_running(self) -> bool:
        return self.data.time < 0.79

    def sync(self) -> None:
        self.shown.append(self.data.qpos.copy())


def test_window_shows_the_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    windows: list[Window] = []

    @contextlib.contextmanager
    def launch(model: Any, data: Any) -> Iterator[Window]:
        windows.append(Window(data))
        yield windows[0]

    monkeypatch.setattr(mujoco.viewer, "launch_passive", launch)
    monkeypatch.setattr(glfw, "init", lambda: True)
    clock = SimpleNamespace(monotonic=lambda: 0.0, sleep=lambda seconds: None)  # a simulation that is always faster than real time
    monkeypatch.setattr("thingc.tools.motions.replay.time", clock)
    assert run(tmp_path, ARM.replace("SHOULDER", STIFF).replace("ELBOW", STIFF))[0] == 0
    assert np.degrees(windows[0].shown[-1]) == pytest.approx([70.0, 100.0], abs=1.0)
    monkeypatch.setattr(glfw, "init", lambda: False)
    code, out = run(tmp_path, ARM.replace("SHOULDER", STIFF).replace("ELBOW", STIFF))
    assert code == 2 and "--csv" in out
