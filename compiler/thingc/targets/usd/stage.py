"""Write a robot in one mode as a UsdPhysics stage.

    /arm  ->  scene, materials
          ->  base_link, bracket, ...       links side by side, with the same frames as in MJCF and `modes.json`, at q = 0
                -> tip                      mounts, `frame` components and roots of modes
                -> visuals, collisions
          ->  joints
    /arm_meshes                             prototypes (a class: not part of the scene by itself)

There is one articulation, whose root is the base link. Unless the base floats, the joint `root` connects the base link to the world.
According to the UsdPhysics schema, this joint is then the root of the articulation. Newton accepts a joint or a link as the root, whereas
mujoco-usd only accepts a link. Joints of the tree connect the parent in the tree to the child, as Newton requires. Joints that close loops
are excluded from the articulation.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from typing import TypeVar

from thingc.base import numeric
from thingc.base.diagnostics import Report
from thingc.base.inertia import MassProperties, physical_fault, principal_axes
from thingc.base.numeric import hypot, maximum
from thingc.base.pose import IDENTITY, Matrix, Pose, Vector, cross
from thingc.geometry.store.local import Store
from thingc.model.assembly.types import Link
from thingc.model.resolve.types import Material
from thingc.model.robot.kinematics import placed_bodies
from thingc.model.robot.types import Robot
from thingc.targets.capabilities import shape_cell, written_as
from thingc.targets.connections import Connection, connections
from thingc.targets.geometry import INFINITE_HALF, Geometry, MeshAsset, Shape, channels, linear, material_name, materials, name_with_index
from thingc.targets.name_mangling import LINK, MangledNames, frames, safe
from thingc.targets.usd.capabilities import CAPABILITIES
from thingc.targets.usd.chain import UsdJoint, chain, followers
from thingc.targets.usd.drives import articulation, dynamics, equip, follow
from thingc.targets.usd.usda import Prim, format_array, format_vector, quote

Key = TypeVar("Key")

MESH = "mesh"
"""Name of the mesh prim in a prototype. All instances share the prims below the prototype."""

SCENE, MATERIALS, JOINTS = "scene", "materials", "joints"
"""Names of the prims that are siblings of the links. A link cannot have one of these names."""

UNCOLOURED = "#bfbfbf"
"""Colour of shapes for which the document does not specify a colour, as in GLB files."""

DEFAULT_SLIDE = 1.0
"""Sliding friction of a shape whose material does not specify it. The value is the default of MuJoCo, so that all formats agree. Without a
value, UsdPhysics would use a friction of 0, and each simulator a different default for shapes without a material.
"""

LEAST_MASS, LEAST_INERTIA = 1e-9, 1e-12
"""Mass [kg] and moments of inertia [kg m^2] that are written for a link without mass. In UsdPhysics, the value 0 means "not specified"."""

ROUGHNESS = 0.6
"""Roughness of the material of all surfaces. The value is constant because documents specify colours but no gloss."""

MOMENT_MARGIN = 2.0**-22
"""Relative margin between the largest principal moment and the sum of the other two moments.

