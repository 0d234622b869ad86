"""The `Thing`: a parametric family of parts, each member made once and immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from build123d import Location
from build123d.topology import Shape

from thingc.geometry.things.adjust import adjusted
from thingc.geometry.things.construction import Construction, Parameters, ThingType, shown
from thingc.geometry.things.mounts import MountPoint, adopt, origin_of
from thingc.geometry.things.resolver import Framed, TransformResolver

if TYPE_CHECKING:
    from typing import Self

    from thingc.geometry.things.actuator import Actuator

Geometry: TypeAlias = "Shape[Any] | Iterable[Shape[Any]] | None"
Number: TypeAlias = "float | tuple[float, str]"
"""A number, or the number and its source: `measured`, `vendor` or `estimated`."""


class Thing(Framed, metaclass=ThingType):
    """A part: subclass it, give `__init__` the parameters and assign geometry, frames and mounts to attributes there.

    `__init__` calls `super().__init__(material="petg")`; material and colour (a CSS name or `#rrggbb`) are defaults that a
    document may override, and both may be left out. The arguments of the subclass's own `__init__` are the parameters:
    annotated `Length`, `Angle`, `Mass`, `Count`, `Ratio`, `float`, `int`, `bool`, `str` or `Literal[...]`, else a plain
    number, text or flag by their default. They are checked before `__init__` runs (`ParameterError`) and arrive canonical
    (60 as 60.0). Equal class and parameters are one object, and it is immutable once `__init__` is left.
    """

    bom: Mapping[str, str] = MappingProxyType({})
    """For the bill of materials: `number`, `supplier`, `cost`, `make` (`buy | print | machine`)."""
    print: Mapping[str, Sequence[float]] = MappingProxyType({})
    """How it is printed: `up`, the direction away from the bed, three numbers in the Thing's axes; as it is modelled without it."""
    actuator: Actuator | None = None
    """What moves a joint that names this part as its drive."""
    _construction: Construction

    def __init__(self, material: str | None = None, color: str | None = None) -> None:
        for what, value in (("material", material), ("color", color)):
            if value is not None and (not isinstance(value, str) or not value):
                raise TypeError(f"the {what} of a Thing is a name, such as \"petg\" or \"white\"; found {value!r}")
        self._construction.material = material
        self._construction.color = color

    __init__._base_of_all_things = True  # type: ignore[attr-defined]

    @property
    def p(self) -> Parameters:
        """The parameters by name: `self.p.length`, in author units; those of parent classes too."""
        return Parameters(type(self).__name__, self._construction)

    @property
    def origin(self) -> MountPoint:
        """The mount that every part has: its own frame (through a moved view: where the Thing stands)."""
        return origin_of(self)

    def move(self, location: Location) -> Self:
        """A soft-moved view with the Thing's frame at `location` [mm], for construction: see `TransformResolver`.

        Type checkers see the Thing's own type, so that `XM430().move(loc).horn` is followed.
        """
        self._must_be_finished("move")
        return cast("Self", TransformResolver(self, location))

    def adjust(self, **changes: float | bool | str) -> Self:
        """The same family with changed parameters: `depth=30`, `width__add=0.2`, `height__mul=1.02`.

        A parameter of a parent class that this class pins can be changed too: the class stays the same, and the parent's
        `__init__` runs with the changed value. Raises `ParameterError` for a value, `CallError` for a name.
        """
        self._must_be_finished("adjust")
        return cast("Self", adjusted(self, changes))

    def result(self) -> Geometry:
        """The authoritative geometry, solid, in the Thing's frame [mm]; None where it has none."""
        return None

    def mass(self) -> Number | None:
        """The mass [kg], where it is known better than material times volume; None to leave it to those."""
        return None

    def centre(self) -> Sequence[float] | Any | None:
        """The centre of mass [mm], three numbers (a `Vector` will do) or those and a source; None to leave it to the geometry."""
        return None

    def matrix_of_inertia(self) -> Sequence[Sequence[float]] | Any | None:
        """The 3 x 3 inertia [kg m^2] about the centre of mass along the Thing's axes; None to leave it to the geometry."""
        return None

    def density(self) -> Number | None:
        """The density [kg/m^3], instead of the material's; None to leave it to the material."""
        return None

    def collision(self) -> Geometry:
        """Convex shapes that collide instead of the result, for `collision: part`; None where there are none."""
        return None

    def visual(self) -> Geometry:
        """What is shown instead of the result; None for the result."""
        return None

    def envelope(self) -> Geometry:
        """A simple solid that holds the whole part; None where there is none."""
        return None

    def _seen(self, view: Location) -> TransformResolver:
        return TransformResolver(self, view)

    def __repr__(self) -> str:
        family, adjustments = type(self), self._construction.adjustments
        changed = [f"{name}={value!r}" for parent in family.__mro__ for name, value in sorted(adjustments.get(parent, {}).items())]
        return shown(family, self._construction.parameters) + (f" adjusted to {', '.join(changed)}" if changed else "")

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def _must_be_finished(self, what: str) -> None:
        if not self._construction.finished:
            raise RuntimeError(f"`{type(self).__name__}` cannot use its own {what}() in `__init__`: it is being made")

    if not TYPE_CHECKING:  # a type checker that saw these would let any attribute be assigned

        def __setattr__(self, name: str, value: Any) -> None:
            if self._construction.finished:
                raise AttributeError(
                    f"`{type(self).__name__}` is immutable: `{name}` can be assigned in `__init__` only; "
                    "adjust() gives the same family with other parameters"
                )
            if name in _OVERRIDES:
                raise AttributeError(f"`{name}` of a Thing is a method: write `def {name}(self)` in the class")
            if name in _TAKEN:
                raise AttributeError(f"`{name}` has a meaning for every Thing: choose another name")
            object.__setattr__(self, name, value if name.startswith("_") else adopt(self, name, value))

        def __delattr__(self, name: str) -> None:
            if self._construction.finished:
                raise AttributeError(f"`{type(self).__name__}` is immutable: `{name}` cannot be deleted")
            object.__delattr__(self, name)


_OVERRIDES = frozenset({"result", "mass", "centre", "matrix_of_inertia", "density", "collision", "visual", "envelope"})
_TAKEN = frozenset({"p", "origin", "move", "adjust", "_construction"})
