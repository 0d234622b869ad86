"""Things: parameters and their validation, one object per set of values, immutability, `p` and `adjust`."""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, Literal

import pytest
from build123d import Box, BuildPart, Cylinder, Part, Plane, Pos, Shape, Vector

from thingc import MATE, Angle, Count, Length, Mass, MountPoint, ParameterError, Range, Ratio, Thing
from thingc.geometry.things.inspection import build, is_part, parameters_of
from thingc.geometry.things.parameters import CallError, Parameter, SignatureError

if TYPE_CHECKING:
    from thingc import Length as Elsewhere

MADE: list[str] = []


class Block(Thing):
    """A block.

    Args:
        length: along x,
            the long side
        holes (int): how many
        side: where
    """

    def __init__(
        self,
        length: Annotated[Length, Range(10, 200)] = 60,
        tilt: Angle = 0.0,
        load: Mass = 1,
        holes: Count = 2,
        infill: Ratio = 0.15,
        side: Literal["left", "right"] = "left",
        *,
        solid: bool = True,
        label: str = "block",
    ):
        MADE.append("Block")
        super().__init__(material="petg", color="lavender")
        self.body = Box(length, 20, 5)
        self.top = MountPoint(Pos(0, 0, 2.5))
        self.given = (length, tilt, load, holes, infill, side, solid, label)

    def result(self) -> Part:
        return self.body


# --- parameters ----------------------------------------------------------------------------------------------------------


def test_init_arguments_are_the_parameters() -> None:
    def parameter(name: str, kind: str, default: Any, **more: Any) -> Parameter:
        return Parameter(name=name, kind=kind, required=False, default=default, **more)

    assert parameters_of(Block) == (
        parameter("length", "length", 60.0, minimum=10, maximum=200, doc="along x, the long side"),
        parameter("tilt", "angle", 0.0),
        parameter("load", "mass", 1.0, minimum=0),
        parameter("holes", "count", 2, minimum=0, doc="how many"),
        parameter("infill", "ratio", 0.15),
        parameter("side", "choice", "left", choices=("left", "right"), doc="where"),
        parameter("solid", "flag", True),
        parameter("label", "text", "block"),
    )


def test_plain_and_missing_annotations() -> None:
    class Plain(Thing):
        def __init__(
            self, needed: Elsewhere, ratio: float, teeth: int, twist: Annotated[int, Range(-4, 4)], either: float | int = 2,
            size=3, flag=False, text="x",
        ):
            super().__init__()

    kinds = {p.name: (p.kind, p.required, p.default) for p in parameters_of(Plain)}
    assert kinds == {
        "needed": ("length", True, None), "ratio": ("number", True, None), "teeth": ("integer", True, None),
        "twist": ("integer", True, None),
        "either": ("number", False, 2.0), "size": ("number", False, 3.0),
        "flag": ("flag", False, False), "text": ("text", False, "x"),
    }


def test_integers_may_be_negative_but_counts_may_not() -> None:
    class Turned(Thing):
        def __init__(self, steps: int = 1, least: Annotated[int, Range(-4)] = -4, holes: Count = 2):
            super().__init__()
            self.given = (steps, least, holes)

    def given(**parameters: Any) -> Any:
        return build(Turned, parameters).given  # type: ignore[attr-defined]

    assert given(steps=-3, least=-4.0) == (-3, -4, 2) and all(type(one) is int for one in given(steps=-3.0))
    for wrong, message in (
        ({"steps": -2.5}, "`steps` of `Turned` must be a whole number, found -2.5"),
        ({"least": -5}, "`least` of `Turned` must be at least -4, found -5"),
        ({"holes": -1}, "`holes` of `Turned` must be at least 0, found -1"),
    ):
        with pytest.raises(ParameterError, match=message):
            given(**wrong)


Elsewhere = Length


