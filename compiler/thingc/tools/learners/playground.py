"""Write `playground/NAME_MODE_constants.py`, with the paths and the names of the MuJoCo model of a mode, as in MuJoCo Playground."""

from __future__ import annotations

from thingc.model.robot.types import Robot
from thingc.targets import Artifacts, EmitRequest
from thingc.targets.mjcf.emit import model_trees
from thingc.targets.xml_writer import Element
from thingc.tools.learners.python_text import PythonExpression, assignment, file_name, module


def emit(request: EmitRequest) -> Artifacts:
    """Write a module for each chosen mode."""
    trees = zip(request.robots, model_trees(request), strict=True)
    return Artifacts(files={f"playground/{file_name(robot)}_constants.py": _module(robot, tree) for robot, tree in trees})


def _module(robot: Robot, tree: Element) -> bytes:
    mode = robot.mode.name
    world = tree.find_or_empty("worldbody")
    paths = {
        "ROOT_PATH": 'Path(__file__).resolve().parents[1] / "mjcf"', "ROBOT_XML": f'ROOT_PATH / "{robot.assembly.name}_{mode}.xml"',
        "SCENE_XML": f'ROOT_PATH / "scene_{mode}.xml"',
    }
    feet = {foot.mount.path for foot in robot.mode.feet}
    sites = _names(world, "site")
    names = {
        "JOINT_NAMES": _names(world, "joint"), "ACTUATOR_NAMES": [one.get("name") for one in tree.find_or_empty("actuator").children],
        "SENSOR_NAMES": [one.get("name") for one in tree.find_or_empty("sensor").children], "SITE_NAMES": sites,
        "FEET_SITES": [site for site in sites if site in feet],
    }
    body = next(one for one in world.children if one.tag == "body")
    blocks = [
        "\n".join(assignment(name, PythonExpression(path)) for name, path in paths.items()), assignment("ROOT_BODY", body.get("name")),
        *(assignment(name, values) for name, values in names.items()),
    ]
    for key in tree.find_or_empty("keyframe").children[:1]:
        arrays = {f"HOME_{name.upper()}": [float(number) for number in key.get(name).split()] for name in ("qpos", "ctrl")}
        blocks += [assignment("HOME_KEYFRAME", key.get("name")), *(assignment(name, array) for name, array in arrays.items())]
    return module(robot, "MuJoCo Playground", ["from pathlib import Path"], blocks)


def _names(world: Element, tag: str) -> list[str]:
    """Return the names of the elements of a kind, in the order of the model."""
    return [element.get("name") for element in world.walk() if element.tag == tag]