For a flat body, the largest moment equals this sum. Without the margin, rounding to floats could make it larger than the sum.
"""


def model(robot: Robot, geometry: Geometry, meshes: dict[str, str], report: Report) -> Prim:
    """Create the default prim of the USD stage of a mode. `meshes` contains the paths of the prototypes, by the names of the mesh assets.

    If two names are equal, an error is reported.
    """
    return _Builder(robot, geometry, meshes, report).build()


def articulation_roots(robot: Robot) -> list[int]:
    """Return the indices of the bodies that are roots of articulations: the bodies that other bodies are attached to, directly or by other
    bodies, but not by free joints. If there are no such bodies, the root of the mode is an articulation.
    """
    carriers = {robot.carriers[index] for index, body in enumerate(robot.bodies) if body.parent is not None and not body.free}
    return sorted(carriers or {0})


class _Builder:
    def __init__(self, robot: Robot, geometry: Geometry, meshes: dict[str, str], report: Report) -> None:
        self.robot = robot
        self.assembly = robot.assembly
        self.geometry = geometry
        self.meshes = meshes
        self.report = report
        self.names = MangledNames("name", "USD", report)
        self.joints = MangledNames("joint name", "USD", report)
        self.path = f"/{self.assembly.name}"
        self.root = Prim(type="Xform", name=self.assembly.name)
        self.followers = followers(robot)
        frictions = [_friction(shape.material) for shapes in geometry.shapes for shape in shapes.collision]
        self.frictions = {friction: f"{friction[0]}_friction" for friction in frictions}
        self.colors = {name: color for name, (color, _) in materials(geometry.shapes).items()}
        if any(shape.color is None for shapes in geometry.shapes for shape in shapes.visual):
            self.colors["color"] = UNCOLOURED
        self.materials = identifiers({**{name: name for name in self.colors}, **self.frictions})

    def build(self) -> Prim:
        """Build the default prim of the stage. The prim contains the scene, the materials, the links with their contents, and the
        joints.
        """
        robot = self.robot
        scopes = ((SCENE, "the physics scene"), (MATERIALS, "the scope of the materials"), (JOINTS, "the scope of the joints"))
        for scope_name, description in scopes:
            self.names.take(scope_name, (), description)
        links = [robot.assembly.links[body.link] for body in robot.bodies]
        names = [self.names.take(link.name, link.origin) for link in links]
        self._scene()
        self._materials()
        poses = placed_bodies(robot.bodies, {joint.path: 0.0 for body in robot.bodies for joint in body.joints}, robot.bodies[0].X_PL)
        sites, connected = frames(robot), [*connections(robot, CAPABILITIES["loops"])]
        articulations = articulation_roots(robot)
        for index, (name, pose) in enumerate(zip(names, poses, strict=True)):
            prim = self._body(name, links[index].properties, pose)
            if index in articulations:
                prim.schemas.append("PhysicsArticulationRootAPI")
                articulation(prim)
            filtered = [names[max(pair)] for pair in robot.excluded if min(pair) == index]
            if filtered:
                prim.schemas.append("PhysicsFilteredPairsAPI")
                prim.set("rel physics:filteredPairs", f"[{', '.join(f'<{self.path}/{other}>' for other in filtered)}]")
            site_names = MangledNames("name", f"USD below `{name}`", self.report)
            for site in sites.get(index, ()):
                if site_names.free(site.path, site.origin):
                    prim.add("Xform", safe(site.path)).place(site.pose)
            self._shapes(prim, links[index])
        joints = Prim(type="Scope", name=JOINTS)
        for connection in connected:
            self._connect(joints, names, poses, connection)
        self.root.children.append(joints)
        return self.root

    def _scene(self) -> None:
        """Add the physics scene, which defines gravity [m/s^2]."""
        scene = self.root.add("PhysicsScene", SCENE)
        size = hypot(*self.robot.gravity)
        direction = format_vector(g / size for g in self.robot.gravity) if size else "(0, 0, -1)"
        scene.fill({"vector3f physics:gravityDirection": direction, "float physics:gravityMagnitude": size})

    def _materials(self) -> None:
        """Add a visual material for each colour, and a physics material for each combination of friction values."""
        scope = self.root.add("Scope", MATERIALS)
        for name, color in self.colors.items():
            red, green, blue, alpha = channels(color)
            material = scope.add("Material", self.materials[name])
            path = f"{self.path}/{MATERIALS}/{material.name}/surface.outputs:surface"
            material.properties.append(f"token outputs:surface.connect = <{path}>")
            shader = material.add("Shader", "surface")
            shader.fill({
                "uniform token info:id": '"UsdPreviewSurface"',
                "color3f inputs:diffuseColor": format_vector((linear(red), linear(green), linear(blue))),
                "float inputs:opacity": alpha, "float inputs:roughness": ROUGHNESS,
            })
            shader.properties.append("token outputs:surface")
        for friction in self.frictions:
            _, slide, torsion, roll = friction
            material = scope.add("Material", self.materials[friction], "PhysicsMaterialAPI")
            if (torsion, roll) != (None, None):
                material.schemas.append("NewtonMaterialAPI")
            material.fill({
                "float physics:dynamicFriction": slide, "float physics:staticFriction": slide, "float physics:restitution": 0.0,
                "float newton:torsionalFriction": torsion, "float newton:rollingFriction": roll,
            })

    def _body(self, name: str, properties: MassProperties, pose: Pose) -> Prim:
        """Add a rigid body to the stage at its pose in the world.

        The body has a mass [kg], a centre of mass [m], and principal moments of inertia [kg m^2].
        """
        prim = self.root.add("Xform", name, "PhysicsRigidBodyAPI", "PhysicsMassAPI")
        moments, axes = moments_of(properties)
        prim.fill({
            "float physics:mass": properties.mass or LEAST_MASS, "point3f physics:centerOfMass": format_vector(properties.centre),
            "float3 physics:diagonalInertia": format_vector(moments),
            "quatf physics:principalAxes": format_vector(Pose(rotation=axes).quaternion()),
        })
        prim.place(pose, always=True)
        return prim

    def _connect(self, holder: Prim, names: list[str], poses: tuple[Pose, ...], connection: Connection) -> None:
        """Add the USD joints between two links. Also add the intermediate links, which have the pose of the child link."""
        parent, X_0 = self.path if connection.parent is None else f"{self.path}/{names[connection.parent]}", connection.X_0
        *intermediate, last = chain(connection)
        for step in intermediate:
            link_name = self.names.take(f"{step.path}{LINK}", connection.origin, f"the child link of joint `{step.path}`")
            start = Pose() if connection.parent is None else poses[connection.parent]
            self._body(link_name, MassProperties(mass=0.0, centre=step.frame.translation), start @ connection.X_0)
            self._joint(holder, step, connection, (parent, X_0), (f"{self.path}/{link_name}", Pose()))
            parent, X_0 = f"{self.path}/{link_name}", Pose()
        self._joint(holder, last, connection, (parent, X_0), (f"{self.path}/{names[connection.child]}", connection.X_1))

    def _joint(self, holder: Prim, joint: UsdJoint, connection: Connection, first: tuple[str, Pose], second: tuple[str, Pose]) -> None:
        description = f"the joint that holds `{connection.path}`" if connection.parent is None and not connection.in_tree else None
        kind = "PhysicsJoint" if joint.type == "D6" else f"Physics{joint.type}Joint"
        prim = holder.add(kind, self.joints.take(joint.path, connection.origin, description))
        for number, (path, pose) in enumerate((first, second)):
            frame = pose @ joint.frame
            prim.fill({
                f"rel physics:body{number}": f"<{path}>", f"point3f physics:localPos{number}": format_vector(frame.translation),
                f"quatf physics:localRot{number}": format_vector(frame.quaternion()),
            })
        if joint.type in ("Revolute", "Prismatic"):
            prim.set("uniform token physics:axis", '"Z"')
        elif joint.type == "Spherical":
            prim.set("uniform token physics:axis", '"X"')
        if not connection.in_tree:
            prim.set("bool physics:excludeFromArticulation", "1")
        prim.set("string ros:joint:name", quote(prim.name))
        follower = self.followers.get(joint.single.path) if joint.single is not None else None
        equip(prim, joint, self.robot, follower)
        dynamics(prim, joint, in_tree=connection.in_tree)
        if follower is not None:
            follow(prim, joint, follower, f"{self.path}/{JOINTS}/{safe(follower.leader)}")

    def _shapes(self, prim: Prim, link: Link) -> None:
        """Add the visual shapes and the collision shapes of a link. By default, viewers hide collision shapes."""
        used = {child.name for child in prim.children}
        visuals, collisions = (Prim(type="Scope", name=unique_name(scope_name, used)) for scope_name in ("visuals", "collisions"))
        for member, pose in zip(link.members, link.poses, strict=True):
            shapes = self.geometry.shapes[member]
            for index, shape in enumerate(shapes.visual):
                self._visual(visuals, name_with_index(safe(shapes.path), index), shape, pose)
            for index, shape in enumerate(shapes.collision):
                self._collider(collisions, name_with_index(safe(shapes.path), index), shape, pose)
        prim.children += [scope for scope in (visuals, collisions) if scope.children]

    def _visual(self, holder: Prim, name: str, shape: Shape, pose: Pose) -> None:
        """Add a visual shape with its colour to the prim of a link. The shape is either an instance of a mesh, or a primitive."""
        kind = written_as(CAPABILITIES["shapes"][shape_cell(shape.kind)])
        if kind is None:
            return
        prim = holder.add("Xform" if shape.kind == "mesh" else kind, unique_name(name, {child.name for child in holder.children}))
        if shape.kind == "mesh":
            prim.metadata += ["instanceable = true", f"prepend references = <{self.meshes[shape.mesh or '']}>"]
        prim.place(pose @ shape.pose, _set_size(prim, shape))
        material = material_name(shape.material, shape.color) or "color"
        prim.schemas.append("MaterialBindingAPI")
        prim.set("rel material:binding", f"<{self.path}/{MATERIALS}/{self.materials[material]}>")

    def _collider(self, holder: Prim, name: str, shape: Shape, pose: Pose) -> None:
        kind = written_as(CAPABILITIES["shapes"][shape_cell(shape.kind)])
        if kind is None:
            return
        prim = holder.add(kind, unique_name(name, {child.name for child in holder.children}), "PhysicsCollisionAPI")
        if shape.kind == "mesh":
            prim.schemas.append("PhysicsMeshCollisionAPI")
            prim.metadata.append(f"prepend references = <{self.meshes[shape.mesh or '']}/{MESH}>")
            prim.set("uniform token physics:approximation", '"convexHull"')
        prim.set("uniform token purpose", '"guide"')
        prim.place(pose @ shape.pose, _set_size(prim, shape))
        prim.schemas.append("MaterialBindingAPI")
        path = f"{self.path}/{MATERIALS}/{self.materials[_friction(shape.material)]}"
        prim.properties += [f"rel material:binding:physics = <{path}> (", '    bindMaterialAs = "weakerThanDescendants"', ")"]


def moments_of(properties: MassProperties) -> tuple[Vector, Matrix]:
    """Return the principal moments of inertia [kg m^2], and a rotation matrix whose columns are the principal axes.

    The moments are still physically possible after they are rounded to floats. If the inertia is not physically possible, return the
    smallest allowed moments.
    """
    if properties.mass <= 0.0 or physical_fault(properties.inertia) is not None:
        return (LEAST_INERTIA,) * 3, IDENTITY
    (a, b, c), axes = principal_axes(properties.inertia)
    margin = maximum(0.0, maximum(a, b, c) * (2.0 + MOMENT_MARGIN) - (a + b + c))
    return (a + margin, b + margin, c + margin), axes


Friction = tuple[str, float, float | None, float | None]


def _friction(material: Material | None) -> Friction:
    """Return the values that distinguish physics materials from each other: a name, and the sliding, torsional and rolling friction.

    The name of a material is not sufficient, because nested documents may use the same name for different materials.
    """
    if material is None or (material.slide, material.torsion, material.roll) == (None, None, None):
        return "default", DEFAULT_SLIDE, None, None
    return material.name, DEFAULT_SLIDE if material.slide is None else material.slide, material.torsion, material.roll


def _set_size(prim: Prim, shape: Shape) -> tuple[float, ...]:
    """Set the size of a primitive on its USD prim, and return the scale factors that the prim needs in addition (empty if none)."""
    match shape.kind:
        case "mesh":
            return ()
        case "box" | "ellipsoid":
            prim.fill({"double size": 2.0} if shape.kind == "box" else {"double radius": 1.0})
            _extent(prim, (1.0, 1.0, 1.0))
            return shape.size
        case "plane":
            half = [size or INFINITE_HALF for size in shape.size[:2]]
            prim.fill({"double width": 2.0 * half[0], "double length": 2.0 * half[1], "uniform token axis": '"Z"'})
            _extent(prim, (half[0], half[1], 0.0))
        case "sphere" | "cylinder" | "capsule":
            radius, half_length = shape.size[0], shape.size[-1] if len(shape.size) > 1 else 0.0
            prim.set("double radius", radius)
            if shape.kind != "sphere":
                prim.fill({"double height": 2.0 * half_length, "uniform token axis": '"Z"'})
            top = half_length if shape.kind == "cylinder" else half_length + radius
            _extent(prim, (radius, radius, top))
    return ()


def _extent(prim: Prim, half: tuple[float, float, float]) -> None:
    """Set the bounding box of a primitive that is centred at its origin. `half` contains half of each side length of the box."""
    prim.set("float3[] extent", f"[{format_vector(-value for value in half)}, {format_vector(half)}]")


def identifiers(texts: Mapping[Key, str]) -> dict[Key, str]:
    """Convert strings to unique and valid USD names, such as `arm.Hand` to `arm_Hand`. If two names would be equal, a number is
    appended.
    """
    names: dict[Key, str] = {}
    for key, text in texts.items():
        plain = re.sub(r"\W", "_", text, flags=re.ASCII)
        names[key] = unique_name(f"_{plain}" if plain[:1].isdigit() else plain, set(names.values()))
    return names


def unique_name(base: str, used: Collection[str]) -> str:
    """Return a name that is not in `used`: the name `base` itself, or `base` with a number appended."""
    return next(name for index in range(len(used) + 1) if (name := f"{base}_{index}" if index else base) not in used)


def prototypes(geometry: Geometry, store: Store, scope: str, names: dict[str, str]) -> Prim:
    """Create a class prim that contains a prototype for each mesh asset. Instances of the meshes reference these prototypes."""
    prim = Prim(type="Scope", name=scope, specifier="class")
    visual_meshes = {shape.mesh for shapes in geometry.shapes for shape in shapes.visual}
    for asset in geometry.meshes:
        parent = prim.add("Xform", names[asset.name])
        _mesh(parent.add("Mesh", MESH), asset, store.read(asset.mesh.sha256).decode(), is_visual=asset.name in visual_meshes)
    return prim


def _normals(columns: list[list[float]], corners: list[int]) -> Iterator[Vector]:
    """Yield the normal of each triangle. `columns` contains the coordinates of all points, and `corners` the points of each triangle.

    A triangle without an area gets a vertical normal.
    """
    points = list(zip(*columns, strict=True))
    for k in range(0, len(corners), 3):
        a, b, c = (points[corner] for corner in corners[k : k + 3])
        x, y, z = cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2]))
        size = hypot(x, y, z)
        yield (round(x / size, 6), round(y / size, 6), round(z / size, 6)) if size else (0.0, 0.0, 1.0)


def _mesh(prim: Prim, asset: MeshAsset, text: str, *, is_visual: bool) -> None:
    """Set the triangles of a mesh prim from a mesh in the store (OBJ), without changes."""
    rows = [line.split() for line in text.splitlines()]
    points = [row[1:4] for row in rows if row and row[0] == "v"]
    corners = [int(corner.partition("/")[0]) - 1 for row in rows if row and row[0] == "f" for corner in row[1:4]]
    columns = [[float(point[k]) for point in points] for k in range(3)]
    low, high = map(numeric.minimum, columns), map(numeric.maximum, columns)
    prim.fill({
        "float3[] extent": format_array((format_vector(low), format_vector(high))),
        "int[] faceVertexCounts": format_array("3" for _ in range(len(corners) // 3)),
        "int[] faceVertexIndices": format_array(str(corner) for corner in corners),
        "point3f[] points": format_array(f"({', '.join(point)})" for point in points),
    })
    prim.properties.append(f"normal3f[] primvars:normals = {format_array(map(format_vector, _normals(columns, corners)))} (")
    prim.properties += ['    interpolation = "uniform"', ")"]
    prim.set("uniform token subdivisionScheme", '"none"')
    if is_visual and not asset.mesh.closed:
        prim.set("uniform bool doubleSided", "1")
