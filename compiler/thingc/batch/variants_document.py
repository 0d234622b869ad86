"""Read a `variants/1` document together with its assembly document. The parser checks all keys and reports all errors together."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from thingc.base.diagnostics import Code, Diagnostic, Note, Report, Severity
from thingc.base.source import SET, Document, Path, ScalarNode, closest, format_path, node_at
from thingc.base.suggestions import Hint, did_you_mean
from thingc.base.units import shorten
from thingc.batch import values
from thingc.batch.axes import MOST_VALUES, Axis, AxisParser
from thingc.batch.planning import Plan, PlanError, Setting, rebase_path
from thingc.batch.rules import Rule, read_rules
from thingc.batch.values import unit_in
from thingc.batch.variant import OUTSIDE
from thingc.documents.expressions.evaluation import ExpressionValue
from thingc.documents.load.documents import load
from thingc.documents.load.paths import find_assembly
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.settable_values import current_choices
from thingc.documents.spec.validation import validate_one
from thingc.documents.spec.variants import AxisSpec, Method, VariantsSpec
from thingc.documents.workspace import Workspace
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options, PartsProvider
from thingc.geometry.record import PartDefinition
from thingc.model.resolve.parameters import AssemblyParameters
from thingc.model.resolve.resolver import Settings, Sources
from thingc.model.resolve.types import AssemblyDefinition


def moving_joints(model: AssemblyDefinition, prefix: str = "") -> Iterator[str]:
    """Yield the paths of all joints that can move, including the joints of nested documents."""
    for name in dict.fromkeys(joint.name.joint for joint in model.joints if joint.kind.moves):
        yield prefix + name
    for component in model.components:
        if isinstance(component.definition, AssemblyDefinition):
            yield from moving_joints(component.definition, f"{prefix}{component.name}/")


def _missing(model: AssemblyDefinition, names: list[str]) -> tuple[str, Mapping[str, Any] | list[str], str] | None:
    """Find the first invalid name in a mount reference, which is split into `names` at the dots.

    Return the invalid name, the names that exist instead, and their kind (`mounts` or `components`), or None if all names are valid. The
    mounts of a part are not checked, because they are unknown before the part is built.
    """
    if len(names) == 1:
        return None if names[0] in model.mounts else (names[0], model.mounts, "mounts")
    components = {component.name: component for component in model.components}
    component = components.get(names[0])
    if component is None:
        return names[0], list(components), "components"
    definition = component.definition
    if isinstance(definition, AssemblyDefinition):
        return _missing(definition, names[1:]) if names[1:] != ["origin"] else None
    if len(names) > 2 and isinstance(definition, PartDefinition):
        return names[1], ["origin"], "components"
    return None


MOST = 1_000_000
"""Maximum number of variants that a document can specify, in the grid or by sampling."""


def plan(document: str, *, options: Options | None = None) -> Plan:
    """Read a `variants/1` document, and return the plan of its variants. This function does not build parts.

    `options` contains options of the compiler, such as the store. Raises `PlanError` if the document has errors.
    """
    report = Report()
    planned = read_plan(document, options or Options(), report)
    if planned is None or report.failed:
        raise PlanError(report.sorted_diagnostics())
    return planned


def read_plan(path: str, options: Options, report: Report, lend: PartsProvider | None = None) -> Plan | None:
    """Read the `variants/1` document at `path`, and return the plan of its variants.

    If the document has errors, add the errors to `report` and return None. `lend` returns a service that builds parts; see `Environment`.
    """
    workspace = Workspace.find(path, report, options.texts)
    documents = load(path, workspace, report, kinds=("variants",), texts=options.texts) if workspace is not None else None
    if workspace is None or documents is None:
        return None
    document = documents.root
    spec = validate_one(document, report)
    if not isinstance(spec, VariantsSpec):
        return None
    assembly = find_assembly(
        spec.assembly, relative_to=document.path, where=document.span(("assembly",)), workspace=workspace, report=report,
    )
    if assembly is None:
        return None
    with Environment(assembly, options, lend) as environment:
        sources = pipeline.read(environment)
        report.diagnostics.extend(environment.report.diagnostics)
        return _Planner(document, spec, environment, sources, report).plan() if sources is not None else None


class _Planner:
    """Converts one `variants/1` document to a plan, and reports errors in the document."""

    def __init__(self, document: Document, spec: VariantsSpec, environment: Environment, sources: Sources, report: Report) -> None:
        self.document = document
        self.spec = spec
        self.environment = environment
        self.sources = sources
        self.root = sources.documents.root
        self.workspace = sources.workspace
        self.report = report
        self.reported: set[tuple[str, str]] = set()
        self.errors_by_settings: dict[tuple[tuple[str, str], ...], list[Diagnostic]] = {}
        self.other_settings: dict[str, str] = {}
        """The settings of the listed variant that is being checked, in addition to its parameters."""

    def plan(self) -> Plan | None:
        assembly = self.sources.specs.get(self.root.relative)
        model = pipeline.model(self.environment, self.sources, Settings(), self.report)
        if not isinstance(assembly, AssemblySpec) or model is None or not self.grid_fits():
            return None
        declared = AssemblyParameters(self.sources.documents, self.sources.specs, self.workspace)
        parameter_values = declared.values
        paths = values.read_paths(self.spec, self.sources.documents, parameter_values)
        reader = AxisParser(self.document, declared, self.report, paths, self.fits)
        axes, parameters = self.parameters(reader)
        choice_axes, choices = self.choices()
        fixed = Setting(name=None, parameters=parameters, choices=choices)
        listed = self.read_listed(reader, fixed)
        method, sample_count, seed = self.sample(reader)
        ranges = [reader.range(name, raw) for name, raw in (self.spec.sample.ranges if self.spec.sample else {}).items()]
        drawn_axes = [axis for axis in ranges if axis is not None]
        rules = read_rules(
            self.document, self.spec.keep, {**parameter_values, **paths.kinds}, [name.replace("/", ".") for name in moving_joints(model)],
            reach=self.spec.reach is not None, report=self.report,
        )
        emit = self.targets()
        self.check_names(model)
        self.check_margin(model, rules)
        if self.report.failed:
            return None
        return Plan(
            document=self.document.path, relative=self.document.relative, sha256=self.document.sha256,
            name=self.spec.name, assembly=self.root.path, assembly_relative=self.root.relative,
            assembly_spec=assembly, model=model, workspace=self.workspace, own=parameter_values, paths=paths,
            written_in=dict(self.units((*parameter_values, *paths.kinds))),
            own_choices=current_choices(assembly), fixed=fixed, listed=listed,
            axes=(*drawn_axes, *axes, *choice_axes), method=method, drawn=sample_count, seed=seed, rules=tuple(rules),
            modes=tuple(self.spec.modes or (mode.name for mode in model.modes)), chosen_modes=tuple(self.spec.modes),
            pose=self.spec.pose, reach=(self.spec.reach.of, self.spec.reach.from_) if self.spec.reach is not None else None,
            emit=emit, inputs=self.inputs(), layout=self.spec.layout, notes=tuple(self.report.sorted_diagnostics()),
        )

    # --- axes and settings ----------------------------------------------------------------------------------------

    def parameters(self, reader: AxisParser) -> tuple[list[Axis], dict[str, ExpressionValue]]:
        """Return the axes of parameters with several values, and the parameters whose value is the same for all variants."""
        axes: list[Axis] = []
        fixed: dict[str, ExpressionValue] = {}
        for name, raw in self.spec.parameters.items():
            axis = reader.axis(name, raw)
            if axis is not None and len(axis.values) == 1:
                fixed[name] = axis.values[0]
            elif axis is not None:
                axes.append(axis)
        return axes, fixed

    def units(self, names: Iterable[str]) -> Iterator[tuple[str, str]]:
        """Yield each parameter or path with its unit.

        The unit is specified by the variants document, or else by the assembly document.
        """
        for name in names:
            value_path = ("parameters", name) if "." not in name else tuple(name.split("."))
            axis = ("parameters", name)
            places: tuple[tuple[Document, Path], ...] = (
                (self.document, axis), (self.document, (*axis, 0)), (self.document, (*axis, "from")),
                (self.document, ("sample", "ranges", name, 0)), (self.root, value_path), (self.root, (*value_path, "value")),
            )
            texts = (node.text for document, path in places if isinstance(node := node_at(document.tree, path), ScalarNode))
            unit = next((unit for text in texts if (unit := unit_in(text))), "")
            if unit:
                yield name, unit

    def choices(self) -> tuple[list[Axis], dict[str, str]]:
        """Return the axes of choices with several values, and the choices that are the same for all variants."""
        axes: list[Axis] = []
        fixed: dict[str, str] = {}
        for path, raw in self.spec.choices.items():
            if raw == []:
                self.error(Code.VARIANT_CHOICE, f"`{path}` has no choices", ("choices", path), "write at least one")
            texts: dict[str, Path] = {}
            for index, text in enumerate(raw if isinstance(raw, list) else [raw]):
                at: Path = ("choices", path, index) if isinstance(raw, list) else ("choices", path)
                if (value := self.choice_value(path, text, at)) is not None:
                    texts[value] = at
            sound = [text for text, at in texts.items() if self.is_valid_choice(path, text, at)]
            if len(sound) == 1:
                fixed[path] = sound[0]
            elif sound:
                axes.append(Axis(key=path, choice=True, values=tuple(sound)))
        return axes, fixed

    def choice_value(self, path: str, text: str, at: Path) -> str | None:
        """Return the value of a choice for the assembly document. Report a missing document as an error, and return None."""
        if _key(path) == "assembly" and find_assembly(
            text, relative_to=self.document.path, where=self.document.span(at), workspace=self.workspace, report=self.report,
        ) is None:
            return None
        return self.rebase_choice(path, text)

    def rebase_choice(self, path: str, text: str) -> str:
        """Convert the path of a file or document that a choice selects, so that it is relative to the assembly document.

        Other values of a choice are returned unchanged.
        """
        return rebase_path(text, self.document.relative, self.root.relative) if _key(path) in ("assembly", "file") else text

    def is_valid_choice(self, path: str, text: str, at: Path) -> bool:
        """Return whether `text` is a valid value of the choice at `path`. Report an invalid value as an error at the key path `at`.

        A value is also valid if it is only valid in an assembly that another choice selects for an enclosing component.
        """
        errors = self.errors_of({path: text})
        for diagnostic in errors:
            if diagnostic.code is Code.CHOICE_OPTION:
                self.report_once(Code.VARIANT_CHOICE, diagnostic, path, at, f"choices.{path}", key=False)
        return not any(diagnostic.code is Code.CHOICE_OPTION for diagnostic in errors)

    def fits(self, path: str, text: str, at: Path) -> bool:
        """Return whether `text` is a valid value at `path` in the assembly document. Report an invalid value or unknown path as an error.

        `at` is the key path of the value in the variants document. A value in `list` is checked together with all settings of its variant.
        Any other value is first checked without other settings. A value that is invalid alone is checked again, together with the first
        values of all other settings.
        """
        if at[0] == "list":
            entry_texts = self.texts({name: (*at[:-1], name) for name in self.spec.list_[int(at[1])].parameters})
            entry = {**{name: value for name, value in entry_texts.items() if "." in name}, path: text}
            parameters = {name: value for name, value in entry_texts.items() if "." not in name}
            errors = [
                value for value in self.added_errors(entry, {**self.other_settings, **parameters})
                if closest(entry, (value.path or "").removeprefix(SET).partition("=")[0]) == path
            ]
        else:
            errors = self.errors_of({path: text})
            if errors:
                errors = self.added_errors({path: text}, {name: first for name, first in self.first_texts().items() if name != path})
        for diagnostic in errors:
            astray = diagnostic.code is Code.CHOICE_OPTION and "=" not in (diagnostic.path or "")
            where = at[: at.index(path) + 1] if astray else at
            self.report_once(Code.VARIANT_VALUE, diagnostic, path, where, format_path(where), key=astray)
        return not errors

    def texts(self, places: Mapping[str, Path]) -> dict[str, str]:
        """Return the source texts of scalar values in the variants document. `places` maps names to the key paths of the values.

        Values that are not scalars are omitted.
        """
        nodes = ((name, node_at(self.document.tree, place)) for name, place in places.items())
        return {name: node.text for name, node in nodes if isinstance(node, ScalarNode)}

    def first_texts(self) -> dict[str, str]:
        """Return the source text of the first value of each parameter and path.

        A setting can have a fixed value, values on an axis, or sampled values.
        """
        first: dict[str, Path] = {}
        for name, raw in self.spec.parameters.items():
            within: Path = (0,) if isinstance(raw, list) else ("from",) if isinstance(raw, AxisSpec) else ()
            first[name] = ("parameters", name, *within)
        first.update({name: ("sample", "ranges", name, 0) for name in (self.spec.sample.ranges if self.spec.sample is not None else {})})
        return self.texts(first)

    def added_errors(self, texts: Mapping[str, str], base: Mapping[str, str]) -> list[Diagnostic]:
        """Return the errors that the settings `texts` add to the errors of the settings `base`."""
        errors = self.errors_of({**base, **texts})
        others = self.errors_of(base) if errors else []
        return [error for error in errors if error not in others]

    def errors_of(self, texts: Mapping[str, str]) -> list[Diagnostic]:
        """Resolve the assembly with the settings `texts`, and return the errors that these settings cause.

        If another choice selects an enclosing assembly, also try its values, and return no errors if one attempt succeeds. The result omits
        errors of the assembly itself, and invalid values of parameters, which `AxisParser` reports.
        """
        known = self.errors_by_settings.get(key := tuple(texts.items()))
        if known is not None:
            return known
        parameters = {name: text for name, text in texts.items() if "." not in name}
        path_settings = {path: text for path, text in texts.items() if "." in path}
        found: list[Diagnostic] = []
        for enclosing in self.enclosing_choices(path_settings):
            trial = Report()
            pipeline.model(self.environment, self.sources, Settings(parameters=parameters, choices={**enclosing, **path_settings}), trial)
            errors = [
                error for error in trial.diagnostics
                if error.severity is Severity.ERROR and error.code is not Code.PARAMETER_OPTION and error not in self.report.diagnostics
            ]
            if not errors:
                found = []
                break
            found = found or errors
        unknown_paths = {path for path in texts if any(error.path == f"{SET}{path}" for error in found)}
        remaining = {name: text for name, text in texts.items() if name not in unknown_paths}
        if unknown_paths and remaining:  # if a path is unknown, no setting is applied
            found = [*found, *(error for error in self.errors_of(remaining) if error not in found)]
        self.errors_by_settings[key] = found
        return found

    def report_once(self, code: Code, diagnostic: Diagnostic, path: str, at: Path, display_path: str, *, key: bool) -> None:
        """Report an error that a setting causes in the assembly, at the location of the setting in the variants document.

        For each path, the same message is reported only once.
        """
        if (path, diagnostic.message) in self.reported:
            return
        self.reported.add((path, diagnostic.message))
        notes = [*diagnostic.notes, Note(message="defined here in the assembly", span=diagnostic.span)]
        self.report.add(
            code, diagnostic.message, self.document.span(at, key=key), help=diagnostic.help, path=display_path,
            notes=[note for note in notes if note.span is not None],
        )

    def enclosing_choices(self, paths: Iterable[str]) -> Iterator[dict[str, str]]:
        """Yield an empty mapping, and then a mapping with each single choice that selects an assembly for a component on one of `paths`."""
        yield {}
        for other, raw in self.spec.choices.items():
            inside = other.removesuffix("assembly") + "components."
            if other.endswith(".assembly") and any(path.startswith(inside) for path in paths):
                for text in raw if isinstance(raw, list) else [raw]:
                    yield {other: self.rebase_choice(other, text)}

    def read_listed(self, reader: AxisParser, fixed: Setting) -> tuple[Setting, ...]:
        """Return the settings of all variants that the document lists explicitly, and report invalid settings."""
        name_indices: dict[str, int] = {}
        settings: list[Setting] = []
        for index, entry in enumerate(self.spec.list_):
            at: Path = ("list", index)
            error_count = len(self.report.diagnostics)
            chosen = dict(fixed.choices)
            for path, text in entry.choices.items():
                named = self.choice_value(path, text, (*at, "choices", path))
                if named is not None and self.is_valid_choice(path, named, (*at, "choices", path)):
                    chosen[path] = named
            self.other_settings = {**{name: text for name, text in self.first_texts().items() if name in fixed.parameters}, **chosen}
            values: dict[str, ExpressionValue] = dict(fixed.parameters)
            for name, raw in entry.parameters.items():
                value = reader.value(name, raw, (*at, "parameters", name))
                if value is not None:
                    values[name] = value
            if entry.name is not None and (first := name_indices.setdefault(entry.name, index)) != index:
                note = Note(message="the other variant is defined here", span=self.document.span(("list", first, "name")))
                message, help = f"two variants are named `{entry.name}`", "rename one of the two variants"
                self.error(Code.NAME_CLASH, message, (*at, "name"), help, [note])
            setting = Setting(name=entry.name, parameters=values, choices=chosen)
            duplicate = next((k for k, other in enumerate(settings) if (other.parameters, other.choices) == (values, chosen)), None)
            if duplicate is not None and len(self.report.diagnostics) == error_count:
                self.report.warn(
                    Code.DUPLICATE_VARIANT, "the variant is listed twice", self.document.span(at),
                    help="remove one of the two variants from the list",
                    path=format_path(at), notes=[Note(message="also listed here", span=self.document.span(("list", duplicate)))],
                )
            settings.append(setting)
        return tuple(settings)

    def sample(self, reader: AxisParser) -> tuple[Method | None, int, int]:
        """Return the sampling method, the number of samples and the seed.

        The sampling method is None if the document does not specify a sample.
        """
        sample = self.spec.sample
        if sample is None:
            return None, 0, 0
        count = reader.count(sample.count, ("sample", "count"), least=1, most=MOST)
        seed = reader.count(sample.seed, ("sample", "seed"), least=0, most=2**31 - 1)
        settings = (*self.spec.parameters.values(), *self.spec.choices.values())
        if not sample.ranges and not any(isinstance(raw, AxisSpec) or isinstance(raw, list) and len(raw) > 1 for raw in settings):
            self.error(Code.VARIANT_VALUE, "`sample` has no values to draw from", ("sample",), "add `ranges: {NAME: [smallest, largest]}`")
        return sample.method, count or 0, seed or 0

    def grid_fits(self) -> bool:
        """Return True if the grid of variants contains at most `MOST` variants. A grid with more variants is reported as an error.

        The size of the grid is checked before the values of any axis are computed.
        """
        axes = [(key, raw) for key in ("parameters", "choices") for raw in getattr(self.spec, key).values()]
        sized = [(key, raw.count if isinstance(raw, AxisSpec) else len(raw)) for key, raw in axes if isinstance(raw, (AxisSpec, list))]
        sizes = [(key, size) for key, size in sized if isinstance(size, int) and 1 < size <= MOST_VALUES]
        count = math.prod(size for _, size in sizes)
        if self.spec.sample is not None or count <= MOST:
            return True
        product = " x ".join(str(size) for _, size in sizes) if len(sizes) < 10 else f"{len(sizes)} axes"
        message = f"the number of variants ({product} = {count}) exceeds the maximum ({MOST})"
        self.error(Code.VARIANT_VALUE, message, (sizes[0][0],), "use fewer values, or draw variants with `sample:`", key=True)
        return False

    # --- targets and names --------------------------------------------------------------------------------------------

    def targets(self) -> tuple[str, ...]:
        """Return the targets under `emit` in the document, in the order in which a build writes them. Report unknown targets as errors."""
        from thingc.targets.registry import parse_targets, unknown

        for index, message, hint in unknown(self.spec.emit):
            self.error(Code.VARIANT_TARGET, message, ("emit", index), hint)
        return parse_targets(self.spec.emit) if self.spec.emit else ()

    def check_names(self, model: AssemblyDefinition) -> None:
        """Report modes, poses and mounts in the variants document that do not exist in the assembly."""
        spec = self.spec
        modes, poses = [mode.name for mode in model.modes], [pose.name for pose in model.poses]
        for index, name in enumerate(spec.modes):
            if name not in modes:
                hint = did_you_mean(name, modes, what="modes")
                self.error(Code.UNKNOWN_MODE, f"`{model.name}` has no mode `{name}`", ("modes", index), hint)
        if spec.pose is not None and spec.pose not in poses:
            hint = did_you_mean(spec.pose, poses, what="poses")
            self.error(Code.UNKNOWN_POSE, f"`{model.name}` has no pose `{spec.pose}`", ("pose",), hint)
        if spec.reach is None or any(path.endswith(".assembly") for path in spec.choices):
            return
        for key, text in (("of", spec.reach.of), ("from", spec.reach.from_)):
            missing = _missing(model, text.split("."))
            if missing is not None:
                name_part, known, kind = missing
                code = Code.UNKNOWN_COMPONENT if kind == "components" else Code.UNKNOWN_MOUNT
                message = f"the assembly has no {kind.removesuffix('s')} `{shorten(name_part)}`"
                self.error(code, message, ("reach", key), did_you_mean(name_part, known, what=kind))

    def check_margin(self, model: AssemblyDefinition, rules: Sequence[Rule]) -> None:
        """Report rules on the torque margin if the robot has closed loops in the mode of the results.

        The distribution of loads in closed loops is unknown, so such a robot has no torque margin.
        """
        mode_name = self.spec.modes[0] if self.spec.modes else model.modes[0].name
        mode = next((mode for mode in model.modes if mode.name == mode_name), None)
        if mode is None or not (mode.holds or any(joint.loop for joint in model.joints)):
            return
        message = f"`torque_margin` is not available in mode `{mode.name}`, which has closed loops"
        for index, expression in enumerate(self.spec.keep):
            if any(rule.expression is expression and "torque_margin" in rule.names.values() for rule in rules):
                self.error(Code.RESULT, message, ("keep", index), "put another mode first under `modes`, or remove the rule")

    # --- inputs ------------------------------------------------------------------------------------------------------

    def inputs(self) -> dict[str, str]:
        """Return the digests of all documents and code files on which the plan depends.

        The keys of the mapping are paths. Paths inside the workspace are relative to the workspace.
        """
        from thingc.driver.up_to_date import state_of

        digests = {
            path if os.path.lexists(os.path.join(self.workspace.root, path)) else OUTSIDE + path: document.sha256  # a document of a package
            for path, document in self.sources.documents.by_path.items()
        }
        for path in sorted(self.environment.parts.inputs):
            name = self.workspace.relative(path) if self.workspace.contains(path) else OUTSIDE + os.path.basename(path)
            state = state_of(path)
            if state is not None:
                digests.setdefault(name, state)
        return dict(sorted(digests.items()))

    def error(
        self, code: Code, message: str, path: Path, help: Hint | None = None, notes: Sequence[Note] = (), *, key: bool = False,
    ) -> None:
        """Report an error at the location of a value in the variants document, or of its key."""
        self.report.add(code, message, self.document.span(path, key=key), help=help, path=format_path(path), notes=notes)


def _key(path: str) -> str:
    """Return the last key in the path of a choice, such as `part`, `file`, `assembly` or `material`."""
    return path.rpartition(".")[2]
