"""Write `glb/<name>_<mode>.glb`: the robot in the start pose of a mode, as a tree of links with movable joints, for glTF 2.0 viewers.

    arm_bench:world  ->  base_link  ->  plate:visual (a mesh)
                                    ->  yaw:joint  ->  bracket  ->  ...

The node of a link has the same frame as the link in MJCF and `modes.json`. Each joint coordinate is a node whose z axis is the axis of
motion. To change q, rotate this node about z or move it along z. Lengths are in metres. In glTF, the y axis points up, and colours are
linear (glTF 2.0, sections 3.4 and 3.9.2).
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from typing import Any, Never

import numpy as np
import trimesh

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.joints.twist import Twist, pose_after
from thingc.base.pose import Pose, along, make_translation
from thingc.base.primitives import Primitive
from thingc.geometry.record import Mesh
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Surface
from thingc.model.robot.types import Body, Robot
from thingc.targets.artifact import Artifacts, Loss
from thingc.targets.capabilities import COMPANION, FULL, Capabilities, Lossy, Omitted, Supported, all_of, losses
from thingc.targets.geometry import INFINITE_HALF, channels, linear, material_name, name_with_index
from thingc.targets.request import EmitRequest

Y_UP = Pose(rotation=((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
"""Pose of the world frame (z points up) in the frame of glTF (y points up)."""

ROUND = (16, 16)
"""Number of segments of round shapes, from pole to pole and along half of the circumference."""

_CHAIN = Supported(None, "written as one node for each coordinate")

CAPABILITIES: Capabilities[None, Never, Never, Never, Never] = {
    "joints": {
        "single": FULL, "several": _CHAIN, "universal": _CHAIN, "ball": FULL, "free": FULL,
        "screw": Lossy(None, "omitted", ": glTF cannot couple the rotation and the translation of a node"),
    },
    "of_joints": {**all_of("of_joints", COMPANION), "mimic": Omitted(": the node of the joint does not follow the other joint")},
    "drives": all_of("drives", COMPANION),
    "loops": {
        **all_of("loops", Omitted(": rotating the nodes of joints opens the loop")),
        "hold": Omitted(": rotating the nodes of joints moves the held mount"),
    },
    "bases": {**all_of("bases", COMPANION), "start": FULL},
    "modes": {**all_of("modes", COMPANION), "poses": Supported(None, "the file contains only the start pose of the mode")},
    "links": {**all_of("links", COMPANION), "colours": FULL},
    "shapes": all_of("shapes", COMPANION), "sensors": all_of("sensors", COMPANION), "of_sensors": all_of("of_sensors", COMPANION),
}
"""The features of a robot that glTF can express. Masses, drives and similar properties are not reported as export losses, because users do
not expect them in glTF files.
"""

ROUGHNESS = 0.6
"""Roughness of the material of all surfaces. The value is constant because documents specify colours but no gloss."""


def emit(request: EmitRequest) -> Artifacts:
    """Write a GLB file for each chosen mode. If the robot has no visual shapes, return an export loss instead.

    A file contains each mesh once for each of its colours. Meshes that differ only in colour share their vertices.
    """
    if not any(occurrence.drawn for occurrence in request.assembly.occurrences):
        assembly = request.assembly
        loss = Loss("glb", None, assembly.name, "the robot has no visual geometry", "omitted", assembly.definition.origin)
        return Artifacts(files={}, losses=(loss,))
    load_mesh = cache(partial(_load_mesh, request.store))
    files = {f"glb/{robot.name}_{robot.mode.name}.glb": _glb_bytes(robot, load_mesh) for robot in request.robots}
    return Artifacts(files=dict(sorted(files.items())), losses=losses("glb", CAPABILITIES, request.assembly, request.robots))


class _Node(FrozenStruct):
    """A node of a glTF scene, with its pose relative to its parent node.

    `surface` is the visual shape of the node, if any, `mesh_name` is the name of its mesh, and `extras` contains custom data.
    """

    name: str
    parent: str
    pose: Pose
    surface: Surface | None = None
    mesh_name: str = ""
    extras: Mapping[str, object] = {}


def _nodes(robot: Robot) -> Iterator[_Node]:
    """Yield the nodes of the glTF scene for a robot in the start pose of its mode. Each node comes after its parent."""
    assembly, frame = robot.assembly, robot.start
    names = [assembly.links[body.link].name for body in robot.bodies]
    top = f"{robot.name}_{robot.mode.name}:world"
    yield _Node(name=top, parent="", pose=Y_UP)
    for body, name in zip(robot.bodies, names, strict=True):
        parent, pose = (top if body.parent is None else names[body.parent]), body.X_PL
        if body.parent is None and frame.base is not None:
            pose = frame.base
        for node in _joints(robot, body, parent, pose, frame.q):
            yield node
            parent = node.name
        if body.parent is not None and body.joints:
            pose = _axis(body.joints[-1].twist, at_once=body.at_once).inverse()
        yield _Node(name=name, parent=parent, pose=pose)
        link = assembly.links[body.link]
        for member, pose_in_link in zip(link.members, link.poses, strict=True):
            occurrence = assembly.occurrences[member]
            for index, surface in enumerate(occurrence.drawn):
                mesh_name = occurrence.definition.text if occurrence.listed is None else _mesh_name(surface)
                surface_pose = pose_in_link @ (surface.solid.pose if isinstance(surface.solid, Primitive) else surface.pose)
                visual = name_with_index(f"{occurrence.path}:visual", index)
                yield _Node(name=visual, parent=name, pose=surface_pose, surface=surface, mesh_name=mesh_name)


def _mesh_name(surface: Surface) -> str:
    """Return a name for the mesh of a visual shape. The name depends on the content of the mesh."""
    solid = surface.solid
    if isinstance(solid, Primitive):
        return f"{solid.shape} {' '.join(f'{number:.9g}' for number in solid.size)}"
    return solid.sha256


def _joints(robot: Robot, body: Body, parent: str, pose: Pose, q: Mapping[str, float]) -> Iterator[_Node]:
    """Yield the glTF nodes for the joint coordinates of a body.

    Each node is the parent of the next node. A ball joint or free joint has a single node. `pose` is the pose of the body if all
    coordinates are 0.
    """
    if body.parent is None or not body.joints:
        return
    first = body.joints[0]
    if body.at_once:
        values = tuple(q[joint.path] for joint in body.joints)
        name = f"{robot.assembly.mates[first.mate].name or first.path}:joint"
        pose_at_q = pose @ pose_after(body.twists, values, at_once=True) @ _axis(body.joints[-1].twist, at_once=True)
        yield _Node(name=name, parent=parent, pose=pose_at_q, extras={"kind": first.kind.name, "q": list(values)})
        return
    for joint in body.joints:
        name, axis = f"{joint.path}:joint", _axis(joint.twist)
        bounds = (("lower", joint.limit.lower), ("upper", joint.limit.upper))
        extras = {"kind": joint.kind.name, "q": q[joint.path], **{end: value for end, value in bounds if value is not None}}
        yield _Node(name=name, parent=parent, pose=pose @ joint.twist.exponential(q[joint.path]) @ axis, extras=extras)
        parent, pose = name, axis.inverse()


def _axis(twist: Twist, *, at_once: bool = False) -> Pose:
    """Return a frame for a twist. The z axis of the frame lies on the axis of rotation, or points in the direction of motion.

    For a ball joint, return a frame at its centre whose axes are not changed.
    """
    return make_translation(*twist.anchor) if at_once else along(twist.axis, twist.anchor)


def _load_mesh(store: Store, mesh: Mesh | Primitive) -> Any:
    """Load a mesh of the store (OBJ, in metres) as a trimesh object. A primitive is converted to a mesh that approximates it."""
    if isinstance(mesh, Primitive):
        return _tessellate(mesh)
    return trimesh.load_mesh(io.BytesIO(store.read(mesh.sha256)), file_type="obj", process=False, maintain_order=True)


def _tessellate(primitive: Primitive) -> Any:
    size = primitive.size
    match primitive.shape:
        case "box":
            return trimesh.creation.box(extents=[2.0 * half for half in size])
        case "sphere":
            return trimesh.creation.uv_sphere(radius=size[0], count=ROUND)
        case "ellipsoid":
            stretched: Any = trimesh.creation.uv_sphere(radius=1.0, count=ROUND)
            return stretched.apply_scale(size)
        case "cylinder":
            return trimesh.creation.cylinder(radius=size[0], height=2.0 * size[1], sections=2 * ROUND[0])
        case "capsule":
            return trimesh.creation.capsule(radius=size[0], height=2.0 * size[1], count=list(ROUND))
        case "plane":
            x, y = (half or INFINITE_HALF for half in size[:2])
            corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]
            return trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)


def _glb_bytes(robot: Robot, load_mesh: Callable[[Mesh | Primitive], Any]) -> bytes:
    scene: Any = trimesh.Scene(base_frame="")
    materials: dict[str, dict[str, object]] = {}
    mesh_keys: dict[str, tuple[str, str]] = {}
    for node in _nodes(robot):
        edge = {"frame_to": node.name, "frame_from": node.parent, "matrix": np.array(node.pose.rows()), "metadata": dict(node.extras)}
        if node.surface is None:
            scene.graph.update(**edge)
            continue
        material = _material(node.surface)
        key = f"{node.mesh_name} in {material['name']}"
        if key not in mesh_keys:
            mesh_keys[key] = (node.mesh_name, str(material["name"]))
            materials.setdefault(str(material["name"]), material)
            scene.geometry[key] = load_mesh(node.surface.solid)
        scene.graph.update(**edge, geometry=key)

    def finish(tree: dict[str, Any]) -> None:
        """Set values in the JSON part of a glTF file that trimesh cannot write: the generator, exact colours and mesh names."""
        tree["asset"]["generator"] = "thingc"
        tree["materials"] = list(materials.values())
        numbers = {name: number for number, name in enumerate(materials)}
        for mesh in tree["meshes"]:
            mesh["name"], material = mesh_keys[mesh["name"]]
            del mesh["extras"]  # metadata of the file from which trimesh read the mesh
            mesh["primitives"][0]["material"] = numbers[material]

    data: bytes = scene.export(file_type="glb", include_normals=False, tree_postprocessor=finish)
    return data


def _material(surface: Surface) -> dict[str, object]:
    """Return the glTF material of a surface, with the same name as in the MJCF model.

    If no colour is specified, the material is light grey. The material of an open surface is double-sided.
    """
    red, green, blue, alpha = channels(surface.color or "#bfbfbf")
    name = material_name(surface.material, surface.color) or "color"
    is_open = not surface.solid.closed if isinstance(surface.solid, Mesh) else surface.solid.shape == "plane"
    return {
        "name": f"{name}:open" if is_open else name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [linear(red), linear(green), linear(blue), alpha], "metallicFactor": 0.0, "roughnessFactor": ROUGHNESS,
        },
        **({"doubleSided": True} if is_open else {}),
        **({"alphaMode": "BLEND"} if alpha < 1.0 else {}),
    }
