"""Read MJCF files: convert the bodies, masses and shapes of the compiled MuJoCo model to the source model."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate

from thingc.base.diagnostics import Code, Report
from thingc.base.generated_header import mode_of
from thingc.base.grouping import group_by
from thingc.base.pose import NO_POSE, Pose
from thingc.targets.urdf.links import SMALL_MASS
from thingc.tools.importing.document_names import plain_name
from thingc.tools.importing.import_request import ImportRequest
from thingc.tools.importing.mjcf.adding import Added
from thingc.tools.importing.mjcf.compiled_source import WORLD, CompiledSource, floats, numbers, pose_of
from thingc.tools.importing.mjcf.drives import Actuators
from thingc.tools.importing.mjcf.equalities import BALL, FREE, Equalities, free_joint, joint_of
from thingc.tools.importing.mjcf.flattened_source import ABSENT, FlattenedSource
from thingc.tools.importing.mjcf.sensing import Sensing
from thingc.tools.importing.mjcf.settings import options, poses, simulation, touching
from thingc.tools.importing.mjcf.shapes import Geoms
from thingc.tools.importing.mjcf.tendons import Tendons
from thingc.tools.importing.packages import Packages
from thingc.tools.importing.source_model import SOURCE_MODE, Attachment, SourceBase, SourceLink, SourceRobot, SourceSite, Weight
from thingc.tools.importing.tree import MOST_LINKS, downwards
from thingc.tools.importing.xml_source import SourceElement

PLANE = 0
_ALIKE = 1e-9


def read_mjcf(root: SourceElement, packages: Packages, report: Report, request: ImportRequest) -> SourceRobot | None:
    """Read the robot in an MJCF file, given its root element `<mujoco>`. If MuJoCo cannot read the file, report the error and return None.

    If the request excludes meshes, meshes that cannot be read have no mass.
    """
    flat = FlattenedSource(root, packages, report, request.meshes)
    text = flat.text()
    original = None if text is None else _compile(flat, text, report)
    return None if original is None else _Reader(original, report, request).robot()


def _compile(flat: FlattenedSource, text: str, report: Report) -> CompiledSource | None:
    """Compile the flattened MJCF source with MuJoCo, and report MuJoCo's errors at their source locations."""
    import mujoco

    try:
        spec = mujoco.MjSpec.from_string(text, include=flat.models, assets=flat.files)
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        spec.compiler.alignfree = False
        absent = [geom for geom in spec.geoms if geom.meshname and ABSENT in spec.mesh(geom.meshname).file]
        for geom in absent:
            geom.mass = 0.0
        for joint in spec.joints:
            joint.align = mujoco.mjtAlignFree.mjALIGNFREE_FALSE
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # MuJoCo warns about nearly singular inertias, which are checked per link
            model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as fault:
        message = str(fault)
        for mesh_file, uri in flat.meshes.items():
            message = message.replace(mesh_file, uri)
        message_of_mujoco = re.sub(r"^(XML )?Error: |Error: |Schema violation: ", "", message.split("\nElement")[0]).strip()
        attribute = re.search(r"attribute:? '(\w+)'", message_of_mujoco)
        where = flat.place(message, None if attribute is None else attribute[1])
        report.add(Code.SOURCE_VALUE, f"MuJoCo cannot load the model: {message_of_mujoco}", where, help="fix the reported element")
        return None
    original = CompiledSource(flat, spec, model)
    for geom in (one for one in absent if not one.parent.explicitinertial):
        original.losses.note(f"the mass of mesh `{geom.meshname}`", "the file of the mesh cannot be read", flat.place(geom.info))
    return original


