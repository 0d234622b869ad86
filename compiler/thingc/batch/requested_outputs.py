"""What a document asks of every variant: targets, modes, a pose, mounts and results that the assembly has to have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from thingc.base.diagnostics import Code, Report
from thingc.base.source import Document
from thingc.base.suggestions import did_you_mean
from thingc.base.units import shortened
from thingc.batch.rules import Rule
from thingc.documents.spec.variants import VariantsSpec
from thingc.geometry.record import PartDefinition
from thingc.model.resolve.types import AssemblyDefinition


def targets_of(document: Document, spec: VariantsSpec, report: Report) -> tuple[str, ...]:
    """The targets that are written, in the order of a build."""
    from thingc.targets.registry import chosen, unknown

    for index, message, hint in unknown(spec.emit):
        report.add(Code.VARIANT_TARGET, message, document.span(("emit", index)), help=hint, path=f"emit[{index}]")
    return chosen(spec.emit) if spec.emit else ()


def check_names(document: Document, spec: VariantsSpec, model: AssemblyDefinition, report: Report) -> None:
    """Report modes, a pose and mounts that the assembly has not."""
    modes = [mode.name for mode in model.modes]
    for index, name in enumerate(spec.modes):
        if name not in modes:
            report.add(
                Code.UNKNOWN_MODE, f"`{model.name}` has no mode `{name}`", document.span(("modes", index)),
                help=did_you_mean(name, modes, what="modes"), path=f"modes[{index}]",
            )
    poses = [pose.name for pose in model.poses]
    if spec.pose is not None and spec.pose not in poses:
        report.add(
            Code.UNKNOWN_POSE, f"`{model.name}` has no pose `{spec.pose}`", document.span(("pose",)),
            help=did_you_mean(spec.pose, poses, what="poses"), path="pose",
        )
    if spec.reach is None or any(path.endswith(".assembly") for path in spec.choices):
        return
    for key, text in (("of", spec.reach.of), ("from", spec.reach.from_)):
        missing = _missing(model, text.split("."))
        if missing is not None:
            word, known, what = missing
            report.add(
                Code.UNKNOWN_COMPONENT if what == "components" else Code.UNKNOWN_MOUNT,
                f"there is no {'component' if what == 'components' else 'mount'} `{shortened(word)}` here",
                document.span(("reach", key)), help=did_you_mean(word, known, what=what), path=f"reach.{key}",
            )


def check_margin(
    document: Document, spec: VariantsSpec, model: AssemblyDefinition, rules: Sequence[Rule], report: Report,
) -> None:
    """Report rules on the torque margin where the mode of the results has loops: how they share the load is not known."""
    wanted = spec.modes[0] if spec.modes else model.modes[0].name
    mode = next((mode for mode in model.modes if mode.name == wanted), None)
    if mode is None or not (mode.holds or any(joint.loop for joint in model.joints)):
        return
    for index, expression in enumerate(spec.keep):
        rule = next((rule for rule in rules if rule.expression is expression), None)
        if rule is not None and "torque_margin" in rule.names.values():
            report.add(
                Code.RESULT, f"there is no `torque_margin` in mode `{mode.name}`: its loops share the load",
                document.span(("keep", index)), help="write another mode first under `modes`, or take the rule out", path=f"keep[{index}]",
            )


def moving_joints(model: AssemblyDefinition, prefix: str = "") -> Iterator[str]:
    """The paths of all joints that move, nested ones included."""
    for name in dict.fromkeys(joint.name.joint for joint in model.joints if joint.kind.moves):
        yield prefix + name
    for component in model.components:
        if isinstance(component.definition, AssemblyDefinition):
            yield from moving_joints(component.definition, f"{prefix}{component.name}/")


def _missing(model: AssemblyDefinition, words: list[str]) -> tuple[str, Mapping[str, Any] | list[str], str] | None:
    """The word of a reference to a mount that the model has not, what it has, and what that is; None where there is nothing
    to say (the mounts of a part are not known before it is modelled)."""
    if len(words) == 1:
        return None if words[0] in model.mounts else (words[0], model.mounts, "mounts")
    components = {component.name: component for component in model.components}
    component = components.get(words[0])
    if component is None:
        return words[0], list(components), "components"
    definition = component.definition
    if isinstance(definition, AssemblyDefinition):
        return _missing(definition, words[1:]) if words[1:] != ["origin"] else None
    if len(words) > 2 and isinstance(definition, PartDefinition):
        return words[1], ["origin"], "components"
    return None
