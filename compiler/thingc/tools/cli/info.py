"""Implementation of `thingc info`, which shows the components and masses of a robot, and the source of each mass.

Masses are exact integrals of the geometry times density, or values from the document or the part. The source of each mass is shown:
`derived`, `estimated (layers)` for prints with an infill, `measured`, `vendor` or `stated`.

  thingc info assemblies/arm.yaml
  thingc info robot.urdf                                  a robot file of another format
  thingc info assemblies/arm.yaml --mates                 show mated mounts and the directions of their axes
  thingc info assemblies/arm.yaml -p 'reach=120 mm' --format json | jq .mass
"""

from __future__ import annotations

import argparse

from msgspec.structs import replace

from thingc.base.numeric import sum_of
from thingc.base.one_line_repr import format_count
from thingc.driver.environment import with_environment
from thingc.driver.pipeline import compile
from thingc.model.assembly.types import Assembly, Occurrence
from thingc.model.robot.loop_cuts import cut_priorities
from thingc.model.robot.types import Robot
from thingc.tools.cli import console, robot_files
from thingc.tools.importing.import_request import select_robot_files


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `thingc info` to the parser."""
    console.add_document(parser, what="document or robot file (.urdf, .xacro, .sdf, .xml)")
    robot_files.configure(parser)
    parser.add_argument("--mates", action="store_true", help="also show the mated mounts and their alignment")
    console.add_no_code(parser)
    console.add_format(parser)
    console.add_compiling(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `thingc info`. With text output, diagnostics are printed to standard error."""
    options = console.options_of(arguments)
    if arguments.no_code and arguments.document.lower().endswith(".xacro"):
        raise console.WrongCommandLine("--no-code cannot evaluate the Python expressions of a xacro file", "expand the file with `xacro`")
    if select_robot_files([arguments.document]):
        from thingc.tools.importing.imported_document import compile_robot

        compilation = compile_robot(arguments.document, options, robot_files.import_request(arguments))
    else:
        console.require_document(arguments.document)
        compilation = with_environment(arguments.document, replace(options, code=not arguments.no_code), compile)
    diagnostics = console.final(compilation.report, strict=arguments.strict)
    assembly = None if console.exit_code(diagnostics) else compilation.assembly
    if assembly is None:
        return console.print_result(arguments, diagnostics, ())
    lines = [*as_text(assembly, compilation.robots), *(("", *mates_text(assembly)) if arguments.mates else ())]
    return console.print_result(arguments, diagnostics, lines, **as_data(assembly, compilation.robots))


def as_data(assembly: Assembly, robots: tuple[Robot, ...]) -> dict[str, object]:
    """Return a description of the robot for the JSON output: in SI units, at q = 0, and in the frame of the base component."""
    total = assembly.properties
    return {
        "name": assembly.name, "mass": total.mass, "centre": list(total.centre), "inertia": [list(row) for row in total.inertia],
        "occurrences": [
            {
                "path": o.path, "definition": o.definition.text, "mass": o.properties.mass, "mass_source": o.mass_source,
                "link": assembly.links[assembly.link_of[o.index]].name,
            }
            for o in assembly.occurrences
        ],
        "modes": {robot.mode.name: mode_data(robot) for robot in robots},
    }


def mode_data(robot: Robot) -> dict[str, object]:
    """Return a description of one mode for the JSON output.

    The description contains the root, the base, the pose of the root link, and the names of the links and joints, starting at the root.
    """
    return {
        "root": robot.mode.root.path, "base": robot.base, "X_world_root": [list(row) for row in robot.bodies[0].X_PL.rows()],
        "links": [robot.assembly.links[body.link].name for body in robot.bodies],
        "joints": [joint.path for body in robot.bodies for joint in body.joints],
        "loops": [{"cut": cut, "through": through} for cut, through in _cut_loops(robot).items()],
    }


def as_text(assembly: Assembly, robots: tuple[Robot, ...]) -> list[str]:
    """Format the data that `as_data` returns as lines of text. Masses are in grams and lengths in millimetres."""
    total = assembly.properties
    places = (("ixx", 0, 0), ("iyy", 1, 1), ("izz", 2, 2), ("ixy", 0, 1), ("ixz", 0, 2), ("iyz", 1, 2))
    moments = "  ".join(f"{name} {1e6 * total.inertia[i][j]:z.2f}" for name, i, j in places)
    lines = [
        f"{assembly.name}: {_grams(total.mass)} in {format_count(len(assembly.occurrences), 'occurrence')}, "
        f"{format_count(len(assembly.links), 'link')}, {format_count(sum(1 for mate in assembly.mates if mate.joints), 'joint')}",
        "centre of mass  " + "  ".join(f"{1000.0 * x:z.3f}" for x in total.centre) + "  mm, in the frame of "
        f"`{assembly.occurrences[assembly.base].path}` at q = 0",
        f"inertia         {moments}  kg mm^2, about the centre of mass",
        "mass by source  " + _shares(assembly),
        "",
    ]
    rows = [("occurrence", "definition", "mass", "from", "link")]
    rows += [
        (o.path, o.definition.label, _grams(o.properties.mass), _source(o) if o.properties.mass else "-",
         assembly.links[assembly.link_of[o.index]].name)
        for o in assembly.occurrences
    ]
    lines += console.table(rows, right=(2,))
    for robot in robots:
        lines.append("")
        floor_text = f", on the floor with its root at {console.millimetres(robot.mode.at.translation)} mm" if robot.mode.on_floor else ""
        lines.append(f"mode {robot.mode.name}: root {robot.mode.root.path}, base {robot.base}{floor_text}")
        for body in robot.bodies:
            name = assembly.links[body.link].name
            if body.parent is None or body.mate is None:
                lines.append(f"  {name}")
                continue
            parent = assembly.links[robot.bodies[body.parent].link].name
            mate = assembly.mates[body.mate]
            crossed = ", crossed from child to parent" if assembly.link_of[mate.child] != body.link else ""
            by = " ".join(joint.path for joint in body.joints) or mate.name
            joint_text = body.joints[0].kind.name if body.at_once else ", ".join(joint.twist.core for joint in body.joints) or "fixed"
            lines.append(f"  {name}  <- {by} ({joint_text}{crossed}) on {parent}")
        lines += _loops(robot)
    return lines


