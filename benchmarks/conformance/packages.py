"""Compute the expected answers for a ROS package: the poses of all frames in MuJoCo, for each named pose in the SRDF."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from reference import Question

CONFIGURATIONS = 200
"""Number of random configurations in which the study checks that links with disabled collisions do not collide."""


def questions(folder: Path) -> Iterator[Question]:
    """Yield a question about the ROS package for every mode of a build."""
    (package,) = (folder / "ros").iterdir()
    for srdf in sorted((package / "config").glob("*.srdf")):
        model = mujoco.MjModel.from_xml_path(str(folder / "mjcf" / f"{srdf.stem}.xml"))
        tree = ElementTree.parse(srdf).getroot()
        bodies = {model.body(k).name for k in range(model.nbody)}  # a `frame` component with the name of a link is the frame of that link
        sites = [name for name in (model.site(k).name for k in range(model.nsite)) if name not in bodies]
        frames = {name: name.replace("/", "_") for name in sites}
        never = [(one.attrib["link1"], one.attrib["link2"]) for one in tree.iter("disable_collisions") if one.attrib["reason"] == "Never"]
        poses = [model.key(k).name for k in range(model.nkey)] if tree.find("group_state") is not None else []
        urdf = package / "urdf" / f"{srdf.stem}.urdf"
        described, root = ElementTree.parse(urdf).getroot(), model.body(1).name.replace("/", "_")
        links = {link.attrib["name"] for link in described.findall("link")}
        mimics = {one.attrib["name"]: one.find("mimic") for one in described.findall("joint")}
        follows = {
            name: [mimic.attrib["joint"], float(mimic.attrib["multiplier"]), float(mimic.attrib["offset"])]
            for name, mimic in mimics.items() if mimic is not None
        }
        request = {
            "package": str(package), "file": str(urdf), "srdf": str(srdf), "joints": [], "follows": follows, "poses": poses,
            "root": f"{root}_frame" if f"{root}_frame" in links else root, "frames": list(frames.values()), "never": never,
            "configurations": CONFIGURATIONS,
        }
        yield Question(srdf.stem, "ROS", request, {"frames": [_frames(model, k, list(frames)) for k in range(len(poses))]})


def _frames(model: mujoco.MjModel, key: int, sites: list[str]) -> list[list[list[float]]]:
    """Return the poses of sites in a keyframe, relative to the root link."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    root = np.linalg.inv(_pose(data.body(1)))
    return [(root @ _pose(data.site(name))).tolist() for name in sites]


def _pose(thing: object) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = thing.xmat.reshape(3, 3), thing.xpos
    return pose
