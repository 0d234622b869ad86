"""Mirrored pairs: a warning appears exactly if the points of one side are not the mirror images of those of the other."""

from __future__ import annotations

from pathlib import Path

import pytest

import thingc

DOCUMENT = """\
thingc: assembly/1
name: pair
components:
  chassis:
    link: true
    mass: 1 kg
    shapes: [{box: 160 100 40 mm}]
    mounts: {left: {xyz: 10 50 5 mm, rpy: -90 0 0 deg}, right: {xyz: PLACE mm, rpy: 90 0 0 deg}}
  left: {link: true, mass: 1 kg, shapes: &arm [{box: 120 6 20 mm}], mounts: {pivot: {xyz: 7 0 0 mm, rpy: 90 0 0 deg}}}
  right: {link: true, mass: 1 kg, shapes: *arm, MIRROR mounts: {pivot: {xyz: 7 0 0 mm, rpy: -90 0 0 deg}}}
joints:
  one: {type: continuous, parent: chassis.left, child: left.pivot, turn: LEFT deg}
  other: {type: continuous, parent: chassis.right, child: right.pivot, turn: RIGHT deg}
modes: {bench: {root: chassis}}
"""


def compile_pair(folder: Path, left: int, right: int, mirror: str = "mirror: y,", place: str = "10 -50 5") -> thingc.Compiled:
    folder.joinpath("thingc.toml").write_text('thingc = "workspace/1"\n')
    text = DOCUMENT.replace("LEFT", str(left)).replace("RIGHT", str(right)).replace("MIRROR", mirror).replace("PLACE", place)
    folder.joinpath("pair.yaml").write_text(text)
    return thingc.compile(str(folder / "pair.yaml"), store=str(folder / "store"))


@pytest.mark.parametrize("left", [-90, 20])
@pytest.mark.parametrize("off", [0, 90, 180, 270, 45])
def test_rotated_side_is_reported(tmp_path: Path, left: int, off: int) -> None:
    """A point (x, y, z) of the left part is (x, -y, z) of its mirror image. An offset of 45 deg may be intended, so it is not reported."""
    robot = compile_pair(tmp_path, left, 180 - left + off)
    assembly = robot.modes["bench"].robot.assembly
    by_path = {one.path: assembly.rest[one.index] for one in assembly.occurrences}
    points = [(0.05, 0.003, 0.02), (0.0, -0.003, 0.01), (-0.05, 0.001, 0.0)]
    images = [by_path["chassis"].inverse().apply(by_path["left"].apply(point)) for point in points]
    found = [by_path["chassis"].inverse().apply(by_path["right"].apply((x, -y, z))) for x, y, z in points]
    alike = all(abs(p[0] - q[0]) + abs(p[1] + q[1]) + abs(p[2] - q[2]) < 1e-9 for p, q in zip(images, found, strict=True))
    turned = [one for one in robot.diagnostics if one.code.code == "TC528"]
    assert alike is (off == 0) and len(turned) == (off in (90, 180, 270))
    if turned:
        back = {90: -90, 180: 180, 270: 90}[off]
        assert f"rotated by {abs(back)} deg" in turned[0].message and f"add {back} deg to the `turn` of" in str(turned[0].help)


@pytest.mark.parametrize(("mirror", "place"), [("", "10 -50 5"), ("mirror: y,", "-10 -50 5")])
def test_unmirrored_pairs_are_not_compared(tmp_path: Path, mirror: str, place: str) -> None:
    """Two copies of one part, and mounts that are not opposite, are not compared."""
    assert not [one for one in compile_pair(tmp_path, 0, 180, mirror, place).diagnostics if one.code.code == "TC528"]