def test_parameter_docs_from_three_docstring_styles() -> None:
    class Numpy(Thing):
        """A part.

        Parameters
        ----------
        a, b : float
            Two
            sides.
        c
            Third.

        Returns
        -------
        d : nothing
        """

        def __init__(self, a: Length = 1, b: Length = 1, c: Length = 1, d: Length = 1):
            """Made so.

            :param d: Fourth,
                of four.
            :param float c: Better said.
            :raises ValueError: never
            """

    assert {p.name: p.doc for p in parameters_of(Numpy)} == {
        "a": "Two sides.", "b": "Two sides.", "c": "Better said.", "d": "Fourth, of four.",
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"length": "long"}, "`length` of `Block` must be a length in mm, found 'long'"),
        ({"length": None}, "`length` of `Block` must be a length in mm, found None"),
        ({"length": True}, "`length` of `Block` must be a length in mm, found True"),
        ({"tilt": [1]}, "`tilt` of `Block` must be an angle in deg, found [1]"),
        ({"load": "1 kg"}, "`load` of `Block` must be a mass in kg, found '1 kg'"),
        ({"infill": "15 %"}, "`infill` of `Block` must be a ratio, found '15 %'"),
        ({"holes": 2.5}, "`holes` of `Block` must be a whole number, found 2.5"),
        ({"solid": 1}, "`solid` of `Block` must be a boolean, found 1"),
        ({"label": 3}, "`label` of `Block` must be a string, found 3"),
        ({"side": "middle"}, "`side` of `Block` must be one of 'left', 'right', found 'middle'"),
        ({"length": math.nan}, "`length` of `Block` must be finite, found nan"),
        ({"holes": math.inf}, "`holes` of `Block` must be finite, found inf"),
        ({"infill": 10**400}, f"`infill` of `Block` must be finite, found {10**400}"),
        ({"length": 9.5}, "`length` of `Block` must be at least 10 mm, found 9.5 mm"),
        ({"length": 201}, "`length` of `Block` must be at most 200 mm, found 201 mm"),
        ({"holes": -1}, "`holes` of `Block` must be at least 0, found -1"),
        ({"load": -0.5}, "`load` of `Block` must be at least 0 kg, found -0.5 kg"),
    ],
)
def test_values_are_validated_before_construction(arguments: dict[str, Any], message: str) -> None:
    MADE.clear()
    with pytest.raises(ParameterError) as caught:
        Block(**arguments)
    assert str(caught.value) == message
    assert isinstance(caught.value, ValueError)
    assert (caught.value.owner, caught.value.parameter) == ("Block", *arguments)
    assert MADE == []


class Peg(Thing):
    def __init__(self, length: Length, side: Literal[1, 2, True] = 1):
        super().__init__()
        self.side = side


@pytest.mark.parametrize(
    ("call", "message", "parameter"),
    [
        (lambda: Peg(), "`Peg` needs `length`, a length in mm", "length"),
        (lambda: Peg(1, lenght=2), "`Peg` has no parameter `lenght`; did you mean `length`?", "lenght"),
        (lambda: Peg(1, zz=2), "`Peg` has no parameter `zz`; there are `length`, `side`", "zz"),
        (lambda: Peg(1, length=2), "`length` of `Peg` is given twice", "length"),
        (lambda: Peg(1, 2, 3), "`Peg` expects 2 positional arguments, found 3", "length"),
        (lambda: Block(60, 0, 1, 2, 0.1, "left", False), "`Block` expects 6 positional arguments, found 7", "length"),
        (lambda: Frame(material="steel"), "`Frame` has no parameter `material`", "material"),
    ],
)
def test_invalid_calls_are_reported(call: Callable[[], Thing], message: str, parameter: str) -> None:
    with pytest.raises(CallError) as caught:
        call()
    assert (str(caught.value), caught.value.parameter) == (message, parameter)
    assert isinstance(caught.value, TypeError) and isinstance(caught.value, ParameterError)


class Frame(Thing):
    """A Thing without `__init__`, so it has no parameters."""


def test_a_thing_without_init_has_no_parameters() -> None:
    assert parameters_of(Frame) == () and Frame() is Frame()
    assert Frame().result() is None


