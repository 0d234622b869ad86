"""Write `scene_<mode>.xml`, which shows the robot on a floor under a light, as in the scenes of the MuJoCo Menagerie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.memo import Memo
from thingc.base.numeric import dist, maximum, round_significant
from thingc.base.source import Origin
from thingc.model.robot.types import Robot
from thingc.targets.geometry import Box, bounds, placements
from thingc.targets.xml_writer import Element, XmlText, write

FLOOR = "floor"


def scene(robot: Robot, file: str, heading: str, model: XmlText, memo: Memo | None = None, separator: str = "/") -> XmlText:
    """Return the XML text of the scene of a mode. The scene includes the model `file`, which is in the same folder.

    `model` is the content of this file. The paths in the model contain the separator `separator`.
    """
    memo, mode = memo or Memo(), robot.mode
    box = memo(("bounds", mode.name), bounds, *placements(robot))
    title = f"{robot.assembly.name}_{mode.name} scene"
    return memo(("scene", mode.name), _scene, title, box, file, floor_name(model), _held_bodies(robot, separator), heading, mode.origin)


def scene_text(robot: Robot, model: XmlText, separator: str) -> str:
    """Return the XML text of a model with the floor of its scene. Elements of the scene that are purely visual are not included. Paths in
    names contain the separator `separator`.
    """
    root = Element(tag="mujoco")
    _lay_floor(root, root.add("worldbody"), floor_name(model), _held_bodies(robot, separator), {})
    sections = write(root, "").text.partition("<mujoco>\n")[2]
    return model.text.rpartition("</mujoco>")[0] + sections


def _held_bodies(robot: Robot, separator: str) -> tuple[tuple[str, Origin], ...]:
    """Return the names of all bodies that are held in place. Each item also contains the origin of the hold in the documents."""
    holds = {closure.child: closure.origin for closure in reversed(robot.closures) if closure.hold}
    return tuple((robot.assembly.links[robot.bodies[body].link].name.replace("/", separator), at) for body, at in holds.items())


def _scene(title: str, box: Box | None, file: str, floor: str, held: Sequence[tuple[str, Origin]], heading: str, origin: Origin) -> XmlText:
    """Return the XML text of a scene with a floor and a light.

    Elements before the `include` can be overridden by raw attributes. The floor is the plane z = 0 of the world, to which the root of a
    mode is mated. If a mode is on a wall or a ceiling, this plane is the wall or the ceiling. Contacts between held links and the floor are
    excluded, as MuJoCo excludes contacts of a fixed root. To exclude these contacts, the floor belongs to a body. Not every reader can
    refer to the world by name.
    """
    root = Element(tag="mujoco", attributes={"model": title}, origin=origin)
    if box is not None:
        low, high = box
        centre = tuple(round((low[k] + high[k]) / 2.0, 3) for k in range(3))
        extent = round_significant(maximum(dist(low, high), 1e-3), 3)
        root.add("statistic", {"center": centre, "extent": extent})
    visual = root.add("visual")
    visual.add("headlight", {"diffuse": "0.6 0.6 0.6", "ambient": "0.3 0.3 0.3", "specular": "0 0 0"})
    visual.add("rgba", {"haze": "0.15 0.25 0.35 1"})
    visual.add("global", {"azimuth": "120", "elevation": "-20", "offwidth": "1920", "offheight": "1080"})
    root.add("include", {"file": file})
    asset = root.add("asset")
    asset.add("texture", {"type": "skybox", "builtin": "gradient", "rgb1": "0.3 0.5 0.7", "rgb2": "0 0 0", "width": "128", "height": "768"})
    asset.add("texture", {
        "type": "2d", "name": "groundplane", "builtin": "checker", "mark": "edge", "rgb1": "0.2 0.3 0.4", "rgb2": "0.1 0.2 0.3",
        "markrgb": "0.8 0.8 0.8", "width": "300", "height": "300",
    })
    asset.add("material", {"name": "groundplane", "texture": "groundplane", "texuniform": "true", "texrepeat": "5 5", "reflectance": "0.2"})
    world = root.add("worldbody")
    world.add("light", {"pos": "0 0 1.5", "dir": "0 0 -1", "directional": "true"})
    _lay_floor(root, world, floor, held, {"material": "groundplane"})
    return write(root, heading)


def _lay_floor(root: Element, world: Element, floor: str, held: Sequence[tuple[str, Origin]], material: Mapping[str, str]) -> None:
    ground = world.add("body", {"name": floor}) if held else world
    ground.add("geom", {"name": floor, "size": "0 0 0.05", "type": "plane", **material})
    for link, at in held:
        root.child("contact").add("exclude", {"body1": floor, "body2": link}, at)


def floor_name(model: XmlText) -> str:
    """Return the name of the floor geom in the scene.

    If a component has the name `floor`, return `scene:floor`. No component can have this name.
    """
    is_used = any(f'<{kind} name="{FLOOR}"' in model.text for kind in ("body", "geom"))  # the name is the first attribute
    return f"scene:{FLOOR}" if is_used else FLOOR
