"""Read SDF 1.4 to 1.12 (http://sdformat.org/spec): the links and joints of one model, in SI units.

A pose in SDF can be relative to any frame of the model (`relative_to`). The reader first converts all poses to the frame of the model
(http://sdformat.org/tutorials?tut=pose_frame_semantics). Nested models are merged into their parent models, with link names such as
`arm::hand`. See http://sdformat.org/tutorials?tut=composition about included models.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Report
from thingc.base.inertia import MassProperties
from thingc.base.pose import IDENTITY, NO_POSE, Pose, Vector, along, rotate
from thingc.base.suggestions import did_you_mean
from thingc.tools.importing import source_model
from thingc.tools.importing.packages import NotFound, Packages
from thingc.tools.importing.sdf_frames import WORLD, Frames, NamedFrame, key_of
from thingc.tools.importing.tree import check_mimics, root_of, span_tree
from thingc.tools.importing.xml_source import Losses, SourceElement, read_xml
from thingc.tools.importing.xml_values import ChildValues

MOST_INCLUDES = 100
READ = ("uri", "name", "pose", "placement_frame", "static")
"""Supported child elements of `<include>`."""


class Includes:
    """Replaces each `<include>` element in an SDF file by the included model. `roots` are the root elements of all files that were read."""

    def __init__(self, root: SourceElement, packages: Packages, report: Report, losses: Losses) -> None:
        self.packages, self.report, self.losses, self.values = packages, report, losses, ChildValues(report)
        self.roots, self.folders = [root], {root.where.file: ""}
        self._expand(root)

    def uri(self, uri: str, source: str) -> str:
        """Convert a URI in the SDF file `source` to a URI relative to the main SDF file."""
        folder = self.folders[source]
        return uri if not folder or "://" in uri else f"{folder}/{uri}"

    def _expand(self, element: SourceElement) -> None:
        for number, child in enumerate(element.children):
            if child.tag == "include":
                try:
                    element.children[number] = self._model(child) or child
                except NotFound as fault:
                    uri = self.values.place(child, "uri")
                    if element.tag == "world":  # the included model may be the sun or the ground
                        self.report.warn(Code.SOURCE_DOUBT, f"a model is not imported: {fault}", uri, help="remove models of scenery")
                    else:
                        self.report.add(Code.SOURCE_FILE, str(fault), uri, help=fault.help)
            elif child.tag in ("world", "model"):
                self._expand(child)

    def _model(self, include: SourceElement) -> SourceElement | None:
        """Return the included model as a `<model>` element. If the included file is invalid, report an error and return None.

        Raises `NotFound` if the file is missing.
        """
        error_count = len(self.report.diagnostics)
        overrides = {tag: one for tag in READ if (one := self.values.one(include, tag)) is not None}
        if "placement_frame" in overrides and "pose" not in overrides:
            self.values.fault(include, None, "an `<include>` with `<placement_frame>` requires `<pose>`", "write <pose>0 0 0 0 0 0</pose>")
        if include.attributes.get("merge", "").strip() in ("1", "true"):
            self.values.fault(include, "merge", "`merge` is not supported", "run `gz sdf -p FILE > robot.sdf` to merge the models")
        if len(self.roots) > MOST_INCLUDES:
            message = f"the number of included models exceeds the maximum ({MOST_INCLUDES})"
            self.values.fault(include, None, message, "remove cyclic includes")
        uri = self.values.word(include, "uri")
        if uri is None or len(self.report.diagnostics) > error_count:
            return None
        uri = self._file(self.uri(uri.rstrip("/"), include.where.file))
        path, data = self.packages.read(uri)
        root = read_xml(path, data, self.report, tags=["sdf"])
        models = [] if root is None else [*root.all("model")]
        if root is None or len(models) != 1:
            self.values.fault(include, "uri", f"expected a file with one model, found {len(models)} in `{uri}`")
            return None
        self.roots.append(root)
        self.folders[path] = uri.rpartition("/")[0] or "."
        self._expand(model := models[0])
        for child in (one for one in include.children if one.tag not in READ):
            self.losses.note(f"`<{child.tag}>` of `<include>`", "not imported", child.where)
        model_children = [child for child in model.children if child.tag not in overrides]
        names = {str(tag): overrides[tag].text for tag in ("name", "placement_frame") if tag in overrides}
        overriding = [overrides[tag] for tag in ("pose", "static") if tag in overrides]
        return replace(include, tag="model", attributes={**model.attributes, **names}, children=[*overriding, *model_children], texts=[])

    def _file(self, uri: str) -> str:
        """Return the path of the file that a URI refers to.

        If the URI refers to a folder, the result is the file for the newest SDF version in `model.config`.
        """
        if uri.endswith((".sdf", ".world", ".urdf")):
            return uri
        try:
            config = read_xml(*self.packages.read(f"{uri}/model.config"), self.report)
        except NotFound:
            config = None
        files = [] if config is None else [*config.all("sdf")]
        newest = max(files, key=lambda element: [*map(int, re.findall(r"\d+", element.attributes.get("version", "")))], default=None)
        return f"{uri}/{'model.sdf' if newest is None else newest.text}"


KINDS: dict[str, tuple[source_model.Kind, ...]] = {
    "revolute": ("revolute",), "continuous": ("continuous",), "prismatic": ("prismatic",), "ball": ("ball",), "fixed": (),
    "screw": ("screw",), "universal": ("revolute", "revolute"), "revolute2": ("revolute", "revolute"),
}
"""Supported types of SDF joints. Each type is converted to a sequence of joints whose axes pass through one point."""
OTHER_KINDS = ("gearbox",)
AXES = ("axis", "axis2")
_VERSION = re.compile(r"1\.(\d+)")
_USUAL = MassProperties(mass=1.0, inertia=IDENTITY)
"""SDF's default mass properties of a link."""
ENDLESS = 1e16
"""If the absolute value of a limit is at least this number, the joint is unlimited."""
ATTRIBUTES: dict[str, set[str]] = {
    "model": {"name", "canonical_link", "placement_frame"}, "link": {"name"}, "joint": {"name", "type"}, "frame": {"name", "attached_to"},
    "visual": {"name"}, "collision": {"name"}, "pose": {"relative_to", "frame", "degrees", "rotation_format"}, "xyz": {"expressed_in"},
    "mimic": {"joint", "axis"},
}
"""Supported XML attributes by element tag."""
INSIDE: dict[str, set[str]] = {
    "model": {"pose", "link", "joint", "frame", "model", "static"}, "link": {"pose", "inertial", "visual", "collision"},
    "joint": {"pose", "parent", "child", "axis", "axis2", "screw_thread_pitch", "thread_pitch"},
    "frame": {"pose"}, "inertial": {"pose", "mass", "inertia"},
    "inertia": {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}, "visual": {"pose", "geometry", "material"},
    "collision": {"pose", "geometry", "surface"}, "geometry": {"box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh"},
    "box": {"size"}, "sphere": {"radius"}, "cylinder": {"radius", "length"}, "capsule": {"radius", "length"}, "ellipsoid": {"radii"},
    "mesh": {"uri", "scale"}, "material": {"diffuse", "ambient", "specular"},
    **dict.fromkeys(("axis", "axis2"), {"xyz", "limit", "dynamics", "mimic", "use_parent_model_frame"}),
    "limit": {"lower", "upper", "effort", "velocity"},
    "dynamics": {"damping", "friction", "spring_stiffness", "spring_reference"}, "mimic": {"multiplier", "offset", "reference"},
    "surface": {"friction"}, "friction": {"ode"}, "ode": {"mu"},
}
"""Supported child elements by element tag."""
AS_USUAL = {
    "gravity": ("1", "true"), "self_collide": ("0", "false"), "kinematic": ("0", "false"), "enable_wind": ("0", "false"),
    "allow_auto_disable": ("0", "1", "true", "false"), "cast_shadows": ("0", "1", "true", "false"), "transparency": ("0", "0.0"),
    "must_be_loop_joint": ("0", "false"),
}
"""Default values of unsupported elements. An element with a default value is not recorded as a loss."""


