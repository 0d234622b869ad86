"""Mount points: frames where Things meet, and the mate of two of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from build123d import Location, Plane, Vector

from thingc.geometry.things.resolver import Framed, TransformResolver

if TYPE_CHECKING:
    from build123d import VectorLike

    from thingc.geometry.things.thing import Thing

MATE = Location(Plane(origin=(0, 0, 0), x_dir=(0, -1, 0), z_dir=(0, 0, -1)))
"""M: z axes opposed, x and y swapped and negated: exactly [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], its own inverse
(build123d's `Location((0,0,0),(180,0,90))`)."""

RESERVED = frozenset({"origin", "root", "world"})
"""Names that no mount of a part may have: documents give them a meaning."""


class MountPoint(Framed):
    """A frame on a Thing, z pointing out of the material; immutable.

    `location` is the frame in the Thing's own frame [mm] (a `Plane` or another mount will do), `interface` names what fits
    there (`"x430-horn"`, `"m2.5-clearance"`), `tolerance` [mm] is how far the real frame may be off.
    `facing` or `mate_x` turn the frame about its z; both are directions in the Thing's frame. `facing` is the direction of the mount's x
    axis. `mate_x` is the direction along which `facing` of the mount that is mated with this one comes to lie. Use `mate_x` for seats, and
    `facing` for the mounts of what sits on them.
    Assigned to an attribute of a Thing (alone, or in a list or dict) it becomes a mount of that name (`hip_0`, `hip_left`).

    Raises `TypeError` where `location` is no frame, `ValueError` for a tolerance that is negative, and for a direction along z.
    """

    __slots__ = ("_expected", "_interface", "_local", "_name", "_owner", "_tolerance", "_view")

    def __init__(
        self, location: Location | Plane | MountPoint, interface: str | None = None, tolerance: float | None = None, *,
        facing: VectorLike | None = None, mate_x: VectorLike | None = None,
    ) -> None:
        if isinstance(location, (Plane, MountPoint)):
            location = location.location
        if not isinstance(location, Location):
            raise TypeError(f"a MountPoint needs a Location, a Plane or another MountPoint, found {location!r}")
        if interface is not None and not isinstance(interface, str):
            raise TypeError(f"the interface of a MountPoint is a text, found {interface!r}")
        if tolerance is not None and not 0 <= tolerance < float("inf"):
            raise ValueError(f"the tolerance of a MountPoint must be at least 0 mm and finite, found {tolerance!r}")
        if facing is not None or mate_x is not None:
            location = _directed(location, facing, mate_x)
        self._local = Location(location.wrapped)
        self._view = Location()
        self._interface = interface
        self._tolerance = None if tolerance is None else float(tolerance)
        self._owner: Thing | None = None
        self._name: str | None = None
        self._expected: list[tuple[Thing, str]] = []

    @property
    def location(self) -> Location:
        """The frame [mm], in the frame of the Thing that it was read from (through a moved view: in the local frame)."""
        return self._view * self._local

    @property
    def interface(self) -> str | None:
        """What fits here, by name."""
        return self._interface

    @property
    def tolerance(self) -> float | None:
        """How far the real frame may be off [mm]."""
        return self._tolerance

    @property
    def name(self) -> str | None:
        """The name on the Thing that it is a mount of (`hip_0`); None before it is assigned."""
        return self._name

    @property
    def expected(self) -> tuple[tuple[Thing, str], ...]:
        """What was aligned to this mount while its own Thing was made: each the other Thing and the name of its mount."""
        return tuple(self._expected)

    def align(self, other: MountPoint) -> Any:
        """The Thing that `other` is a mount of, placed so that the two mounts mate: a moved view in the frame of this mount.

        With A this mount and B the other on its Thing, the Thing stands at A M inv(B), M = `MATE`. (To a type checker the
        result is `Any`: write `cap: PenCap = self.cap_seat.align(PenCap().seat)` to have it followed.)
        Aligned to a mount of the Thing that is being made, before or after it is assigned, the other Thing is remembered
        as what this mount expects. Raises `TypeError` or `ValueError` where `other` is no mount of a finished Thing.
        """
        if not isinstance(other, MountPoint):
            raise TypeError(f"align() takes a mount of the other Thing, such as `PenCap().seat`; found {other!r}")
        thing, name = other._owner, other._name
        if thing is None or name is None:
            raise ValueError("align() takes a mount of another Thing, such as `PenCap().seat`; this one belongs to no Thing")
        if not thing._construction.finished:
            raise ValueError(f"align() takes a mount of another Thing; `{name}` belongs to the Thing that is being made")
        being_made = self._owner is None or not self._owner._construction.finished
        if being_made and (thing, name) not in self._expected:
            self._expected.append((thing, name))
        return TransformResolver(thing, self.location * MATE * other._local.inverse())

    def __repr__(self) -> str:
        whose = f"{type(self._owner).__name__}.{self._name}" if self._owner is not None else "free"
        position = ", ".join(f"{coordinate:g}" for coordinate in self.location.position)
        return f"<MountPoint {whose} at ({position})>"

    def _seen(self, view: Location) -> MountPoint:
        """This mount, still of the same Thing."""
        moved = MountPoint(self._local, self._interface, self._tolerance)
        moved._view = view * self._view
        moved._owner, moved._name = self._owner, self._name
        return moved


def _directed(location: Location, facing: VectorLike | None, mate_x: VectorLike | None) -> Location:
    """`location` turned about its z, so that its x axis, or that of a mount that is mated with it, lies along a direction."""
    z, wanted = Plane(location).z_dir, Vector(facing if facing is not None else mate_x)
    along = wanted - z * wanted.dot(z)
    if (facing is not None and mate_x is not None) or along.length < 1e-6:
        raise ValueError(f"a MountPoint takes one of `facing` and `mate_x`, a direction across its z axis; found {facing!r} and {mate_x!r}")
    return Location(Plane(location.position, x_dir=along if facing is not None else z.cross(along), z_dir=z))


def origin_of(thing: Thing) -> MountPoint:
    """The mount `origin` that every Thing has: its own frame."""
    mount = MountPoint(Location())
    mount._owner, mount._name = thing, "origin"
    return mount


def adopt(thing: Thing, name: str, value: Any) -> Any:
    """`value` as the attribute `name` of `thing`, which is being made: the mounts in it are the thing's from now on.

    A mount that is another Thing's is copied where it stands; otherwise the same object is returned.
    Raises `ValueError` for a name that no mount may have.
    """
    return _mapped(name, value, lambda own_name, mount: _owned(thing, own_name, mount))


def settle(thing: Thing, name: str, value: Any, mounts: dict[str, MountPoint]) -> Any:
    """`adopt` for the last time: every mount gets its final name and is entered into `mounts` by it.

    A mount that already has a name in `mounts` is copied (the copy expects nothing). Raises `ValueError` for a name
    that is taken or that no mount may have.
    """

    def named(own_name: str, mount: MountPoint) -> MountPoint:
        mount = _owned(thing, own_name, mount)
        if own_name in mounts:
            raise ValueError(f"two mounts of `{type(thing).__name__}` are called `{own_name}`")
        if any(mount is known for known in mounts.values()):
            mount = MountPoint(mount, mount.interface, mount.tolerance)
            mount._owner = thing
        mount._name = own_name
        mounts[own_name] = mount
        return mount

    return _mapped(name, value, named)


def _mapped(name: str, value: Any, change: Callable[[str, MountPoint], MountPoint]) -> Any:
    """`value` with every mount in it replaced by `change(its name, it)`; the same object where nothing changes."""
    if isinstance(value, MountPoint):
        return change(name, value)
    if type(value) in (list, tuple):
        items = [_mapped(f"{name}_{index}", item, change) for index, item in enumerate(value)]
        return value if all(new is old for new, old in zip(items, value)) else type(value)(items)
    if type(value) is dict:
        entries = {key: _mapped(f"{name}_{key}", item, change) for key, item in value.items()}
        return value if all(entries[key] is value[key] for key in value) else entries
    return value


def _owned(thing: Thing, name: str, mount: MountPoint) -> MountPoint:
    plain = name.isascii() and name.isidentifier()
    if not plain or name in RESERVED:
        why = "the name is reserved" if plain else "a name is letters, digits and _"
        raise ValueError(f"`{name}` of `{type(thing).__name__}` cannot be a mount: {why}")
    if mount._owner is None:
        mount._owner, mount._name = thing, name
    elif mount._owner is not thing:
        mount = MountPoint(mount, mount.interface, mount.tolerance)
        mount._owner, mount._name = thing, name
    return mount
