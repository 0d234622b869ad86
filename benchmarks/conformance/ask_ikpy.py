"""Read URDF with ikpy: `python ask_ikpy.py REQUESTS ANSWERS`. The program reads the chain from the root to each leaf, and the chain that
ikpy selects by default.
"""

from __future__ import annotations

import sys
import warnings
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version

from ikpy.chain import Chain


def answer(asked):
    joints = ElementTree.parse(asked["file"]).getroot().findall("joint")
    above = {one.find("child").attrib["link"]: one for one in joints}
    parents = {one.find("parent").attrib["link"] for one in joints}
    root = next(iter(parents - above.keys()), None)
    if root is None:
        return {}
    own = Chain.from_urdf_file(asked["file"], base_elements=[root], symbolic=False)
    if asked["joints"] and all(link.joint_type == "fixed" for link in own.links):
        raise ValueError("the chain of first children does not move")
    place = {name: k for k, name in enumerate(asked["joints"])}
    poses = [{root: [[float(i == k) for k in range(4)] for i in range(4)]} for _ in asked["q"]]
    for leaf in above.keys() - parents:
        path, link = [leaf], leaf
        while link in above:
            path[:0] = [(link := above[link].find("parent").attrib["link"]), above[path[0]].attrib["name"]]
        chain = Chain.from_urdf_file(asked["file"], base_elements=path, symbolic=False)
        for values, found in zip(asked["q"], poses):
            q = [values[place[one.name]] if one.name in place else 0.0 for one in chain.links]
            frames = chain.forward_kinematics(q, full_kinematics=True)
            found.update((name, frame.tolist()) for name, frame in zip(path[2::2], frames[1:]))
    return {"frames": [[found[name] for name in asked["frames"]] for found in poses]}


if __name__ == "__main__":
    from asking import serve

    warnings.simplefilter("ignore")  # warnings about fixed joints
    serve(answer, version("ikpy"), sys.argv)
