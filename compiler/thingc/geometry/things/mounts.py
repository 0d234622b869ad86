"""Mount points: frames at which Things are mated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from build123d import Location, Plane, Solid, Vector, VectorLike
from msgspec import convert, to_builtins

from thingc.base.interfaces import MatingFeature
from thingc.geometry.things.resolver import Framed, TransformResolver
from thingc.geometry.things.sweep import Range, sweep

if TYPE_CHECKING:
    from build123d.topology import Compound

    from thingc.geometry.things.thing import Geometry, Thing

MATE = Location(Plane(origin=(0, 0, 0), x_dir=(0, -1, 0), z_dir=(0, 0, -1)))
"""The transformation between two mated mounts. The z axes of the mounts are opposed, and x and y are swapped and negated: [[0, -1, 0], [-1,
0, 0], [0, 0, -1]].

The transformation is its own inverse. In build123d, it is written as `Location((0,0,0),(180,0,90))`.
"""

Interface = str | MatingFeature | Sequence[str | MatingFeature] | None
"""An interface in part code: its name, a mating feature, or a list of both."""

RESERVED = frozenset({"origin", "root", "world"})
"""Names that a mount of a part cannot have, because documents use them for other purposes."""


class MountPoint(Framed):
    """A mount point: an immutable frame on a Thing, whose z axis points out of the material.

    `location` is the frame of the mount in the frame of the Thing [mm]. `location` may also be a `Plane` or another mount. `interface` is
    the name of the mating interface (`"x430-horn"`), a mating feature such as `Bolts("M3", 4, circle=20)` [mm, deg], or a list of both.
    `tolerance` [mm] is the largest deviation of the mount of the real part along each axis of the part.

    `facing` or `mate_x` rotates the frame about its z axis. Both arguments are directions in the frame of the Thing. `facing` is the
    direction of the mount's x axis. `mate_x` is the direction of the x axis of a mount that is mated with this one. Use `mate_x` for seats,
    and `facing` for the mounts of parts that are placed on seats.

    A mount gets its name (`hip_0`, `hip_left`) from the attribute of the Thing that contains the mount, directly or in a list or dict.
    Raises `TypeError` if `location` is not a frame. Raises `ValueError` if the tolerance is negative, or if a direction is parallel to z.
    """

    __slots__ = ("_declared", "_expected", "_features", "_interface", "_local", "_name", "_owner", "_tolerance", "_view")

    def __init__(
        self, location: Location | Plane | MountPoint, interface: Interface = None, tolerance: float | None = None, *,
        facing: VectorLike | None = None, mate_x: VectorLike | None = None,
    ) -> None:
        if isinstance(location, (Plane, MountPoint)):
            location = location.location
        if not isinstance(location, Location):
            raise TypeError(f"a MountPoint requires a Location, a Plane or another MountPoint, found {location!r}")
        if tolerance is not None and not 0 <= tolerance < float("inf"):
            raise ValueError(f"the tolerance of a MountPoint must be at least 0 mm and finite, found {tolerance!r}")
        if facing is not None or mate_x is not None:
            location = _rotate_to(location, facing, mate_x)
        self._local = Location(location.wrapped)
        self._view = Location()
        self._declared = interface
        self._interface, self._features = _split_interface(interface)
        self._tolerance = None if tolerance is None else float(tolerance)
        self._owner: Thing | None = None
        self._name: str | None = None
        self._expected: list[tuple[Thing, str]] = []

    @property
    def location(self) -> Location:
        """The frame of the mount [mm] in the frame of the Thing. For the mount of a moved view, the frame is relative to the local frame of
        the view.
        """
        return self._view * self._local

    @property
    def interface(self) -> str | None:
        """The name of the mating interface, or None."""
        return self._interface

    @property
    def features(self) -> tuple[MatingFeature, ...]:
        """The mating features of the interface [mm, deg]."""
        return self._features

    @property
    def tolerance(self) -> float | None:
        """The largest distance [mm] between the mount of the real part and its nominal position, or None."""
        return self._tolerance

    @property
    def name(self) -> str | None:
        """The name of the mount on its Thing, such as `hip_0`. The name is None before the mount is assigned to an attribute."""
        return self._name

    @property
    def expected(self) -> tuple[tuple[Thing, str], ...]:
        """The mounts that were aligned to this mount while its Thing was constructed.

        Each item is a tuple of the other Thing and the name of its mount.
        """
        return tuple(self._expected)

    def align(self, other: MountPoint) -> Any:
        """Place the Thing of the mount `other` so that the two mounts are mated. Return the Thing as a moved view in the frame of this
        mount's Thing.

        A and B are the frames of this mount and of the other mount on its Thing. With M = `MATE`, the Thing is placed at A M inv(B). For
        type checkers, the result has the type `Any`. To let them check its use, write `cap: PenCap = self.cap_seat.align(PenCap().seat)`.

        During the construction of the Thing that contains this mount, the other Thing is stored as an expectation of this mount. The other
        Thing is also stored as an expectation before this mount is assigned to an attribute. Raises `TypeError` or `ValueError` if `other`
        is not a mount of a finished Thing.
        """
        if not isinstance(other, MountPoint):
            raise TypeError(f"align() expects a mount of another Thing, such as `PenCap().seat`, found {other!r}")
        thing, name = other._owner, other._name
        if thing is None or name is None:
            raise ValueError("align() expects a mount of another Thing, such as `PenCap().seat`, found a mount without a Thing")
        if not thing._construction.finished:
            raise ValueError(f"align() expects a mount of another Thing, found `{name}` of the same Thing")
        under_construction = self._owner is None or not self._owner._construction.finished
        if under_construction and (thing, name) not in self._expected:
            self._expected.append((thing, name))
        return TransformResolver(thing, self.location * MATE * other._local.inverse())

    def sweep(self, shapes: Geometry, *, turn: Range = None, slide: Range = None, tolerance: float = 0.2) -> Solid | Compound:
        """Return the space that shapes fill while a joint at this mount moves them.

        `turn` [deg] or `slide` [mm] is the range of the joint, whose axis is the z axis of the mount. The range has the same sign for the
        parent and for the child of the joint. The space is a prism along the axis, whose base is at most `tolerance` [mm] larger than the
        outline of the moving shape as seen along the axis. Raises `ValueError` for an empty range, for two ranges, or without a solid.
        """
        return sweep(shapes, self.location, turn, slide, tolerance)

    def __repr__(self) -> str:
        whose = f"{type(self._owner).__name__}.{self._name}" if self._owner is not None else "free"
        position = ", ".join(f"{coordinate:g}" for coordinate in self.location.position)
        return f"<MountPoint {whose} at ({position})>"

    def _in_frame(self, view: Location) -> MountPoint:
        """Return a copy of this mount, transformed to the frame of a moved view. The copy still belongs to the same Thing."""
        moved = MountPoint(self._local, self._declared, self._tolerance)
        moved._view = view * self._view
        moved._owner, moved._name = self._owner, self._name
        return moved


def _split_interface(interface: Interface) -> tuple[str | None, tuple[MatingFeature, ...]]:
    """Split an interface into its name and its mating features. Raises `ValueError` if it is invalid."""
    items = list(interface) if isinstance(interface, (list, tuple)) else [] if interface is None else [interface]
    names = [one for one in items if isinstance(one, str)]
    try:
        features = convert([to_builtins(one) for one in items if one not in names[:1]], tuple[MatingFeature, ...])
        for one in features:
            one.in_units(lambda mm: mm / 1e3, float).check_lengths()  # the distances of holes do not depend on the unit of angles
    except (TypeError, ValueError) as error:
        expected = "a string, a feature such as `Bolts(...)`, or a list of both"
        raise ValueError(f"the interface of a MountPoint must be {expected}, found {interface!r}: {error}") from None
    return next(iter(names), None), features


def _rotate_to(location: Location, facing: VectorLike | None, mate_x: VectorLike | None) -> Location:
    """Rotate `location` about its z axis. Afterwards, its x axis has the direction `facing`, or the x axis of a mated mount has the
    direction `mate_x`.
    """
    z, direction = Plane(location).z_dir, Vector(facing if facing is not None else mate_x)
    along = direction - z * direction.dot(z)
    if (facing is not None and mate_x is not None) or along.length < 1e-6:
        expected = "either `facing` or `mate_x`, perpendicular to its z axis"
        raise ValueError(f"a MountPoint requires {expected}, found {facing!r} and {mate_x!r}")
    return Location(Plane(location.position, x_dir=along if facing is not None else z.cross(along), z_dir=z))


def origin_of(thing: Thing) -> MountPoint:
    """Return the mount `origin` of a Thing. The frame of the mount `origin` is the Thing's own frame."""
    mount = MountPoint(Location())
    mount._owner, mount._name = thing, "origin"
    return mount


