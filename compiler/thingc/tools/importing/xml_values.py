"""Parse numbers, vectors, names and shapes from XML attributes. Invalid values are reported with their source location."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal

from thingc.base.diagnostics import Code, Report
from thingc.base.inertia import MassProperties
from thingc.base.numeric import hypot
from thingc.base.pose import IDENTITY, NO_POSE, Matrix, Pose, Vector, make_pose, rotation_of
from thingc.base.source import Span
from thingc.base.suggestions import Hint
from thingc.tools.importing.document_names import plain_name
from thingc.tools.importing.source_model import ShapeKind, SourceShape
from thingc.tools.importing.xml_source import Losses, SourceElement

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
NOT_FINITE = {"nan", "inf", "infinity"}


class Values:
    """Parses numbers, vectors and names from XML attributes. An invalid value is reported as an error, and then treated as missing."""

    def __init__(self, report: Report) -> None:
        self.report = report

    def text_of(self, element: SourceElement, key: str) -> str | None:
        """Return the text of an attribute, or None if the attribute is missing."""
        return element.attributes.get(key)

    def place(self, element: SourceElement, key: str) -> Span:
        """Return the source location of the value of an attribute."""
        return element.place(key)

    def example(self, key: str, text: str) -> str:
        """Return an example of a correct attribute with the value `text`, for error messages."""
        return f'{key}="{text}"'

    def fault(self, element: SourceElement, attribute: str | None, message: str, help: Hint | None = None) -> None:
        """Report an error at the source location of an element or of one of its attributes."""
        where = element.where if attribute is None else self.place(element, attribute)
        self.report.add(Code.SOURCE_VALUE, message, where, help=help)

    def word(self, element: SourceElement, attribute: str) -> str | None:
        """Read a required attribute that contains a name. If the attribute is missing, report an error and return None."""
        text = (self.text_of(element, attribute) or "").strip()
        if not text:
            self.fault(element, None, f"`<{element.tag}>` has no `{attribute}`", f"write {self.example(attribute, '...')}")
        return text or None

    def own_name(self, element: SourceElement, link: str, suffix: str) -> str | None:
        """Return the `name` of a shape of a link, or None for a default name that thingc has written.

        The default name consists of the name of the link, a match of the regular expression `suffix`, and numbers.
        """
        name, links = element.attributes.get("name", "").strip(), "|".join(map(re.escape, (link, plain_name(link, "link"))))
        return None if re.fullmatch(rf"(({links}){suffix})?(_\d+)*", name) else name

    def number(self, element: SourceElement, attribute: str, default: float | None = None) -> float | None:
        """Read an attribute that contains a finite number.

        If the attribute is missing, return `default`, or report an error if no default is given.
        """
        values = self.numbers(element, attribute, 1, None if default is None else (default,))
        return None if values is None else values[0]

    def vector(self, element: SourceElement, attribute: str, default: Vector = (0.0, 0.0, 0.0)) -> Vector:
        """Read an attribute that contains three numbers. Return `default` if the attribute is missing or invalid."""
        x, y, z = self.numbers(element, attribute, 3, default) or default
        return (x, y, z)

    def number_of(self, element: SourceElement, text: str, what: str) -> float | None:
        """Convert a string to a finite number. If the string is invalid, report an error at the element and return None.

        `what` is the name of the number in the error message.
        """
        number = float(text) if _NUMBER.fullmatch(text) else math.nan
        if not math.isfinite(number):
            self.fault(element, None, f"{what}: expected a number, found {f'`{text}`' if text else 'nothing'}")
            return None
        return number

    def numbers(
        self, element: SourceElement, attribute: str, count: int, default: tuple[float, ...] | None = None,
    ) -> tuple[float, ...] | None:
        """Read an attribute that contains `count` finite numbers.

        If the attribute is invalid, or missing without a default, report an error and return None.
        """
        text = self.text_of(element, attribute)
        if text is None:
            if default is None:
                help = f"write {self.example(attribute, ' '.join(['0'] * count))}"
                self.fault(element, None, f"`<{element.tag}>` has no `{attribute}`", help)
            return default
        words = text.split()
        finite = "finite " if any(word.lower().lstrip("+-") in NOT_FINITE for word in words) else ""
        expected = f"a {finite}number" if count == 1 else f"{count} {finite}numbers separated by spaces"
        wrong = next((word for word in words if not _NUMBER.fullmatch(word)), None)
        if wrong is not None or len(words) != count:
            found = "nothing" if not words else f"`{wrong}`" if wrong is not None else f"{len(words)}" if count > 1 else f"`{text}`"
            self.fault(element, attribute, f"`{attribute}` of `<{element.tag}>`: expected {expected}, found {found}")
            return None
        values = tuple(float(word) for word in words)
        if not all(map(math.isfinite, values)):
            self.fault(element, attribute, f"`{attribute}` of `<{element.tag}>`: `{text}` is out of range")
            return None
        return values

    def from_zero(self, element: SourceElement, attribute: str, default: float | None = None) -> float | None:
        """Read an attribute that contains a number of at least 0.

        If the attribute is missing, return `default`, or report an error if no default is given.
        """
        value = self.number(element, attribute, default)
        if value is not None and value < 0.0:
            self.fault(element, attribute, f"`{attribute}` of `<{element.tag}>`: expected a number of at least 0, found {value:g}")
            return None
        return value

    def direction(self, axis: SourceElement, attribute: str, default: Vector) -> Vector:
        """Read an attribute that contains an axis, and return a unit vector. Report an error for the zero vector.

        Return `default` if the attribute is missing or invalid.
        """
        x, y, z = self.vector(axis, attribute, default)
        length = hypot(x, y, z)
        if length == 0.0:
            self.fault(axis, attribute, "the axis of a joint must not be 0 0 0", "write, for example, 0 0 1")
            return default
        return (x, y, z) if abs(length - 1.0) < 1e-15 else (x / length, y / length, z / length)

    def origin(self, element: SourceElement) -> tuple[Pose, Vector | None]:
        """Read the pose in the child element `<origin>` of a URDF element.

        Returns:
            The pose, and the angles `rpy` [rad]. If the element has the attribute `quat_xyzw` of URDF 1.1, None replaces the angles.
        """
        origin = self.one(element, "origin")
        if origin is None:
            return NO_POSE, (0.0, 0.0, 0.0)
        xyz, rpy = self.vector(origin, "xyz"), self.vector(origin, "rpy")
        quaternion = self.numbers(origin, "quat_xyzw", 4, (0.0, 0.0, 0.0, 1.0))
        if "quat_xyzw" not in origin.attributes or quaternion is None:
            return make_pose(xyz, rpy), rpy
        if "rpy" in origin.attributes:
            self.fault(origin, "quat_xyzw", "`<origin>` has both `rpy` and `quat_xyzw`", "remove `rpy` or `quat_xyzw`")
        return Pose(translation=xyz, rotation=self.rotation(origin, "quat_xyzw", quaternion)), None

    def rotation(self, element: SourceElement, attribute: str, quaternion: Sequence[float]) -> Matrix:
        """Convert a quaternion (x, y, z, w), which does not have to be normalized, to a rotation.

        Report an error for the zero quaternion.
        """
        length = hypot(*quaternion)
        if length == 0.0:
            self.fault(element, attribute, "the quaternion of a pose must not be 0 0 0 0", "write 0 0 0 1")
            return IDENTITY
        i, j, k, w = (one / length for one in quaternion)
        return rotation_of((w, i, j, k))

    def one(self, element: SourceElement, tag: str) -> SourceElement | None:
        """Return the child element with this tag, or None if no such element exists.

        Report an error if several child elements have this tag.
        """
        found = [*element.all(tag)]
        if len(found) > 1:
            self.fault(found[1], None, f"`<{element.tag}>` has more than one `<{tag}>`", "remove one of the two elements")
        return found[0] if found else None

    def shape(self, element: SourceElement, form: SourceElement, file: str, pose: Pose, losses: Losses) -> SourceShape | None:
        """Read a `<visual>` or `<collision>` element.

        `form` is the geometry element, and `file` is the name of the attribute that contains the URI of a mesh. Return None if the shape is
        invalid or has no volume. A shape without volume is recorded as a loss.
        """
        sized, mesh = self._read_size(form), self.word(form, file) if form.tag == "mesh" else None
        if sized is None or form.tag == "mesh" and mesh is None:
            return None
        kind, size = sized
        if 0.0 in size:
            losses.note(f"a `<{form.tag}>`", "the shape has no volume", form.where)
            return None
        use: Literal["visual", "collision"] = "visual" if element.tag == "visual" else "collision"
        return SourceShape(kind=kind, use=use, size=size, pose=pose, where=form.where, mesh=mesh)

    def _read_size(self, form: SourceElement) -> tuple[ShapeKind, tuple[float, ...]] | None:
        """Read the kind and the size [m] of a geometry element. Return None if the element is invalid or not supported."""
        match form.tag:
            case "box" | "ellipsoid":
                key = "size" if form.tag == "box" else "radii"
                sides = self.numbers(form, key, 3)
                if sides is not None and min(sides) < 0.0:
                    self.fault(form, key, f"`{key}` of `<{form.tag}>`: expected numbers of at least 0, found {min(sides):g}")
                half = 0.5 if form.tag == "box" else 1.0
                return None if sides is None else (form.tag, tuple(half * side for side in sides))
            case "sphere":
                radius = self.from_zero(form, "radius")
                return None if radius is None else ("sphere", (radius,))
            case "cylinder" | "capsule":
                radius, length = (self.from_zero(form, key) for key in ("radius", "length"))
                return None if radius is None or length is None else (form.tag, (radius, length / 2.0))
            case "mesh":
                scale = self.numbers(form, "scale", 3, (1.0, 1.0, 1.0))
                return None if scale is None else ("mesh", scale)
            case _:
                return None

    def inertia(self, element: SourceElement, mass: float, pose: Pose, *, usual: float = 0.0) -> MassProperties:
        """Read an inertia matrix [kg m^2], and return the mass properties of the link in the frame of the link.

        The attributes `ixx` to `izz` contain the inertia about the centre of mass, in the axes of `pose`. `usual` is the default value of
        `ixx`, `iyy` and `izz`.
        """
        xx, xy, xz, yy, yz, zz = (
            self.number(element, key, usual if key[1] == key[2] else 0.0) or 0.0 for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        return MassProperties(mass=mass, inertia=((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))).seen_from(pose)


class ChildValues(Values):
    """Parses values from the text of child elements, as in SDF. Names are parsed from attributes."""

    def text_of(self, element: SourceElement, key: str) -> str | None:
        """Return the text of the child element with this name. If no such element exists, return the text of the attribute."""
        child = next(element.all(key), None)
        return element.attributes.get(key) if child is None else child.text

    def place(self, element: SourceElement, key: str) -> Span:
        """Return the source location of the child element with this name.

        If no such element exists, return the source location of the attribute.
        """
        child = next(element.all(key), None)
        return element.place(key) if child is None else child.where

    def example(self, key: str, text: str) -> str:
        """Return an example of correct XML with the value `text`, for error messages.

        Names and types are attributes, and other values are elements.
        """
        return super().example(key, text) if key in ("name", "type") else f"<{key}>{text}</{key}>"