def test_choices_are_distinguished_by_type() -> None:
    assert Peg(1, 1) is not Peg(1, True)
    assert Peg(1, True).side is True and Peg(1, 2.0).side == 2 and type(Peg(1, 2.0).side) is int


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("self, *sizes", "`*sizes` of `Bad` cannot be a parameter: write each parameter separately"),
        ("self, **sizes", "`**sizes` of `Bad` cannot be a parameter: write each parameter separately"),
        ("self, size, /", "`size` of `Bad` cannot be a parameter: remove the `/`"),
        ("self, size=None", "the default of `size` of `Bad` must be a number, a string or a boolean, found None"),
        (
            "self, size: Vector",
            "the annotation of `size` of `Bad` must be Length, Angle, Mass, Count, Ratio, "
            "float, int, bool, str or Literal[...], found `Vector`",
        ),
        (
            "self, size: 'Lenth' = 3",
            "`size` of `Bad` cannot be a parameter: invalid annotation `Lenth`: name 'Lenth' is not defined",
        ),
        ("self, size: Length = 'x'", "the default of `size` of `Bad` must be a length in mm, found 'x'"),
        ("self, size: Annotated[Length, Range(5, 9)] = 4", "the default of `size` of `Bad` must be at least 5 mm, found 4 mm"),
        ("self, size: Annotated[str, Range(5, 9)] = 'x'", "the Range of `size` of `Bad` requires a number, found a string"),
        (
            "self, size: Literal['a', None] = 'a'",
            "the choices of `size` of `Bad` must be strings, integers or booleans",
        ),
    ],
)
@pytest.mark.parametrize("future", ["", "from __future__ import annotations\n"])
def test_invalid_signatures_are_reported(definition: str, message: str, future: str) -> None:
    scope: dict[str, Any] = {"__name__": __name__}
    vocabulary = "from thingc import *\nfrom typing import *\nfrom build123d import Vector\n"
    source = f"{future}{vocabulary}class Bad(Thing):\n    def __init__({definition}): pass\n"
    exec(compile(source, "bad.py", "exec", dont_inherit=True), scope)
    with pytest.raises(SignatureError) as caught:
        scope["Bad"]()
    found = str(caught.value).replace("build123d.geometry.Vector", "Vector")
    assert found == message
    with pytest.raises(TypeError):
        parameters_of(scope["Bad"])


def test_ranges_are_combined_and_validated() -> None:
    class Ranged(Thing):
        def __init__(
            self,
            count: Annotated[Count, Range(maximum=8)] = 3,
            size: Annotated[Annotated[Length, Range(1, 9)], Range(2, 20)] = 5,
        ):
            pass

    assert [(p.minimum, p.maximum) for p in parameters_of(Ranged)] == [(0, 8), (2, 9)]
    with pytest.raises(SignatureError, match=r"^Range\(9, 1\) is empty$"):
        Range(9, 1)
    with pytest.raises(SignatureError, match="^a bound of Range must be a number, found '1'$"):
        Range("1")  # type: ignore[arg-type]


# --- one object per value, immutable ---------------------------------------------------------------------------------------


def test_equal_parameters_give_the_same_object() -> None:
    MADE.clear()
    first = Block(61)
    assert first is Block(61.0) is Block(length=61) is Block(61, 0, side="left", label="block", holes=2.0)  # type: ignore[arg-type]
    assert first is Block(tilt=-0.0, length=61)
    assert first is not Block(62) and first is not Block(61, holes=3)
    assert MADE == ["Block"] * 3
    assert copy.copy(first) is first and copy.deepcopy([first])[0] is first


def test_arguments_are_converted_to_canonical_types() -> None:
    given = Block(63, holes=4.0, load=2).given  # type: ignore[arg-type]
    assert given == (63.0, 0.0, 2.0, 4, 0.15, "left", True, "block")
    assert [type(value) for value in given] == [float, float, float, int, float, str, bool, str]


def test_numpy_numbers_are_accepted() -> None:
    numpy = pytest.importorskip("numpy")
    assert Block(numpy.float32(61)) is Block(numpy.int64(61)) is Block(61)
    assert type(Block(holes=numpy.int64(5)).given[3]) is int


def test_equal_parameters_of_a_subclass_give_another_object() -> None:
    class Slab(Block):
        pass

    assert Slab(61) is Slab(61.0) and Slab(61) is not Block(61)
    assert repr(Slab(61)).startswith("Slab(length=61.0, tilt=0.0, load=1.0, holes=2, ")


def test_finished_thing_is_immutable() -> None:
    block = Block()
    for name in ("body", "fresh", "_private"):
        with pytest.raises(AttributeError) as caught:
            setattr(block, name, 3)
        assert str(caught.value) == (
            f"`Block` is immutable: `{name}` can only be assigned in `__init__`; "
            "use adjust() to change parameters"
        )
    with pytest.raises(AttributeError, match="^`Block` is immutable: `body` cannot be deleted$"):
        del block.body
    with pytest.raises(AttributeError, match="^`Block` is immutable: `__init__` cannot be called again$"):
        block.__init__(70)  # type: ignore[misc]
    assert block is Block() and block.given[0] == 60


def test_attributes_can_be_assigned_in_the_whole_init_chain() -> None:
    class Plate(Block):
        def __init__(self, side: Length = 50):
            self.before = side
            super().__init__(side)
            self.after = self.body.volume
            self._helped()
            del self.before

        def _helped(self) -> None:
            self.helper = 1

    plate = Plate()
    assert (plate.after, plate.helper, hasattr(plate, "before")) == (pytest.approx(50 * 20 * 5), 1, False)
    with pytest.raises(AttributeError):
        plate._helped()


