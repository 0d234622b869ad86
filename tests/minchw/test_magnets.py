"""What a magnet of 300 N holds: pulled off a steel plane by a growing force, and dragged along it, in MuJoCo.

The oracle is arithmetic: the plane lets go where the pull is magnet plus weight, and the foot slides where the drag is friction
times that. Soles: a box and a cylinder, parts of this file's own; and MInchW's foot, alone and under the whole robot.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from math import atan2, radians
from pathlib import Path

import mujoco
import numpy as np
import pytest

from conformance.harness import ROOT, build, write

PULL = 300.0
G = 9.81
SLIDE = 0.4
"""Of the soles' material, which counts on any plane."""

PARTS = """
    from build123d import Box, Cylinder, Pos

    from thingc import MountPoint, Thing


    class BoxSole(Thing):
        def __init__(self):
            super().__init__(material="rubber", color="#444444")
            self.sole = MountPoint("$mate")

        def result(self):
            return Pos(0, 0, 10) * Box(60, 40, 20)


    class RoundSole(Thing):
        def __init__(self):
            super().__init__(material="rubber", color="#444444")
            self.sole = MountPoint("$mate")

        def result(self):
            return Pos(0, 0, 10) * Cylinder(25, 20)
"""

FOOT = """
    thingc: assembly/1
    name: {shape}_foot
    materials: [materials.yaml]
    components:
      foot: {{part: "soles:{part}", collision: {shape}, mass: {{value: 500 g, source: measured}}}}
    modes:
      standing:
        root: foot
        base: free
        contacts: {{adhesion: {{foot.sole: 300 N}}}}
"""

MINCHW_FOOT = """
    thingc: assembly/1
    name: minchw_foot
    materials: [../minchw/materials.yaml]
    defaults: {component: {collision: part}}
    components:
      foot: {part: minchw.leg:Foot, params: {thickness: 5 mm}, material: petg_white, attach: {servo_seat: ankle_servo.bottom}}
      ankle_servo: {part: thingc_stock.dynamixel:XM540}
      magnet: {part: thingc_stock.magnets:HoldingMagnet, collision: cylinder, attach: {back: foot.magnet_seat}}
    modes:
      standing:
        root: magnet.sole
        base: free
        contacts: {adhesion: {magnet.sole: 300 N}}
"""
FEET = {"box": ("foot", "foot/sole", SLIDE), "cylinder": ("foot", "foot/sole", SLIDE), "minchw": ("magnet", "magnet/sole", 0.5)}
"""The root link, the mount of the sole, and the friction of what is in contact."""


@pytest.fixture(scope="module")
def feet(shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The model of each foot, built by the command line."""
    base = tmp_path_factory.mktemp("feet")
    write(base, {
        "parts/soles.py": PARTS.replace('"$mate"', "MATE").replace("import MountPoint, Thing", "import MountPoint, Thing\n    from thingc import Location") if False else PARTS,
        "feet/materials.yaml": "thingc: materials/1\nmaterials: {rubber: {density: 1100 kg/m^3, friction: {slide: 0.4}}}\n",
        "feet/box.yaml": FOOT.format(shape="box", part="BoxSole"),
        "feet/cylinder.yaml": FOOT.format(shape="cylinder", part="RoundSole"),
        "feet/minchw.yaml": MINCHW_FOOT,
    })
    return {}
