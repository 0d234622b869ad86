"""The base class `Thing` of parametric parts. For each set of parameters, a Thing is created only once, and it is immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from build123d import Location
from build123d.topology import Shape

from thingc.geometry.things.adjust import adjust_thing
from thingc.geometry.things.construction import Construction, Parameters, ThingType, format_thing
from thingc.geometry.things.mounts import MountPoint, adopt, origin_of
from thingc.geometry.things.resolver import Framed, TransformResolver

if TYPE_CHECKING:
    from typing import Self

    from thingc.geometry.things.actuator import Actuator

Geometry: TypeAlias = "Shape[Any] | Iterable[Shape[Any]] | None"
Number: TypeAlias = "float | tuple[float, str]"
"""A number, or a tuple of a number and its source (`measured`, `vendor` or `estimated`)."""


class Thing(Framed, metaclass=ThingType):
    """The base class of parametric parts. A subclass defines a family of parts. To define a part, write a subclass whose `__init__` has the
    parameters and assigns geometry, frames and mounts to attributes.

    In `__init__`, call `super().__init__(material="petg")`. The material and the colour (a CSS name or `#rrggbb`) are optional defaults.
    Documents can override the material and the colour. The arguments of the subclass's own `__init__` are the parameters. Annotate them
    with `Length`, `Angle`, `Mass`, `Count`, `Ratio`, `float`, `int`, `bool`, `str` or `Literal[...]`. If an argument has no annotation, its
    default determines whether the parameter is a number, a string or a flag. Arguments are checked before `__init__` runs, and invalid
    arguments raise `ParameterError`. `__init__` receives the arguments in canonical form (60 as 60.0). Two calls of a class with the same
    parameters return the same object, which is immutable after `__init__`.
    """

    bom: Mapping[str, str | Mapping[int, str]] = MappingProxyType({})
    """Entries for the bill of materials. The keys are `number`, `name`, `supplier`, `cost` (a price, or prices by quantity), `link`,
    `picture` and `make` (`buy | print | machine`).
    """
    print: Mapping[str, Sequence[float]] = MappingProxyType({})
    """Print settings of the part. The key `up` is the direction away from the print bed, as three numbers in the frame of the Thing. By
    default, this direction is z.
    """
    actuator: Actuator | None = None
    """The actuator of each joint whose drive refers to this part."""
    _construction: Construction

    def __init__(self, material: str | None = None, color: str | None = None) -> None:
        for what, value in (("material", material), ("color", color)):
            if value is not None and (not isinstance(value, str) or not value):
                raise TypeError(f"the {what} of a Thing must be a name such as \"petg\" or \"white\", found {value!r}")
        self._construction.material = material
        self._construction.color = color

    __init__._base_of_all_things = True  # type: ignore[attr-defined]

    @property
    def p(self) -> Parameters:
        """The parameters by name, in author units. For example, use `self.p.length`. Parameters of parent classes are also available."""
        return Parameters(type(self).__name__, self._construction)

    @property
    def origin(self) -> MountPoint:
        """The part's own frame as a mount. Every part has the mount `origin`. For a moved view, this mount is at the place of the Thing."""
        return origin_of(self)

    def move(self, location: Location) -> Self:
        """Return a moved view of the Thing with its frame at `location` [mm] (see `TransformResolver`).

        For type checkers, the result has the type of the Thing, so they can check `XM430().move(loc).horn`.
        """
        self._must_be_finished("move")
        return cast("Self", TransformResolver(self, location))

    def adjust(self, **changes: float | bool | str) -> Self:
        """Return a Thing of the same class with changed parameters.

        Examples of changes are `depth=30`, `width__add=0.2` and `height__mul=1.02`. `adjust` can also change a parameter of a parent class
        that this class sets. The class stays the same, and the parent's `__init__` runs with the changed value. Raises `ParameterError` for
        an invalid value, and `CallError` for an unknown name.
        """
        self._must_be_finished("adjust")
        return cast("Self", adjust_thing(self, changes))

    def result(self) -> Geometry:
        """Return the solid geometry of the part in the Thing's frame [mm], or None for a part without geometry."""
        return None

    def mass(self) -> Number | None:
        """Return the mass [kg] if a better value than density times volume is known, otherwise None."""
        return None

    def centre(self) -> Sequence[float] | Any | None:
        """Return the centre of mass [mm] as three numbers, as a `Vector`, or as `(numbers, source)`. Return None to use the centre of the
        geometry.
        """
        return None

    def matrix_of_inertia(self) -> Sequence[Sequence[float]] | Any | None:
        """Return the 3 x 3 inertia matrix [kg m^2] about the centre of mass, along the axes of the Thing. Return None to use the inertia of
        the geometry.
        """
        return None

    def density(self) -> Number | None:
        """Return the density [kg/m^3], or None to use the density of the material."""
        return None

    def collision(self) -> Geometry:
        """Return convex shapes that replace the result for collisions (`collision: part`). Return None if there are no such shapes."""
        return None

    def visual(self) -> Geometry:
        """Return the geometry to display instead of the result, or None to display the result."""
        return None

    def envelope(self) -> Geometry:
        """Return a simple solid that contains the whole part, or None if there is no such solid."""
        return None

    def _in_frame(self, view: Location) -> TransformResolver:
        return TransformResolver(self, view)

    def __repr__(self) -> str:
        family, adjustments = type(self), self._construction.adjustments
        changed = [f"{name}={value!r}" for parent in family.__mro__ for name, value in sorted(adjustments.get(parent, {}).items())]
        return format_thing(family, self._construction.parameters) + (f" adjusted to {', '.join(changed)}" if changed else "")

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def _must_be_finished(self, what: str) -> None:
        if not self._construction.finished:
            raise RuntimeError(f"`{type(self).__name__}` cannot call its own {what}() in `__init__`")

    if not TYPE_CHECKING:  # hidden from type checkers, which would otherwise accept any attribute

        def __setattr__(self, name: str, value: Any) -> None:
            if self._construction.finished:
                raise AttributeError(
                    f"`{type(self).__name__}` is immutable: `{name}` can only be assigned in `__init__`; "
                    "use adjust() to change parameters"
                )
            if name in _OVERRIDES:
                raise AttributeError(f"`{name}` of a Thing is a method: write `def {name}(self)` in the class")
            if name in _TAKEN:
                raise AttributeError(f"`{name}` is reserved in every Thing: choose another name")
            object.__setattr__(self, name, value if name.startswith("_") else adopt(self, name, value))

        def __delattr__(self, name: str) -> None:
            if self._construction.finished:
                raise AttributeError(f"`{type(self).__name__}` is immutable: `{name}` cannot be deleted")
            object.__delattr__(self, name)


_OVERRIDES = frozenset({"result", "mass", "centre", "matrix_of_inertia", "density", "collision", "visual", "envelope"})
_TAKEN = frozenset({"p", "origin", "move", "adjust", "_construction"})
