"""Mount points: frames at which Things are mated."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from build123d import Location, Plane, Vector

from thingc.geometry.things.resolver import Framed, TransformResolver

if TYPE_CHECKING:
    from build123d import VectorLike

    from thingc.geometry.things.thing import Thing

MATE = Location(Plane(origin=(0, 0, 0), x_dir=(0, -1, 0), z_dir=(0, 0, -1)))
"""The mate M: z axes opposed, x and y swapped and negated, exactly [[0, -1, 0], [-1, 0, 0], [0, 0, -1]].

The mate is its own inverse. In build123d, it is `Location((0,0,0),(180,0,90))`.
"""

RESERVED = frozenset({"origin", "root", "world"})
"""Names that a mount of a part cannot have, because documents use them."""


class MountPoint(Framed):
    """A mount point: an immutable frame on a Thing, whose z axis points out of the material.

    `location` is the frame in the Thing's own frame [mm]; it may be a `Plane` or another mount. `interface` is the name of the mating
    interface (`"x430-horn"`, `"m2.5-clearance"`). `tolerance` [mm] is the largest error of the real frame.

    `facing` or `mate_x` turn the frame about its z axis. Both are directions in the Thing's frame. `facing` is the direction of the mount's
    x axis. `mate_x` is the direction of the x axis of a mount that is mated with this one. Use `mate_x` for seats, and `facing` for the
    mounts of parts that are placed on seats.

    A mount gets its name (`hip_0`, `hip_left`) from the attribute of the Thing that contains the mount, directly or in a list or dict.
    Raises `TypeError` if `location` is not a frame, `ValueError` for a negative tolerance and for a direction along z.
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
            raise TypeError(f"the interface of a MountPoint must be a string, found {interface!r}")
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
        """The frame of the mount [mm] in the frame of the Thing. For a moved view, the frame is relative to the local frame."""
        return self._view * self._local

    @property
    def interface(self) -> str | None:
        """The name of the mating interface, or None."""
        return self._interface

    @property
    def tolerance(self) -> float | None:
        """The largest error of the real frame [mm], or None."""
        return self._tolerance

    @property
    def name(self) -> str | None:
        """The name of this mount on its Thing (`hip_0`). None before the mount is assigned to an attribute."""
        return self._name

    @property
    def expected(self) -> tuple[tuple[Thing, str], ...]:
        """The mounts that were aligned to this mount while its Thing was constructed.

        Each item is the other Thing and the name of its mount.
        """
        return tuple(self._expected)

    def align(self, other: MountPoint) -> Any:
        """Place the Thing of the mount `other` so that the two mounts mate, and return it as a moved view in the frame of this mount.

        If A is this mount and B the other mount on its Thing, the Thing is at A M inv(B), with M = `MATE`. (For a type checker the result
        is `Any`: write `cap: PenCap = self.cap_seat.align(PenCap().seat)` to check its use.)

        During the construction of the Thing that this mount belongs to, the other Thing is stored as an expectation of this mount, even
        before this mount is assigned to an attribute. Raises `TypeError` or `ValueError` if `other` is not a mount of a finished Thing.
        """
        if not isinstance(other, MountPoint):
            raise TypeError(f"align() expects a mount of another Thing, such as `PenCap().seat`, found {other!r}")
        thing, name = other._owner, other._name
        if thing is None or name is None:
            raise ValueError("align() expects a mount of another Thing, such as `PenCap().seat`; this mount does not belong to a Thing")
        if not thing._construction.finished:
            raise ValueError(f"align() expects a mount of another Thing; `{name}` belongs to the Thing under construction")
        being_made = self._owner is None or not self._owner._construction.finished
        if being_made and (thing, name) not in self._expected:
            self._expected.append((thing, name))
        return TransformResolver(thing, self.location * MATE * other._local.inverse())

    def __repr__(self) -> str:
        whose = f"{type(self._owner).__name__}.{self._name}" if self._owner is not None else "free"
        position = ", ".join(f"{coordinate:g}" for coordinate in self.location.position)
        return f"<MountPoint {whose} at ({position})>"

    def _seen(self, view: Location) -> MountPoint:
        """Return a copy of this mount, transformed to the frame of a moved view. The copy still belongs to the same Thing."""
        moved = MountPoint(self._local, self._interface, self._tolerance)
        moved._view = view * self._view
        moved._owner, moved._name = self._owner, self._name
        return moved


def _directed(location: Location, facing: VectorLike | None, mate_x: VectorLike | None) -> Location:
    """Turn `location` about its z axis so that its x axis (`facing`), or the x axis of a mated mount (`mate_x`), is along a direction."""
    z, wanted = Plane(location).z_dir, Vector(facing if facing is not None else mate_x)
    along = wanted - z * wanted.dot(z)
    if (facing is not None and mate_x is not None) or along.length < 1e-6:
        raise ValueError(f"a MountPoint needs one of `facing` and `mate_x`, a direction across its z axis; found {facing!r} and {mate_x!r}")
    return Location(Plane(location.position, x_dir=along if facing is not None else z.cross(along), z_dir=z))


def origin_of(thing: Thing) -> MountPoint:
    """Return the mount `origin` of a Thing. The frame of this mount is the Thing's own frame."""
    mount = MountPoint(Location())
    mount._owner, mount._name = thing, "origin"
    return mount


def adopt(thing: Thing, name: str, value: Any) -> Any:
    """Prepare a value that is assigned to the attribute `name` of a Thing during its construction.

    Mounts in the value then belong to the Thing. A mount of another Thing is copied at its place. Otherwise the function returns the
    same object. Raises `ValueError` for a forbidden name of a mount.
    """
    return _mapped(name, value, lambda own_name, mount: _owned(thing, own_name, mount))


def settle(thing: Thing, name: str, value: Any, mounts: dict[str, MountPoint]) -> Any:
    """Call `adopt` for the last time: give every mount its final name and add it to `mounts`.

    A mount that already has a name in `mounts` is copied without its expectations. Raises `ValueError` for a duplicate or forbidden name of
    a mount.
    """

    def named(own_name: str, mount: MountPoint) -> MountPoint:
        mount = _owned(thing, own_name, mount)
        if own_name in mounts:
            raise ValueError(f"two mounts of `{type(thing).__name__}` are named `{own_name}`")
        if any(mount is known for known in mounts.values()):
            mount = MountPoint(mount, mount.interface, mount.tolerance)
            mount._owner = thing
        mount._name = own_name
        mounts[own_name] = mount
        return mount

    return _mapped(name, value, named)


def _mapped(name: str, value: Any, change: Callable[[str, MountPoint], MountPoint]) -> Any:
    """Return `value` with each mount replaced by `change(name, mount)`. If no mount changes, return the same object."""
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
        why = "the name is reserved" if plain else "use letters, digits and _"
        raise ValueError(f"`{name}` of `{type(thing).__name__}` cannot be a mount: {why}")
    if mount._owner is None:
        mount._owner, mount._name = thing, name
    elif mount._owner is not thing:
        mount = MountPoint(mount, mount.interface, mount.tolerance)
        mount._owner, mount._name = thing, name
    return mount