def adopt(thing: Thing, name: str, value: Any) -> Any:
    """Prepare a value that is assigned to the attribute `name` of a Thing during its construction.

    Mounts in the value then belong to this Thing. If the value contains a mount of another Thing, a copy of this mount at its current place
    is used. If the value contains no mounts that must be changed, the same object is returned. Raises `ValueError` if the name of a mount
    is forbidden.
    """
    return _map_mounts(name, value, lambda own_name, mount: _own(thing, own_name, mount))


def settle(thing: Thing, name: str, value: Any, mounts: dict[str, MountPoint]) -> Any:
    """Call `adopt` at the end of the construction, when every mount gets its final name. Add the mounts to `mounts`.

    If a mount already has a name in `mounts`, a copy without its expectations is added. Raises `ValueError` if the name of a mount is
    forbidden or already in use.
    """

    def with_mount_name(own_name: str, mount: MountPoint) -> MountPoint:
        mount = _own(thing, own_name, mount)
        if own_name in mounts:
            raise ValueError(f"two mounts of `{type(thing).__name__}` are named `{own_name}`")
        if any(mount is known for known in mounts.values()):
            mount = MountPoint(mount, mount._declared, mount.tolerance)
            mount._owner = thing
        mount._name = own_name
        mounts[own_name] = mount
        return mount

    return _map_mounts(name, value, with_mount_name)


def _map_mounts(name: str, value: Any, change: Callable[[str, MountPoint], MountPoint]) -> Any:
    """Return `value` with each mount replaced by `change(name, mount)`. If no mount changes, return the same object as `value`."""
    if isinstance(value, MountPoint):
        return change(name, value)
    if type(value) in (list, tuple):
        items = [_map_mounts(f"{name}_{index}", item, change) for index, item in enumerate(value)]
        return value if all(new is old for new, old in zip(items, value)) else type(value)(items)
    if type(value) is dict:
        entries = {key: _map_mounts(f"{name}_{key}", item, change) for key, item in value.items()}
        return value if all(entries[key] is value[key] for key in value) else entries
    return value


def _own(thing: Thing, name: str, mount: MountPoint) -> MountPoint:
    valid = name.isascii() and name.isidentifier()
    if not valid or name in RESERVED:
        reason = "the name is reserved" if valid else "use letters, digits and _"
        raise ValueError(f"`{name}` of `{type(thing).__name__}` cannot be a mount: {reason}")
    if mount._owner is None:
        mount._owner, mount._name = thing, name
    elif mount._owner is not thing:
        mount = MountPoint(mount, mount._declared, mount.tolerance)
        mount._owner, mount._name = thing, name
    return mount