def test_reserved_attribute_names_are_rejected() -> None:
    class Heavy(Thing):
        def __init__(self, name: str):
            setattr(self, name, 3)

    with pytest.raises(AttributeError, match=r"^`mass` of a Thing is a method: write `def mass\(self\)` in the class$"):
        Heavy("mass")
    with pytest.raises(AttributeError, match="^`origin` is reserved in every Thing: choose another name$"):
        Heavy("origin")


def test_failed_init_raises_its_error_and_is_not_cached() -> None:
    class Fragile(Thing):
        def __init__(self, length: Length = 1):
            MADE.append("Fragile")
            assert length < 5, "too long"
            if len(MADE) < 2:
                raise ValueError("not yet")

    MADE.clear()
    with pytest.raises(ValueError, match="^not yet$"):
        Fragile()
    assert isinstance(Fragile(), Fragile)
    with pytest.raises(AssertionError, match="^too long"):
        Fragile(6)


def test_self_dependent_thing_is_reported() -> None:
    class Mirror(Thing):
        def __init__(self, size: Length = 1):
            self.other = Mirror(size)

    with pytest.raises(RecursionError, match=r"^`Mirror\(size=1.0\)` depends on itself$"):
        Mirror()

    class Restless(Thing):
        def __init__(self, size: Length = 1):
            self.bigger = self.adjust(size=2)

    with pytest.raises(RuntimeError, match=r"^`Restless` cannot call its own adjust\(\) in `__init__`$"):
        Restless()


def test_geometry_of_a_thing_is_not_added_to_a_builder() -> None:
    with BuildPart(Pos(100, 0, 0)) as builder:
        Cylinder(1, 2)
        block = Block(77)
    assert builder.part is not None and builder.part.volume == pytest.approx(2 * math.pi)
    assert tuple(block.body.center()) == pytest.approx((0, 0, 0), abs=1e-9)


def test_abstract_thing_cannot_be_instantiated() -> None:
    class Abstract(Thing):
        @abstractmethod
        def shape(self) -> Shape[Any]: ...

    with pytest.raises(TypeError, match="abstract"):
        Abstract()
    assert is_part(Abstract) is None


def test_material_and_colour_must_be_names() -> None:
    class Odd(Thing):
        def __init__(self, name: str):
            super().__init__(material=3 if name == "material" else None, color=name)  # type: ignore[arg-type]

    with pytest.raises(TypeError, match='^the material of a Thing must be a name such as "petg" or "white", found 3$'):
        Odd("material")
    with pytest.raises(TypeError, match='^the color of a Thing must be a name such as "petg" or "white"'):
        Odd("")


# --- p and adjust -----------------------------------------------------------------------------------------------------------


class Case(Thing):
    """The generic base class."""

    def __init__(self, width: Annotated[Length, Range(1, 100)], height: Length, holes: Count = 1, lid: bool = True):
        super().__init__()
        self.seen = (self.p.width, self.p.height)
        self.body = Box(width, height, 10)
        self.gap = parameter_of(self, "width")

    def result(self) -> Part:
        return self.body


class Servo(Case):
    """A model that fixes the width of the base class and passes twice its own height to it."""

    bom = {"make": "buy"}

    def __init__(self, height: Length = 20):
        super().__init__(28, height * 2, holes=3)
        self.own = self.p.height
        self.horn = MountPoint(Pos(0, 0, self.p.width))


class Clone(Servo):
    """Fixes all parameters."""

    def __init__(self):
        super().__init__(25)


def parameter_of(thing: Thing, name: str) -> float:
    return getattr(thing.p, name)


def test_p_reads_parameters() -> None:
    block = Block(64)
    assert (block.p.length, block.p.side, block.p.solid) == (64.0, "left", True)
    assert dir(block.p) == ["holes", "infill", "label", "length", "load", "side", "solid", "tilt"]
    assert repr(Servo().p) == "Parameters(height=20.0, width=28.0, holes=3, lid=True)"
    with pytest.raises(AttributeError, match="^`Block` has no parameter `lenght`; did you mean `length`?"):
        _ = block.p.lenght
    with pytest.raises(AttributeError):
        block.p.length = 3


def test_p_in_init_reads_the_arguments_of_that_class() -> None:
    servo = Servo(21)
    assert servo.seen == (28.0, 42.0)     # in Case.__init__, `height` is Case's
    assert servo.own == 21.0              # back in Servo.__init__ it is Servo's
    assert (servo.p.height, servo.p.width, servo.p.holes) == (21.0, 28.0, 3)
    assert tuple(servo.horn.location.position) == (0, 0, 28)


