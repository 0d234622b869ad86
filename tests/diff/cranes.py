"""A crane without CAD geometry, which compiles quickly and contains one of every kind of element."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from thingc.driver.environment import Environment, Options
from thingc.driver.pipeline import compile
from thingc.tools.diff.comparison import Comparison, compare
from thingc.tools.diff.snapshot import Change, How, Snapshot
from thingc.tools.diff.take_snapshot import take_snapshot

CRANE = """\
thingc: assembly/1
name: crane

parameters:
  reach: {value: 400 mm, min: 200 mm, max: 800 mm}
  half: =reach / 2

components:
  mast:
    frame: true
    mass: {value: 2 kg, source: measured}
    inertia: {ixx: 4e-2 kg*m^2, iyy: 4e-2 kg*m^2, izz: 1e-3 kg*m^2}
    mounts: {head: {xyz: 0 0 500 mm, rpy: 90 0 0 deg}, foot: {rpy: 180 0 0 deg}}
  boom:
    frame: true
    mass: {value: 300 g, source: measured}
    inertia: {ixx: 1e-4 kg*m^2, iyy: 4e-3 kg*m^2, izz: 4e-3 kg*m^2}
    mounts: {heel: {rpy: 90 0 0 deg}, tip: {xyz: [=reach, 0, 0], rpy: 180 0 0 deg}}
  hook: {frame: true, mass: {value: 120 g, source: measured}, attach: {origin: boom.tip}}
  lamp:
    repeat: {count: 3, as: i}
    frame: true
    mass: 10 g
    at: {in: boom.heel, xyz: [=(i + 1) * 20 mm, 0, 0]}
  cabin: {assembly: cabin.yaml, attach: {floor: mast.foot}}

joints:
  luff:
    type: revolute
    parent: mast.head
    child: boom.heel
    limit: {lower: -60 deg, upper: 20 deg, effort: 9 N*m}
    drive: {kind: position, kp: 20 N*m/rad}

mounts: {tip: boom.tip}
sensors: {tilt: {type: imu, at: tip}}
poses: {up: {luff: -45 deg}, out: {}}

modes:
  stand: {root: mast, base: fixed, pose: up}
  hung: {root: boom.tip, base: fixed, at: {xyz: [0, 0, =reach]}, poses: [up]}
  moon: {extends: hung, gravity: [0, 0, -1.6 m/s^2]}

tests:
  light: {mass: {max: 2.6 kg}}
  holds: {torque_margin: {drive: luff, mode: stand, min: 2}}
"""

CABIN = """\
thingc: assembly/1
name: cabin
parameters:
  width: {value: 200 mm}
components:
  box: {frame: true, mass: 100 g, mounts: {under: {rpy: 180 0 0 deg}, wall: {xyz: [=width / 2, 0, 0]}}}
  seat: {frame: true, mass: 20 g, at: {in: box.wall, xyz: 0 10 0 mm}}
mounts: {floor: box.under}
"""


def write(folder: Path, *edits: tuple[str, str], cabin: tuple[tuple[str, str], ...] = ()) -> Path:
    """Write the crane into a folder after edits, each of which must match exactly once. Returns the path of its document."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text, made in (("crane.yaml", CRANE, edits), ("cabin.yaml", CABIN, cabin)):
        for old, new in made:
            assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {name}"
            text = text.replace(old, new)
        (folder / name).write_text(text)
    return folder / "crane.yaml"


def drawn(document: Path, store: str) -> Snapshot:
    """Snapshot of a document that compiles."""
    with Environment(str(document), Options(store=store)) as environment:
        compilation = compile(environment)
        assert compilation.assembly is not None and not compilation.report.failed, compilation.report.diagnostics
        return take_snapshot(compilation)


def made(comparison: Comparison) -> set[tuple[str, str, str, str | None]]:
    """Changes that were made directly, not consequences."""
    return {(c.what, c.change, c.path, c.field) for c in comparison.changes if not c.caused}


def content(change: Change) -> tuple[str, ...]:
    """Content of a change without its causes and position."""
    return tuple(map(repr, (change.what, change.change, change.path, change.new_path, change.field, change.old, change.new)))


def mirrored(change: Change) -> Change:
    """The same change from the new robot to the old one."""
    there, back = (change.path, None) if change.new_path is None else (change.new_path, change.path)
    how: dict[How, How] = {"added": "removed", "removed": "added"}
    return replace(
        change, change=how.get(change.change, change.change), path=there, new_path=back, old=change.new, new=change.old,
    )


def sound(old: Snapshot, new: Snapshot) -> Comparison:
    """Compare two snapshots, and assert that the reverse comparison is the mirror image and that every cause is a direct change."""
    there, back = compare(old, new), compare(new, old)
    assert sorted(content(mirrored(c)) for c in there.changes) == sorted(map(content, back.changes))
    assert {content(mirrored(c)) for c in there.changes if not c.caused} == {content(c) for c in back.changes if not c.caused}
    named = {c.path for c in there.changes if not c.caused} | {"perhaps"}
    assert [c for c in there.changes if not set(c.because) <= named] == []
    return there
