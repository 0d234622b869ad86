"""Read the manifest of a ROS package with catkin_pkg, which colcon uses: `python ask_catkin_pkg.py REQUESTS ANSWERS`."""

from __future__ import annotations

import sys
from importlib.metadata import version

from catkin_pkg.package import parse_package


def answer(asked):
    warnings = []
    package = parse_package(asked["package"], warnings=warnings)
    package.validate(warnings=warnings)
    if warnings or package.package_format != 3 or package.get_build_type() != "ament_cmake":
        raise ValueError("; ".join(warnings) or f"format {package.package_format}, {package.get_build_type()}")
    return {}


if __name__ == "__main__":
    from asking import serve

    serve(answer, version("catkin_pkg"), sys.argv)