def test_adjust_supports_set_add_and_mul() -> None:
    block = Block(50, holes=3)
    assert block.adjust() is block
    assert block.adjust(length=70) is Block(70, holes=3)
    assert block.adjust(length__add=0.2) is Block(50.2, holes=3)
    assert block.adjust(length__mul=1.5, holes__add=2, side="right") is Block(75, holes=5, side="right")
    assert block.adjust(length__add=1).adjust(length__add=-1) is block


def test_adjust_changes_a_parameter_fixed_by_a_subclass() -> None:
    servo = Servo()
    wider = servo.adjust(width__add=0.2, height=30)
    assert type(wider) is Servo and wider is not Servo(30)
    size = wider.body.bounding_box().size
    assert tuple(size) == pytest.approx((28.2, 60, 10), abs=1e-6)
    assert (wider.p.width, wider.p.height, wider.seen) == (28.2, 30.0, (28.2, 60.0))
    assert tuple(wider.horn.location.position) == pytest.approx((0, 0, 28.2))   # the subclass is made anew around it
    assert wider.bom == {"make": "buy"}
    assert wider is Servo(30).adjust(width=28.2) is servo.adjust(height=30).adjust(width__add=0.2)
    assert wider is servo.adjust(width__add=0.2).adjust(height=30)
    assert wider.adjust(width=28) is Servo(30)
    assert servo.adjust(width=28) is servo and servo.adjust(width__mul=1) is servo
    assert Servo().body.volume == pytest.approx(28 * 40 * 10)


def test_adjust_through_two_subclass_levels() -> None:
    clone = Clone()
    assert clone.body.volume == pytest.approx(28 * 50 * 10)
    taller = clone.adjust(height__add=1)            # Servo's height, the nearest of that name: Case's is twice that
    assert type(taller) is Clone and tuple(taller.body.bounding_box().size) == pytest.approx((28, 52, 10), abs=1e-6)
    wider = taller.adjust(width__mul=2, lid=False)
    assert tuple(wider.body.bounding_box().size) == pytest.approx((56, 52, 10), abs=1e-6)
    assert wider.p.lid is False and clone.p.lid is True
    assert wider.adjust(width=28, lid=True, height=25) is clone
    assert repr(wider) == "Clone() adjusted to height=26.0, lid=False, width=56.0"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"widht": 3}, "`Servo` has no parameter `widht`; did you mean `width`?"),
        ({"zz__add": 3}, "`Servo` has no parameter `zz`; there are `height`, `width`, `holes`, `lid`"),
        ({"width": 3, "width__add": 1}, "`width` of `Servo` is changed twice"),
        ({"width": 101}, "`width` of `Servo` must be at most 100 mm, found 101 mm"),
        ({"width__mul": 4}, "`width` of `Servo` must be at most 100 mm, found 112 mm"),
        ({"height": "x"}, "`height` of `Servo` must be a length in mm, found 'x'"),
        ({"height__add": "x"}, "`height__add` of `Servo` must be a number, found 'x'"),
        ({"holes__mul": 0.5}, "`holes` of `Servo` must be a whole number, found 1.5"),
        ({"lid__add": 1}, "`lid__add` of `Servo` requires a number, but `lid` is a boolean"),
    ],
)
def test_adjustments_are_validated(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Servo().adjust(**changes)
    assert str(caught.value) == message


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 1, 0), (-1, 0, 0), (1, 2, 3)])
def test_facing_and_mate_x_align_for_any_plane(normal: tuple[float, float, float]) -> None:
    """`mate_x` of the seat and `facing` of the attached part, both perpendicular to their z axes, coincide."""
    z = Vector(*normal).normalized()
    across = z.cross(Vector(3, -1, 0.5)).normalized()
    seat = MountPoint(Plane((1, 2, 3), z_dir=z), mate_x=across + 2 * z)
    part = MountPoint(Plane((4, 5, 6), z_dir=(0, -1, 0)), facing=(1, 0, 0))
    placed = Plane(seat.location * MATE * part.location.inverse())
    assert (placed.x_dir - across).length < 1e-9 and (seat.location.position - Vector(1, 2, 3)).length < 1e-9
    for wrong in ({"facing": z}, {"mate_x": -z}, {"facing": across, "mate_x": across}):
        with pytest.raises(ValueError, match="a MountPoint requires either `facing` or `mate_x`"):
            MountPoint(Plane((1, 2, 3), z_dir=z), **wrong)
