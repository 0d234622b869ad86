"""The `variants/1` document, key by key. Field docstrings are the hover text of an editor."""

from typing import Annotated, Any, Literal

from pydantic import Field

from thingc.base.units import shorten
from thingc.documents.expressions.terms import Expression
from thingc.documents.spec.base import Model, optional, rule
from thingc.documents.spec.fields import AnyQuantityField, CountField, FieldValidator, Name, describe, fault, name_of, read_expression
from thingc.documents.spec.name_types import AssemblyDocument, ModeField, PoseField, RefersTo, ShownMountField
from thingc.documents.spec.settable_values import EXAMPLES, VALUES, is_value, parse


def _choice_path(value: Any) -> str:
    if isinstance(value, str) and parse(value) is not None:
        return value
    raise fault("reference", f"`{shorten(str(value))}` cannot be a choice", help=f"write {EXAMPLES}")


def _rule_text(value: Any) -> Expression:
    """Validate a comparison of parameters and results."""
    if not isinstance(value, str):
        raise fault("type", f"expected a comparison such as `mass < 2.5 kg`, found {describe(value)}")
    expression = read_expression(value, dotted=True)
    if not expression.compares:
        raise fault("expression", f"expected a comparison, found {describe(value)}", help=f"write, for example, `{shorten(value)} > 0`")
    return expression


def _setting(value: Any) -> str:
    """Validate the key of a setting: the name of a parameter, or the path of a value."""
    if not isinstance(value, str) or "." not in value:
        return name_of(value)
    if parse(value) is not None:
        raise fault("reference", f"`{shorten(value)}` is a choice", help="move the path to `choices`")
    if not is_value(value):
        raise fault("reference", f"`{shorten(value)}` is not the path of a value", help=f"write {VALUES}")
    return value


_SETTING_SCHEMA = {
    "type": "string", "pattern": r"^[A-Za-z]\w*(\.[^.\s]+)*$", "description": "A parameter, or the path of a value in the assembly.",
    "examples": ["leg_length", "joints.elbow.limit.upper"],
}
_PATH_SCHEMA = {
    "type": "string", "pattern": r"^(components\.[A-Za-z]\w*\.)*(part|file|assembly|material|defaults\.component\.material)$",
    "description": "The path of a part, file, assembly or material.", "examples": ["components.foot.part", "defaults.component.material"],
}
_RULE_SCHEMA = {
    "type": "string", "description": "A comparison over parameters and results.",
    "examples": ["mass < 2.5 kg", "leg_length > 2 * foot_length", "torque_margin > 1.3"],
}

SettingField = Annotated[str, FieldValidator(_setting, "a parameter or the path of a value", _SETTING_SCHEMA), RefersTo("setting")]
ChoicePathField = Annotated[str, FieldValidator(_choice_path, "the path of a choice", _PATH_SCHEMA), RefersTo("setting")]
RuleField = Annotated[Expression, FieldValidator(_rule_text, "a comparison", _RULE_SCHEMA), RefersTo("rule")]

ChoiceField = Annotated[str, RefersTo("choice")]


class AxisSpec(Model):
    """Evenly spaced values of a parameter, including both ends of the range."""

    from_: AnyQuantityField = Field(alias="from", description="The first value.")
    to: AnyQuantityField
    """The last value of the parameter."""
    count: CountField
    """Number of values, at least 2."""


class ListedSpec(Model):
    """A single variant with explicit values of parameters."""

    name: Name | None = None
    """The name of the variant; default: the name of the document with a number."""
    parameters: dict[SettingField, AnyQuantityField] = Field(default={}, examples=[{"leg_length": "100 mm"}])
    """Values of the assembly's parameters by name, and other values by path."""
    choices: dict[ChoicePathField, ChoiceField] = Field(default={}, examples=[{"components.foot.part": "minchw.foot:WideFoot"}])
    """Choices of parts, assemblies and materials, by path in the assembly."""


Method = Literal["sobol", "lhs", "uniform"]
"""Sampling methods for variants."""