class _Reader:
    def __init__(self, original: CompiledSource, report: Report, request: ImportRequest) -> None:
        self.original, self.model, self.report, self.request = original, original.model, report, request
        self.parents = [int(one) for one in self.model.body_parentid]
        self.joints = original.joints_of
        self.free = {body for body, joints in enumerate(self.joints) for joint in joints if self.model.jnt_type[joint] == FREE}
        self.mocap = {body for body in range(len(self.parents)) if self.model.body_mocapid[body] >= 0}
        self._released: dict[int, Pose] = {}
        self.shapes = Geoms(original)
        self.link_names = {*original.bodies.values()}

    def robot(self) -> SourceRobot | None:
        """Return the imported robot.

        If the model contains several unconnected groups of bodies, the root is in the group with the most joints. Free joints connect the
        other floating groups to the root.
        """
        if len(self.parents) > MOST_LINKS:
            message = f"the number of bodies ({len(self.parents):,}) exceeds the maximum ({MOST_LINKS:,})"
            self.report.add(Code.SOURCE_TREE, message, self.original.flat.root.where)
            return None
        bodies, root = self._robot_bodies()
        if bodies == {WORLD}:
            self.report.add(Code.SOURCE_TREE, "the robot has no body", self.original.flat.root.where, help="add `<body>` to `<worldbody>`")
            return None
        for body in self.free & bodies - {root}:
            self.parents[body], self._released[body] = root, (NO_POSE if root == WORLD else self._pose(root)).inverse() @ self._pose(body)
        carriers = self._carriers(bodies, root)
        for body in (body for body in sorted(bodies) if self.model.body_mass[body] <= 0.0 and any(floats(self.model.body_inertia[body]))):
            self.original.lose("body", body, f"the inertia of body `{self.original.bodies[body]}`", "the body has no mass")
        links = [body for body in sorted(bodies) if carriers[body][0] == body or body in self._mounts]
        joints = {joint for body in bodies for joint in self.joints[body]}
        sites = {site for site in range(self.model.nsite) if int(self.model.site_bodyid[site]) in bodies}
        named = self.original.flat.find_root(self.original.element("body", min(body for body in bodies if body != WORLD)))
        name, groups = _name(named), self._rigid_groups(carriers, root)
        heads = {body: link for body, (link, _) in carriers.items()} if self.request.keeps(plain_name(name, "robot")) else groups
        tendons = Tendons(self.original, joints, sites, carriers, heads)
        members = group_by(heads, heads.__getitem__)
        rigid_links = [self._link(body, carriers, members.get(body, ())) for body in links]
        added = Added(self.original, {"joint": joints, "site": sites, "geom": self.shapes.shown}, tendons, heads)
        drives = Actuators(self.original, joints, tendons, carriers, added)
        couplings = Equalities(self.original, drives, carriers, added)
        between: list[SourceLink] = []
        attachments = [one for body in links if body != root for one in self._attachments(body, carriers, between, drives, couplings)]
        base: SourceBase = "free" if root in self.free else "held" if root in self.mocap else "fixed"
        floating = {body for body in heads if heads[body] == root} if base == "free" else set[int]()
        sensed = Sensing(self.original, carriers, added, drives.driven, root, floating).all()
        excluded = touching(self.original, carriers, groups, heads, None if base == "free" else root, added)
        gravity = floats(self.model.opt.gravity)
        joints_by_name = {joint.name: joint for one in attachments for joint in one.joints}
        states = poses(self.original, carriers, root, base, joints_by_name, self._released)
        simulated, set_up = simulation(self.original), options(self.original)
        free = self.joints[root][0] if base == "free" else -1
        set_up += tuple((("joint", "root", name), value) for name, value in (free_joint(self.original, free) if base == "free" else ()))
        self._lose_layout(root, attachments, bool(states), {name for one in sensed for name, _ in one.parts}, added)
        return SourceRobot(
            name=name, where=named.place("model"), root=self.original.bodies[root], links=(*rigid_links, *between),
            attachments=tuple(attachments), base=base, pose=NO_POSE if root == WORLD else self._pose(root),
            losses=self.original.losses.all(), loops=tuple(couplings.loops), adhesions=drives.adhesions,
            tendons=tendons.with_drives(drives.of_tendon), sensors=sensed, poses=states, excluded=excluded, added=tuple(added.elements),
            free_joint=self.original.written["joint"][free].name if base == "free" else "",
            order={"actuator": [*self.original.actuators.values()], "sensor": [*self.original.sensors.values()]},
            gravity=None if gravity == (0.0, 0.0, -9.81) else (gravity[0], gravity[1], gravity[2]),
            simulation=simulated, options=set_up, files=self.shapes.files,
        )

    def _lose_layout(self, root: int, attachments: Sequence[Attachment], posed: bool, sensed: set[str], added: Added) -> None:
        """Record a loss if elements have other indices in `MjData` of a model that is generated from the document.

        If the source has no keyframes, also record a loss for each joint whose start value changes.
        """
        joints = {joint.name: joint for one in attachments for joint in one.joints}
        for joint in joints.values() if not posed else ():
            begin, reason = joint.begin, "the value is outside the limits"
            if joint.follows is not None:
                begin = joint.follows.at(joints[joint.follows.joint].begin or 0.0)
                reason = f"the joint mimics `{joint.follows.joint}`"
            if begin is not None and abs(begin - joint.start) > _ALIKE:
                description = f"the start position of joint `{joint.name}`, {joint.start:g}"
                self.original.losses.note(description, f"{reason} ({begin:g} is used)", joint.where)
        sensed |= {one.name for one in added.elements if one.section == "sensor"}
        self._lose_indices("data.ctrl", [1] * self.model.nu, sorted(added.kept["actuator"]))
        self._lose_indices("data.sensordata", self.model.sensor_dim, [k for k, name in self.original.sensors.items() if name in sensed])
        order = self._joint_order(root, attachments)
        for array, sizes in (("data.qpos", {FREE: 7, BALL: 4}), ("data.qvel", {FREE: 6, BALL: 3})):
            self._lose_indices(array, [sizes.get(int(one), 1) for one in self.model.jnt_type], order)

    def _joint_order(self, root: int, attachments: Sequence[Attachment]) -> list[int]:
        """Return the indices of the source joints in the order of the joints in a model that is generated from the document."""
        numbers_of = {name: number for number, name in self.original.joints.items()}
        island: dict[str, int] = {}
        tree = [*downwards(self.original.bodies[root], attachments)]
        for number, attachment in enumerate(tree, 1):
            island[attachment.child] = number if attachment.floating else island.get(attachment.parent, 0)
        tree.sort(key=lambda attachment: island[attachment.child])
        return [*self.joints[root][: root in self.free], *(numbers_of[joint.name] for attachment in tree for joint in attachment.joints)]

    def _lose_indices(self, array: str, sizes: Sequence[int], order: Sequence[int]) -> None:
        """Record a loss if entries of an array of `MjData` have other indices in a model that is generated from the document.

        `order` contains the indices of the elements that the generated model contains, in the order of that model.
        """
        starts, runs, new_start = [0, *accumulate(map(int, sizes))], list[list[int]](), 0
        for old_start, size in ((starts[number], int(sizes[number])) for number in order):
            if runs and runs[-1][0] + runs[-1][2] == old_start:
                runs[-1][2] += size
            else:
                runs.append([old_start, new_start, size])
            new_start += size
        moved = [f"[{old}:{old + size}] is [{new}:{new + size}]" for old, new, size in runs if old != new]
        if moved:
            reason = f"the array of the exported model has another order: {', '.join(moved)}"
            self.original.losses.note(f"the indices of `{array}`", reason, self.original.flat.root.where)

    def _attachments(
        self, body: int, on: dict[int, tuple[int, Pose]], between: list[SourceLink], drives: Actuators, couplings: Equalities,
    ) -> Iterator[Attachment]:
        """Yield the attachments that connect a body to its parent, one for each joint of the body.

        The method appends the intermediate links between these joints to `between`. They are massless if documents support this.
        """
        original, (parent, pose) = self.original, on[self.parents[body]]
        name, above, place, where = original.bodies[body], original.bodies[parent], pose @ self._pose(body), original.where("body", body)
        *inner, last = self.joints[body] or [-1]
        light = None
        if inner and (BALL in self.model.jnt_type[self.joints[body]] or body in couplings.looping):
            light = Weight(properties=SMALL_MASS, where=where)
            what = f"the missing mass between the joints of body `{name}`"
            self.original.lose("body", body, what, f"ball joints and loops need a link with mass, so {SMALL_MASS.mass:g} kg are added")
        for joint in inner:
            link_name = f"{name} {original.joints[joint]}"
            while link_name in self.link_names:
                link_name += "_"
            self.link_names.add(link_name)
            between.append(SourceLink(name=link_name, where=original.where("joint", joint), weight=light))
            yield Attachment(
                name=link_name, parent=above, child=link_name, pose=place, where=original.where("joint", joint),
                joints=(joint_of(original, joint, drives, couplings),),
            )
            above, place = link_name, NO_POSE
        joints = () if last < 0 else (joint_of(original, last, drives, couplings),)
        yield Attachment(name=name, parent=above, child=name, pose=place, where=where, joints=joints, floating=body in self._released)

    def _pose(self, body: int) -> Pose:
        """Return the pose of a body in the frame of its parent, or of the root for a released body."""
        return self._released.get(body) or pose_of(self.model.body_pos[body], self.model.body_quat[body])

    def _robot_bodies(self) -> tuple[set[int], int]:
        """Return the indices of the bodies that belong to the imported robot, and the index of its root.

        All bodies attached to the world form one group, and each floating body forms another group. The root is the first body of the group
        with the most joints. Bodies in groups that neither contain the root nor float are recorded as losses. If the world is not part of
        the robot, its geoms and sites are also recorded as losses.
        """
        tops = [body for body, parent in enumerate(self.parents) if parent == WORLD and body != WORLD]
        groups: dict[int, set[int]] = {WORLD: {WORLD}} | {body: set() for body in tops if body in self.free or body in self.mocap}
        group = {WORLD: WORLD}
        for body in range(1, len(self.parents)):
            group[body] = body if body in groups else group[self.parents[body]]
            groups[group[body]].add(body)
        joints = {one: sum(len(self.joints[body]) for body in bodies - self.free) for one, bodies in groups.items()}
        chosen = max(groups, key=lambda one: (joints[one], len(groups[one] - {WORLD}), -one))
        for body in tops:
            if group[body] != chosen and body not in self.free:
                description = f"body `{self.original.bodies[body]}`, with everything attached to it"
                self.original.lose("body", body, description, "the body is not part of the robot")
        model, geoms = self.model, self.original.geoms_of[WORLD]
        planes = [geom for geom in geoms if model.geom_type[geom] == PLANE]
        on_world = [("geom", geom) for geom in geoms if geom not in planes]
        on_world += [("site", site) for site in range(model.nsite) if model.site_bodyid[site] == WORLD]
        if chosen == WORLD:
            first = [body for body in tops if group[body] == WORLD]
            alone = len(first) == 1 and not self.joints[first[0]] and not on_world
            bodies_of_robot = groups[WORLD] - {WORLD} if alone else groups[WORLD]
        else:
            bodies_of_robot = groups[chosen]
        for geom in planes:
            self.original.lose("geom", geom, "a geom of the world", "floors are part of a scene, not of a robot")
        for kind, number in () if WORLD in bodies_of_robot else on_world:
            self.original.lose(kind, number, f"a {kind} of the world", "fixed to the world, so not part of the robot")
        return bodies_of_robot.union(*(groups[body] for body in groups.keys() & self.free)), min(bodies_of_robot)

    def _carriers(self, kept_bodies: set[int], root: int) -> dict[int, tuple[int, Pose]]:
        """Map each body to the link that represents the body, and to the pose of the body in the frame of this link.

        A body becomes a mount of its parent if the body and all its descendants are fixed and have neither mass nor shapes.
        """
        bare = {
            body for body in kept_bodies - {root}
            if not self.joints[body] and self.model.body_mass[body] <= 0.0 and not self.model.body_geomnum[body]
        }
        for body in sorted(kept_bodies, reverse=True):
            if body not in bare and body != root:
                bare.discard(self.parents[body])
        self._mounts = bare
        on: dict[int, tuple[int, Pose]] = {}
        for body in sorted(kept_bodies):
            link, pose = on[self.parents[body]] if body in bare else (body, NO_POSE)
            on[body] = link, pose @ self._pose(body) if body in bare else NO_POSE
        self._carried = group_by(on, lambda body: on[body][0])
        return on

    def _rigid_groups(self, bodies: Iterable[int], root: int) -> dict[int, int]:
        """Map each body to the first body of its group of rigidly connected bodies.

        Bodies that are fixed to the world or to a mocap body are fixed to the root.
        """
        grounded, welds = {WORLD, *self.mocap}, self.model.body_weldid.tolist()
        return {body: root if welds[body] in grounded else welds[body] for body in bodies}

    def _link(self, body: int, on: dict[int, tuple[int, Pose]], members: Sequence[int]) -> SourceLink:
        """Convert a body, and the mounts on it, to a link. If the body is the first of bodies that become one link, `members` contains all
        of these bodies, and is empty otherwise.
        """
        original, where = self.original, self.original.flat.root.where if body == WORLD else self.original.where("body", body)
        if body in self._mounts:
            return SourceLink(name=original.bodies[body], where=where)
        sites = tuple(
            SourceSite(
                name=original.sites[site], pose=on[of][1] @ pose_of(self.model.site_pos[site], self.model.site_quat[site]),
                where=original.where("site", site), others=tuple(original.second_names.get(original.sites[site], ())),
            )
            for of in self._carried[body] for site in original.sites_of[of]
        )
        frames = tuple(original.sites[site] for site in original.frames_of[body])
        gravcomp = self._gravcomp(members)
        return SourceLink(
            name=original.bodies[body], where=where, weight=self._weight(body), shapes=self.shapes.of(body), sites=sites,
            frames=frames, raw=(("gravcomp", numbers(gravcomp)),) if gravcomp else (),
        )

    def _gravcomp(self, bodies: Sequence[int]) -> float:
        """Return the mean gravity compensation of bodies that become one link. Record a loss if their values differ."""
        heavy = [body for body in bodies if self.model.body_mass[body] > 0.0 and self.model.body_weldid[body] != WORLD]
        values = self.model.body_gravcomp[heavy]
        if len(set(values)) < 2:
            return float(values[0]) if heavy else 0.0
        what = f"the different `gravcomp` of bodies fixed to `{self.original.bodies[heavy[0]]}`"
        self.original.lose("body", heavy[0], what, "bodies that are fixed to each other are one link, which gets the mean")
        return float(values @ self.model.body_mass[heavy] / self.model.body_mass[heavy].sum())

    def _weight(self, body: int) -> Weight | None:
        if body == WORLD or self.model.body_mass[body] <= 0.0:
            return None
        element = self.original.element("body", body)
        return Weight(properties=self.original.mass_properties(body), where=next(element.all("inertial"), element).where)


def _name(root: SourceElement) -> str:
    """Return the name of the MuJoCo model without the name of a mode that thingc has appended."""
    name = root.attributes.get("model", "").strip()
    ours = mode_of(root.source[: root.start]) == SOURCE_MODE
    return (name.removesuffix(f"_{SOURCE_MODE}") if ours else name) or "robot"
