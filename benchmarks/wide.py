"""Write a robot of 1 000 components in 20 documents, to measure `check` of a large robot. Each document nests up to two other documents."""

from __future__ import annotations

from pathlib import Path

DOCUMENTS = 20
COMPONENTS = 1000


def write_wide(folder: Path) -> str:
    """Write the 20 documents to a folder. Return the name of the document that nests all other documents."""
    own = COMPONENTS // DOCUMENTS
    for number in range(DOCUMENTS):
        inner = [child for child in (2 * number + 1, 2 * number + 2) if child < DOCUMENTS]
        lines = [
            "thingc: assembly/1", f"name: level{number}", "parameters:", "  reach: {value: 40 mm, min: 10 mm}",
            "materials: {steel: {density: 7850 kg/m^3}, aluminium: {density: 2700 kg/m^3}}", "components:",
            "  base: {part: thingc_stock.dynamixel:XM430}",
        ]
        for k in range(1, own):
            size = ("M3", "M4")[k % 2]
            lines.append(f"  screw{k}:\n    part: thingc_stock.fasteners:Screw\n    params: {{size: {size}, length: 8 mm}}")
            lines.append(f"    material: steel\n    at: {{in: base.origin, xyz: [{k} mm, =reach / 2 + {k} mm, 0], rpy: [0, {k} deg, 0]}}")
        for child in inner:
            lines.append(f"  level{child}:\n    assembly: level{child}.yaml\n    parameters: {{reach: =reach + 1 mm}}")
        if inner:
            lines.append("joints:")
        for child in inner:
            lines.append(
                f"  turn{child}:\n    type: revolute\n    parent: base.rotor\n    child: level{child}.origin\n"
                f"    limit: {{lower: -90 deg, upper: 90 deg}}\n    dynamics: {{damping: 0.02 N*m*s/rad}}\n    drive: base"
            )
        if number == 0:
            lines.append('poses:\n  home: {turn1: 10 deg, "level1.turn*": 20 deg}\nmodes:\n  still: {root: base}')
            lines.append("  loose: {root: base, base: free, pose: home}")
        (folder / f"level{number}.yaml").write_text("\n".join([*lines, ""]))
    return "level0.yaml"