def read_sdf(path: str, data: bytes, packages: Packages, report: Report) -> source_model.SourceRobot | None:
    """Read the robot in an SDF file. `data` is the content of the file at the absolute path `path`.

    If the file has errors, report the errors and return None.
    """
    root = read_xml(path, data, report, tags=["sdf"])
    return None if root is None else _Sdf(root, packages, report).robot()


class _Sdf:
    def __init__(self, root: SourceElement, packages: Packages, report: Report) -> None:
        self.root, self.report, self.values = root, report, ChildValues(report)
        self.losses = Losses()
        self.includes = Includes(root, packages, report, self.losses)
        self.old_axes = {one.where.file for one in self.includes.roots if self._is_old(one)}
        self.intermediate_links: list[source_model.SourceLink] = []

    def robot(self) -> source_model.SourceRobot | None:
        """Convert the SDF model to the source model. If the SDF model has errors, report the errors and return None."""
        model = None if self.report.failed else self._model()
        if model is None:
            return None
        name, self.frames = self.values.word(model, "name"), Frames(model, self.values)
        if name is None or self.report.failed:  # these errors would cause further errors
            return None
        links, joints = [self._link(key, frame.element) for key, frame in self.frames.all("link")], self.frames.all("joint")
        attachments = [attachment for key, frame in joints for attachment in self._attachments_of(key, frame)]
        moving = {
            coordinate for key, frame in joints if frame.element.attributes.get("type") not in ("fixed", "ball")
            for coordinate in self._coordinates(key)
        }
        check_mimics(attachments, moving, self.report)
        self.losses.unread(model, ATTRIBUTES, INSIDE, AS_USUAL)
        return None if self.report.failed else self._build_robot(model, name, [*links, *self.intermediate_links], attachments)

    def _is_old(self, root: SourceElement) -> bool:
        """Return whether joint axes are relative to the frame of the model, as in old SDF versions. Report an unsupported version."""
        version = root.attributes.get("version", "").strip()
        match = _VERSION.fullmatch(version)
        if match is None or not 4 <= int(match[1]) <= 12:
            help = "run `gz sdf -p FILE` to convert an old file"
            self.values.fault(root, "version", f"`version` of `<sdf>`: expected 1.4 to 1.12, found `{version}`", help)
        return match is not None and int(match[1]) <= 4

    def _model(self) -> SourceElement | None:
        """Return the only non-static model of the file or of its world.

        Unless exactly one such model exists, report an error and return None.
        """
        worlds = [*self.root.all("world")]
        models = [model for parent in (self.root, *worlds) for model in parent.all("model")]
        robots = models if len(models) == 1 else [model for model in models if not self._is_true(model, "static")]
        for child in (child for world in worlds for child in world.children if child not in robots):
            self.losses.note(f"`<{child.tag}>` of `<world>`", "a document contains one robot", child.where)
        if len(robots) == 1:
            return robots[0]
        names = ", ".join(f"`{one.attributes.get('name', '')}`" for one in robots[:6]) or "none"
        self.report.add(
            Code.SOURCE_TREE, f"expected one model that is not static, found {names}", (robots[1] if robots else self.root).where,
            help="split the file into one file for each robot" if robots else "add a `<model>` with a link",
        )
        return None

    def _is_true(self, element: SourceElement, tag: str) -> bool:
        child = next(element.all(tag), None)
        return child is not None and child.text.lower() in ("1", "true")

    def _link(self, key: str, element: SourceElement) -> source_model.SourceLink:
        inertial = self.values.one(element, "inertial")
        if inertial is None:
            reason = "the SDF default is used: 1 kg with an inertia of 1 kg m^2"
            self.losses.note(f"the missing `<inertial>` of link `{key}`", reason, element.where)
        shapes = [self._shape(child, key) for child in element.children if child.tag in ("visual", "collision")]
        weight, where = _USUAL if inertial is None else self._weight(inertial), (inertial or element).where
        return source_model.SourceLink(
            name=key, where=element.place("name"), shapes=tuple(shape for shape in shapes if shape is not None),
            weight=None if weight is None or weight.mass == 0.0 else source_model.Weight(properties=weight, where=where),
        )

    def _weight(self, inertial: SourceElement) -> MassProperties | None:
        if inertial.attributes.get("auto", "").strip().lower() in ("1", "true"):
            help = "write the `<mass>` and `<inertia>` that `gz sdf -p FILE` computes"
            self.values.fault(inertial, "auto", "automatic inertias are not supported", help)
            return None
        pose, moments = self.frames.read_pose(inertial), self.values.one(inertial, "inertia")
        mass = self.values.from_zero(inertial, "mass", 1.0)
        if moments is None or mass is None:
            return None if mass is None else replace(_USUAL, mass=mass, centre=pose.translation)
        return self.values.inertia(moments, mass, pose, usual=1.0)

    def _shape(self, element: SourceElement, link: str) -> source_model.SourceShape | None:
        pose, geometry = self.frames.read_pose(element), self.values.one(element, "geometry")
        form = None if geometry is None else next(iter(geometry.children), None)
        if form is None:
            help = "write <geometry><box><size>...</size></box></geometry>"
            self.values.fault(geometry or element, None, f"`<{element.tag}>` has no geometry", help)
            return None
        relative = next((one for one in element.all("pose") if one.attributes.get("relative_to", "").strip()), None)
        if relative is not None:
            self.losses.note(f"`relative_to` of a `<{element.tag}>`", "not imported: shapes must be relative to their link", relative.where)
            return None
        if form.tag not in INSIDE["geometry"]:
            self.losses.note(f"a `<{form.tag}>`", "shapes of this kind are not supported", form.where)
            return None
        shape = self.values.shape(element, form, "uri", pose, self.losses)
        return None if shape is None else replace(
            shape, mesh=None if shape.mesh is None else self.includes.uri(shape.mesh, form.where.file), color=self._color(element),
            friction=self._friction(element), name=self.values.own_name(element, link, "_(visual|collision)"),
        )

    def _color(self, visual: SourceElement) -> tuple[float, float, float, float] | None:
        material = self.values.one(visual, "material")
        key = next((key for key in ("diffuse", "ambient") if material is not None and self.values.text_of(material, key)), None)
        if material is None or key is None:
            return None
        count = len((self.values.text_of(material, key) or "").split())
        rgba = self.values.numbers(material, key, 3 if count == 3 else 4)
        return None if rgba is None else (rgba[0], rgba[1], rgba[2], rgba[3] if count == 4 else 1.0)

    def _friction(self, collision: SourceElement) -> tuple[float, ...]:
        inner: SourceElement | None = collision
        for tag in ("surface", "friction", "ode"):
            inner = None if inner is None else self.values.one(inner, tag)
        mu = None if inner is None or self.values.text_of(inner, "mu") is None else self.values.from_zero(inner, "mu")
        return () if mu is None else (mu,)

    def _coordinates(self, key: str) -> list[str]:
        """Return the names of the joints that replace an SDF joint with several axes."""
        kinds = KINDS.get(self.frames.named[key].element.attributes.get("type", ""), ()) if key in self.frames.named else ()
        return [f"{key}_{number}" for number in range(len(kinds))] if len(kinds) > 1 else [key]

    def _attachments_of(self, key: str, frame: NamedFrame) -> Iterator[source_model.Attachment]:
        """Yield the attachments that represent an SDF joint, from parent to child.

        A joint with several axes becomes several attachments with massless links in between. The method also reports errors in the joint.
        """
        element, kind = frame.element, self.values.word(frame.element, "type")
        ends = {side: end for side in ("parent", "child") if (end := self._end(frame, side)) is not None}
        if kind is not None and kind not in KINDS:
            known = f"joints of type `{kind}` are not supported" if kind in OTHER_KINDS else f"unknown joint type `{kind}`"
            self.values.fault(element, "type", known, did_you_mean(kind, KINDS, what="kinds") or f"write one of {', '.join(KINDS)}")
            return
        if kind is None or len(ends) < 2:
            return
        parent, child = ends["parent"], ends["child"]
        if parent == child:
            self.values.fault(element, None, f"the parent and the child of a joint are both on link `{child}`", "connect different links")
            return
        parent_pose = NO_POSE if parent == WORLD else self.frames.poses[parent]
        pose, names = _clean(parent_pose.inverse() @ self.frames.poses[child]), self._coordinates(key)
        joints = [self._joint(name, key, motion, tag) for name, motion, tag in zip(names, KINDS[kind], AXES, strict=False)] or [None]
        for number in reversed(range(len(names))):  # start at the child, because `spanned` reverses either all or no attachments of a joint
            above = f"{key} link" if number else parent
            if number:
                self.intermediate_links.append(source_model.SourceLink(name=above, where=element.where))
            joint = joints[number]
            if joint is not None and joint.ends.lower is not None and joint.ends.lower == joint.ends.upper:
                if joint.ends.lower != 0.0:
                    message = f"`lower` and `upper` of joint `{names[number]}` are both {joint.ends.lower:g}"
                    self.values.fault(element, None, message, "use the type `fixed`, or correct the limits of the joint")
                what = f"the type of joint `{names[number]}` with limits of 0"
                self.losses.note(what, "imported as a fixed joint", element.where)
                joint = None
            yield source_model.Attachment(
                name=names[number], parent=above, child=child, pose=NO_POSE if number else pose, where=element.where,
                joints=() if joint is None else (joint,),
            )
            child = above

    def _end(self, frame: NamedFrame, side: str) -> str | None:
        """Return the link, or the world, to which one side of a joint is attached.

        If no such link exists, report an error and return None.
        """
        name = self.values.word(frame.element, side)
        if name is None or name == WORLD:
            return WORLD if name == WORLD and side == "parent" else None
        key = key_of(name, frame.scope)
        if key not in self.frames.named:
            links = [key_of_frame for key_of_frame, other in self.frames.named.items() if other.element.tag in ("link", "frame")]
            message = f"the {side} `{name}` of a joint is not a link or frame of the model"
            self.values.fault(frame.element, side, message, did_you_mean(name, links, what="links"))
            return None
        link = self.frames.link_of(key)
        if link is None:
            self.values.fault(frame.element, side, f"the {side} `{name}` of a joint is not on a link")
        return link

    def _joint(self, name: str, key: str, kind: source_model.Kind, tag: str) -> source_model.SourceJoint | None:
        """Read one axis of an SDF joint. `tag` is the tag of the child element that defines the axis."""
        frame = self.frames.named[key]
        element, to_child = frame.element, self.frames.poses[self._end(frame, "child") or ""].inverse()
        at = to_child @ self.frames.poses[key]
        if kind == "ball":
            return source_model.SourceJoint(name=key, kind=kind, axis=(0.0, 0.0, 1.0), anchor=_clean(at).translation, where=element.where)
        axis = self.values.one(element, tag)
        if axis is None:
            message = f"a `{element.attributes['type']}` joint requires `<{tag}>`"
            self.values.fault(element, None, message, f"write <{tag}><xyz>...</xyz></{tag}>")
            return None
        direction = self._direction(axis, key, frame, to_child)
        ends, follows = self._ends(axis), self._mimic(axis, frame.scope)
        if kind == "revolute" and ends.lower is None:
            kind = "continuous"
        if kind == "prismatic" and ends.lower is None:
            ends = replace(ends, lower=-source_model.FAR, upper=source_model.FAR, made_up=True)
            self.losses.note(f"unlimited slide `{name}`", f"the document specifies limits of +-{source_model.FAR:g} m", element.where)
        dynamics = self.values.one(axis, "dynamics")
        damping = friction = stiffness = rest_position = 0.0
        if dynamics is not None:
            damping, friction, stiffness = (
                self.values.from_zero(dynamics, key, 0.0) or 0.0 for key in ("damping", "friction", "spring_stiffness")
            )
            rest_position = (self.values.number(dynamics, "spring_reference", 0.0) or 0.0) if stiffness else 0.0
        motor = source_model.SourceDrive(name=name, kind="motor", where=element.where, effort=ends.effort)
        return source_model.SourceJoint(
            name=name, kind=kind, lead=self._lead(element) if kind == "screw" else 0.0, axis=direction, anchor=_clean(at).translation,
            where=element.where, ends=ends, damping=damping, friction=friction, stiffness=stiffness, rest=rest_position, follows=follows,
            drive=None if not ends.effort or follows else motor,
        )

    def _lead(self, screw: SourceElement) -> float:
        """Return the lead of a screw joint, which is the travel per turn [m]. The lead of a right-handed thread is positive.

        The element `thread_pitch` [rad/m] has the opposite sign.
        """
        older = self.values.text_of(screw, "screw_thread_pitch") is None and self.values.text_of(screw, "thread_pitch") is not None
        tag = "thread_pitch" if older else "screw_thread_pitch"
        pitch = self.values.number(screw, tag)
        if pitch == 0.0:
            self.values.fault(screw, tag, f"`{tag}` of a screw must not be 0", "use the type `revolute`, or write the travel per turn")
        return -2.0 * math.pi / pitch if older and pitch else pitch or 0.0

    def _direction(self, axis: SourceElement, key: str, frame: NamedFrame, to_child: Pose) -> Vector:
        """Return the axis of a joint as a unit vector in the frame of the child link."""
        xyz, direction = self.values.one(axis, "xyz"), self.values.direction(axis, "xyz", (0.0, 0.0, 1.0))
        expressed_in = "" if xyz is None else xyz.attributes.get("expressed_in", "").strip()
        within = key
        if expressed_in and xyz is not None:
            within = self.frames.find_frame(xyz, "expressed_in", expressed_in, frame.scope)
        elif self._is_true(axis, tag := "use_parent_model_frame") or axis.where.file in self.old_axes and not any(axis.all(tag)):
            within = frame.scope
        return _round(rotate((to_child @ self.frames.poses[within]).rotation, direction))

    def _ends(self, axis: SourceElement) -> source_model.SourceLimits:
        limit = self.values.one(axis, "limit")
        if limit is None:
            return source_model.SourceLimits()
        lower, upper, effort, velocity = (
            None if self.values.text_of(limit, key) is None else self._read_limit(limit, key)
            for key in ("lower", "upper", "effort", "velocity")
        )
        if (lower is None) != (upper is None):
            self.losses.note("a single limit of a joint", "the other limit is missing", limit.where)
            lower = upper = None
        if lower is not None and upper is not None and lower > upper:
            self.values.fault(
                limit, "lower", f"`lower` ({lower:g}) is above `upper` ({upper:g})", "swap the two limits, or correct one of them",
            )
        return source_model.SourceLimits(
            lower=lower, upper=upper, effort=None if effort is None or effort < 0.0 else effort,
            velocity=None if velocity is None or velocity < 0.0 else velocity,
        )

    def _read_limit(self, limit: SourceElement, key: str) -> float | None:
        """Read the lower or upper limit of a joint. Return None if this limit is infinite."""
        if (self.values.text_of(limit, key) or "").strip().lower().lstrip("+-") in ("inf", "infinity"):
            return None
        value = self.values.number(limit, key)
        return None if value is None or abs(value) >= ENDLESS else value

    def _mimic(self, axis: SourceElement, scope: str) -> source_model.SourceMimic | None:
        """Read the `<mimic>` element of a joint, with the relation q = `multiplier (q(leader) - reference) + offset`."""
        mimic = self.values.one(axis, "mimic")
        if mimic is None:
            return None
        joint = self.values.word(mimic, "joint")
        multiplier, offset, reference = (
            self.values.number(mimic, key, usual) for key, usual in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        if joint is None or multiplier is None or offset is None or reference is None:
            return None
        offset -= multiplier * reference
        leader = self._coordinates(key_of(joint, scope))[-1 if mimic.attributes.get("axis") == "axis2" else 0]
        return source_model.SourceMimic(joint=leader, coefficients=(offset, multiplier), where=mimic.place("joint"))

    def _build_robot(
        self, model: SourceElement, name: str, links: list[source_model.SourceLink], attachments: list[source_model.Attachment],
    ) -> source_model.SourceRobot | None:
        """Determine the root link of the robot and the kind of its base.

        The base is fixed if a joint attaches a link to the world, or if the model is static. Otherwise, the base is free. If a joint
        between the world and the robot can move, this method adds a massless root link.
        """
        sites: dict[str | None, tuple[source_model.SourceSite, ...]] = {}
        for key, frame in self.frames.all("frame"):
            link = self.frames.link_of(key)
            pose = _clean(self.frames.poses[link or ""].inverse() @ self.frames.poses[key])
            sites[link] = (*sites.get(link, ()), source_model.SourceSite(name=key, pose=pose, where=frame.element.place("name")))
        links = [replace(link, sites=sites.get(link.name, ())) for link in links]
        placed = self.values.one(model, "pose")
        if placed is not None and placed.attributes.get("relative_to", "").strip() not in ("", WORLD):
            self.losses.note("`relative_to` of the model's pose", "the pose is read relative to the world", placed.where)
        model_pose, grounded = self.frames.pose_of("", model), [attachment for attachment in attachments if attachment.parent == WORLD]
        if len(grounded) == 1 and not grounded[0].joints:
            attachments = [attachment for attachment in attachments if attachment is not grounded[0]]
        elif grounded:
            links = [source_model.SourceLink(name=WORLD, where=model.place("name")), *links]
            attachments = [replace(one, pose=_clean(model_pose @ one.pose)) if one in grounded else one for one in attachments]
        screws = [attachment for attachment in attachments if any(joint.kind == "screw" for joint in attachment.joints)]
        tree, closing = span_tree([*screws, *(one for one in attachments if one not in screws)])  # other joints close loops
        root = root_of(links, tree, model.where, self.report)
        if root is None:
            return None
        loops = tuple(map(self._loop, closing))  # also records losses
        return source_model.SourceRobot(
            name=name, where=model.place("name"), root=root, links=tuple(links), attachments=tree, loops=loops, losses=self.losses.all(),
            base="fixed" if grounded or self._is_true(model, "static") else "free",
            pose=NO_POSE if root == WORLD else _clean(model_pose @ self.frames.poses[root]),
        )

    def _loop(self, attachment: source_model.Attachment) -> source_model.SourceLoop:
        """Convert a joint that is not in the kinematic tree to a constraint that closes a loop."""
        joint = next(iter(attachment.joints), None)
        at = NO_POSE if joint is None else along(joint.axis, joint.anchor)
        unlimited = source_model.SourceLimits()
        if joint is not None and (joint.ends != unlimited or joint.damping or joint.friction or joint.stiffness or joint.follows):
            reason = "a joint that closes a loop cannot have limits, a drive or dynamics"
            self.losses.note(f"limits, drive and dynamics of joint `{attachment.name}`", reason, attachment.where)
        kind = "fixed" if joint is None else "continuous" if joint.kind == "revolute" else joint.kind
        if kind == "screw":
            help = "change the type of one joint of the loop"
            message = f"all joints in the loop of joint `{attachment.name}` are screws"
            self.report.add(Code.SOURCE_TREE, message, attachment.where, help=help)
        assert kind != "planar"
        assert kind != "free"
        ends = ((attachment.parent, _clean(attachment.pose @ at)), (attachment.child, at))
        return source_model.SourceLoop(name=attachment.name, kind=kind, ends=ends, where=attachment.where)


def _round(vector: Vector) -> Vector:
    """Round a vector to 15 decimals, to remove the rounding errors of composed poses."""
    x, y, z = (round(coordinate, 15) + 0.0 for coordinate in vector)
    return (x, y, z)


def _clean(pose: Pose) -> Pose:
    return Pose(translation=_round(pose.translation), rotation=pose.rotation)
