"""Contact attributes of an imported MJCF file: values that all shapes share are written once, in their default class."""

from __future__ import annotations

from pathlib import Path

import mujoco
import yaml

import thingc
from importing.test_mjcf_names import imported_from

SOLES = """\
<mujoco model="soles">
  <worldbody>
    <body name="hip"><geom name="pad" size="0.1" margin="0.002" solref="0.01 1" friction="0.7"/>
      <body name="left"><joint axis="0 1 0"/>
        <geom name="sole.L" size="0.05" margin="0.002" solref="0.01 1" friction="0.7 0.01" condim="4"/>
      </body>
      <body name="right"><joint axis="0 1 0"/><geom name="sole.R" size="0.05" margin="0.002" solref="0.03 1"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def test_shared_attributes_are_written_once(tmp_path: Path) -> None:
    document = tmp_path / imported_from(SOLES, tmp_path).document
    raw = yaml.safe_load(document.read_text())["raw"]["mjcf"]
    assert raw["default"] == {"collision": {"geom": {"margin": 0.002}}} and not any("margin" in one for one in raw["geom"].values())
    theirs, ours = mujoco.MjModel.from_xml_string(SOLES), thingc.compile(document).modes["source"].model()
    for name in ("pad", "sole.L", "sole.R"):
        one, other = theirs.geom(name), ours.geom(name)
        assert one.margin == other.margin and one.condim == other.condim and one.priority == other.priority
        assert [*one.solref] == [*other.solref] and [*one.friction] == [*other.friction]