def _source(occurrence: Occurrence) -> str:
    """Format the source of a mass, such as `estimated`.

    For a printed part with infill, the text includes the method, as in `estimated (layers)`.
    """
    return occurrence.mass_source + (f" ({occurrence.estimate})" if occurrence.estimate is not None else "")


def _loops(robot: Robot) -> list[str]:
    """Describe the supports and the closed loops of a mode, and the remaining gap of each loop in the poses of the mode."""
    names = [robot.assembly.links[body.link].name for body in robot.bodies]
    lines = [f"  stands on {foot.mount.path} (friction {foot.friction:g})" for foot in robot.mode.feet]
    loops = _cut_loops(robot)
    for closure in robot.closures:
        if closure.parent is None:
            turns = ", free to rotate" if closure.kind == "ball" else ""
            lines.append(f"  {names[closure.child]} is held at {closure.path}{turns}")
        else:
            lines.append(f"  {closure.path} ({closure.kind}) closes a loop between {names[closure.parent]} and {names[closure.child]}")
            lines += _why_cut(closure.path, loops[closure.path], robot) if closure.path in loops else []
    for frame in robot.keyframes:
        if frame.residual is not None:
            lines.append(f"  pose {frame.name} closes with an error of {frame.residual[0]:.1e} m and {frame.residual[1]:.1e} rad")
    lines += [f"  pose {one.name} does not close: no keyframe" for one in robot.unclosed]
    return lines


def _cut_loops(robot: Robot) -> dict[str, dict[str, str]]:
    """Return the loops that a mode cuts at joints and that pass through at least two links: the fundamental cycles of the mode's tree.

    The result maps the joint at which a loop is cut to the other joints of the loop, from the parent of the cut joint to its child, each
    with the reason why it was not cut. There are no reasons if a rigid mate closes the loop.
    """
    cuts = {closure.path for closure in robot.closures if not closure.hold}
    if not cuts:
        return {}
    import networkx

    from thingc.targets.networkx_export import link_graph

    graph = link_graph(robot.assembly)
    tree = graph.edge_subgraph([edge for edge in graph.edges if edge[2] not in cuts]).to_undirected()
    worth = {robot.assembly.mates[number].name: value for number, value in cut_priorities(robot.assembly, robot.mode)}
    loops: dict[str, dict[str, str]] = {}
    for parent, child, cut in graph.edges:
        if cut in cuts:
            path = networkx.shortest_path(tree, parent, child)
            through = [key for pair in zip(path, path[1:]) for key in tree[pair[0]][pair[1]]]
            loops[cut] = {one: worth[one].reason_over(worth[cut]) if cut in worth else "" for one in through}
    return loops


def _why_cut(cut: str, through: dict[str, str], robot: Robot) -> list[str]:
    """Return lines that list the joints through which a closed loop passes, each with the reason for cutting the loop at `cut` instead."""
    if any(one.joint == cut for one in robot.mode.cut):
        return [f"    through {', '.join(through)}: cut at the joint that the mode lists under `cut`"]
    return [f"    through {path}, which {reason}" if reason else f"    through {path}" for path, reason in through.items()]


def _shares(assembly: Assembly) -> str:
    mass: dict[str, float] = {}
    for o in assembly.occurrences:
        mass[o.mass_source] = mass.get(o.mass_source, 0.0) + o.properties.mass
    total = sum_of(mass.values()) or 1.0
    return ", ".join(f"{source} {_grams(m)} ({100.0 * m / total:.1f} %)" for source, m in sorted(mass.items()) if m)


def mates_text(assembly: Assembly) -> list[str]:
    """Format the mates as lines of text. Each line shows the directions of the child's axes at q = 0 in the frame of the parent."""
    rows = [("child", "mount", "on", "mount", "by", "child x, y, z along parent")]
    for mate in assembly.mates:
        parent, child = assembly.occurrences[mate.parent], assembly.occurrences[mate.child]
        rotation = (assembly.rest[mate.parent].inverse() @ assembly.rest[mate.child]).rotation
        rows.append((child.path, mate.child_mount, parent.path, mate.parent_mount, mate.name or "rigid", console.axes(rotation)))
    return console.table(rows)


def _grams(mass: float) -> str:
    """Format a mass, given in kilograms, in grams. The text has two decimals, or two significant digits for a small mass."""
    if 0.0 < mass < 1e-5:
        return f"{1000.0 * mass:.2g} g"
    return f"{1000.0 * mass:.2f} g" if mass < 1.0 else f"{mass:.4f} kg"