class SampleSpec(Model):
    """Randomly drawn variants. Lists under `parameters` and `choices` are also sampled."""

    method: Method = "sobol"
    """`sobol` (scrambled Sobol sequence), `lhs` (Latin hypercube) or `uniform`."""
    count: CountField
    """Number of variants."""
    seed: CountField
    """Seed of the random generator; the same seed gives the same variants."""
    ranges: dict[SettingField, Annotated[list[AnyQuantityField], Field(min_length=2, max_length=2)]] = Field(
        default={}, examples=[{"leg_length": ["70 mm", "140 mm"], "joints.elbow.dynamics.damping": ["0.1 N*m*s/rad", "1 N*m*s/rad"]}],
    )
    """The smallest and the largest value of a parameter, or of a value at a path. If both are
    whole numbers without a decimal point, only whole numbers are drawn."""


class ReachSpec(Model):
    """The distance between two mounts for the result `reach`."""

    of: ShownMountField
    """The first mount, such as `tip` or `hand.tip`."""
    from_: ShownMountField = Field(alias="from", description="The mount from which the reach is measured.")


class VariantsSpec(Model):
    """A family of robots: one assembly with many sets of values."""

    thingc: Literal["variants/1"]
    """Kind and version of this document."""
    assembly: AssemblyDocument = Field(examples=["minchw.yaml"])
    """The assembly document."""
    name: Name
    """The name of the batch and of its folder."""
    description: str = Field(default="", examples=["Robots with legs of different lengths."])
    """A description of the variants."""
    parameters: dict[SettingField, list[AnyQuantityField] | AxisSpec | AnyQuantityField] = Field(
        default={}, examples=[{"leg_length": ["80 mm", "100 mm"], "body_width": {"from": "60 mm", "to": "90 mm", "count": 4}}],
    )
    """Values of parameters, by name, and other values, by path (`joints.elbow.limit.upper`). A list or range is an axis of the grid. A
    single value applies to all variants.
    """
    choices: dict[ChoicePathField, list[ChoiceField] | ChoiceField] = Field(
        default={}, examples=[{"components.foot.part": ["minchw.foot:Foot", "minchw.foot:WideFoot"]}],
    )
    """Choices of parts, assemblies, files and materials, by path in the assembly. A list is an axis of the grid."""
    list_: list[ListedSpec] = Field(
        default=[], alias="list", description="Single variants, which come before the variants of the grid.",
        examples=[[{"name": "short", "parameters": {"leg_length": "80 mm"}}]],
    )
    sample: SampleSpec | None = optional({"method": "sobol", "count": 256, "seed": 7, "ranges": {"leg_length": ["70 mm", "140 mm"]}})
    """Settings for variants that are drawn at random instead of from a grid."""
    keep: list[RuleField] = Field(default=[], examples=[["mass < 2.5 kg", "reach > 400 mm"]])
    """Comparisons of parameters and results. A variant for which a comparison is false is recorded but not built."""
    modes: list[ModeField] = Field(default=[], examples=[["bench"]])
    """The modes to build; default: all modes of the assembly. Results are for the first mode."""
    pose: PoseField | None = None
    """The pose for the results; default: the start pose of the mode."""
    reach: ReachSpec | None = optional({"of": "hand.tip", "from": "base"})
    """The mounts for the result `reach`."""
    emit: list[str] = Field(default=["mjcf"], examples=[["mjcf", "stl"]])
    """Targets to write for each variant, as for `thingc build --emit`."""

    layout: Literal["folders", "packed"] | None = None
    """With `folders`, each variant has its own folder. With `packed`, up to 1024 variants are in one file. The default is `packed` for more
    than 2000 variants.
    """

    def _check_rules(self) -> None:
        both = [name for name in (self.sample.ranges if self.sample is not None else {}) if name in self.parameters]
        if both:
            help = f"remove `{both[0]}` from `parameters` or from `sample`"
            raise rule(f"`{both[0]}` is in both `parameters` and `sample`", help, "parameters")
