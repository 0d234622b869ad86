"""Record the parameters of classes that modules for learning frameworks use, from the source files of the packages.

`python record_signatures.py FOLDER` reads the unpacked wheels in a folder, without importing them, and writes `signatures.json`: the
versions of the packages, and for each class its fields, those of its base classes included.
"""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path

CLASSES = {
    "isaaclab": (
        "isaaclab.assets.ArticulationCfg", "isaaclab.assets.ArticulationCfg.InitialStateCfg", "isaaclab.actuators.ImplicitActuatorCfg",
        "isaaclab.sim.UsdFileCfg",
    ),
    "mjlab": (
        "mjlab.entity.EntityCfg", "mjlab.entity.EntityCfg.InitialStateCfg", "mjlab.entity.EntityArticulationInfoCfg",
        "mjlab.actuator.BuiltinPositionActuatorCfg", "mjlab.actuator.BuiltinVelocityActuatorCfg", "mjlab.actuator.BuiltinMotorActuatorCfg",
    ),
}


def classes(folder: Path) -> dict[str, ast.ClassDef]:
    """Return all classes by name. The name of an inner class includes that of the outer class."""
    found: dict[str, ast.ClassDef] = {}
    for path in sorted(folder.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and (node.name not in found or len(node.body) > len(found[node.name].body)):  # not an alias
                found[node.name] = node
                found |= {f"{node.name}.{inner.name}": inner for inner in node.body if isinstance(inner, ast.ClassDef)}
    return found


def fields(node: ast.ClassDef, known: dict[str, ast.ClassDef]) -> list[str]:
    own = [one.target.id for one in node.body if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)]
    for base in node.bases:
        name = ast.unparse(base)
        own += fields(known[name], known) if name in known and known[name] is not node else []
    return own


def main(folder: Path) -> None:
    recorded = {}
    for package, names in CLASSES.items():
        (info,) = folder.glob(f"{package}-*.dist-info")
        known = classes(folder / package)
        recorded[package] = {
            "version": info.name.removesuffix(".dist-info").partition("-")[2],
            "classes": {name: sorted({*fields(known[name.removeprefix(f"{package}.").partition(".")[2]], known)}) for name in names},
        }
    Path(__file__).with_name("signatures.json").write_text(json.dumps(recorded, indent=2) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
