"""Plan the variants of a `variants/1` document: compute the settings and the id of each variant, in order.

All settings are checked before the first variant is built.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
import posixpath
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from graphlib import TopologicalSorter
from typing import Any

from thingc.base.diagnostics import Diagnostic
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.one_line_repr import OneLineStruct
from thingc.base.units import Dimension, Quantity
from thingc.batch.axes import Axis
from thingc.batch.rules import Rule
from thingc.batch.values import Paths, identity
from thingc.batch.variant import Variant
from thingc.documents.expressions.evaluation import ExpressionValue, evaluate, plain
from thingc.documents.expressions.terms import Expression, ExpressionError
from thingc.documents.expressions.value_text import text_of
from thingc.documents.spec.assembly import AssemblySpec, ParameterSpec
from thingc.documents.spec.variants import Method
from thingc.documents.workspace import Workspace
from thingc.driver.api import CompileError
from thingc.model.resolve.types import AssemblyDefinition

BLOCK = 256
"""Number of sample points that are computed in a single step."""


def points(method: Method, dimensions: int, count: int, seed: int) -> Iterator[tuple[float, ...]]:
    """Yield `count` sample points in the unit cube [0, 1), each with `dimensions` coordinates.

    The method `sobol` uses `scipy.stats.qmc.Sobol(d, scramble=True, rng=seed)`, `lhs` uses `scipy.stats.qmc.LatinHypercube(d, rng=seed)`,
    and `uniform` uses `numpy.random.default_rng(seed).random((count, d))`, row by row. The points of a Latin hypercube depend on each
    other, so all points are computed in a single step. For other methods, points are computed in blocks.
    """
    import numpy
    from scipy.stats import qmc

    if dimensions == 0:
        yield from (() for _ in range(count))
        return
    size = BLOCK
    match method:
        case "lhs":
            size, draw = max(count, 1), qmc.LatinHypercube(dimensions, rng=seed).random
        case "sobol":
            draw = qmc.Sobol(dimensions, scramble=True, rng=seed).random
        case "uniform":
            generator = numpy.random.default_rng(seed)

            def draw(size: int) -> Any:
                return generator.random((size, dimensions))
    for start in range(0, count, size):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about counts that are not a power of 2, see docs/variants.md
            block = draw(min(size, count - start))
        for row in block:
            yield tuple(row.tolist())


class PlanError(CompileError):
    """Raised if a variants document has errors."""


class Setting(FrozenStruct):
    """The settings that the document specifies for one variant. `name` is the name of the variant in the document, if specified."""

    name: str | None
    parameters: Mapping[str, ExpressionValue]
    choices: Mapping[str, str]


class Plan(OneLineStruct, dict=True):
    """The variants that a variants document specifies, in order.

    Iterating over the plan computes the variants one by one, with the same result in each iteration.

    Attributes:
        document: The absolute path of the variants document. `assembly` is the absolute path of the assembly document. `relative` and
            `assembly_relative` are the paths of both documents, relative to the workspace.
        sha256: The SHA-256 of the variants document.
        fixed: The settings that are the same for all variants.
        listed: The variants that the document lists explicitly.
        axes: The axes of the grid of variants. If the document specifies a sampling `method`, the axes from which `drawn` variants are
            sampled.
        own: The values of all parameters in the assembly document. `paths` contains the values that are set by path.
        written_in: The units of `own` and `paths` in the documents.
        own_choices: The values in the assembly document at the paths of choices.
        modes: The modes to build, never empty. `chosen_modes` contains the modes that the document specifies.
        emit: The targets, in the order of a build.
        inputs: The digests (see `up_to_date.state_of`) of all files on which the plan depends, keyed by their paths in the workspace.
        layout: The layout of the batch, `folders` or `packed`, or None if the document does not specify it.
    """

    document: str
    relative: str
    sha256: str
    name: str
    assembly: str
    assembly_relative: str
    assembly_spec: AssemblySpec
    model: AssemblyDefinition
    workspace: Workspace
    own: Mapping[str, ExpressionValue]
    paths: Paths
    written_in: Mapping[str, str]
    own_choices: Mapping[str, str]
    fixed: Setting
    listed: tuple[Setting, ...]
    axes: tuple[Axis, ...]
    method: Method | None
    drawn: int
    seed: int
    rules: tuple[Rule, ...]
    modes: tuple[str, ...]
    chosen_modes: tuple[str, ...]
    pose: str | None
    reach: tuple[str, str] | None
    emit: tuple[str, ...]
    inputs: Mapping[str, str]
    layout: str | None = None
    notes: tuple[Diagnostic, ...] = ()

    def __iter__(self) -> Iterator[Variant]:
        return self.unfinished_variants(b"")

    def unfinished_variants(self, done: Sequence[int]) -> Iterator[Variant]:
        """Yield all variants that are not finished. `done` contains a flag for each index that is true for a finished variant.

        Skipping finished variants needs almost no computation.
        """
        width = len(str(max(self.count - 1, 0)))
        rules = [rule for rule in self.rules if not rule.needs_results]
        for index, id, setting, parameters, choices in self._unique(done):
            values = self.values(setting.parameters)
            texts = {name: text_of(parameters[name], self.written_in.get(name, "")) for name in sorted(parameters)}
            failed = next((rule.text for rule in rules if not _holds(rule, values)), None)
            yield Variant(
                index=index, id=id, name=setting.name or f"{self.name}_{index:0{width}d}",
                parameters={name: text for name, text in texts.items() if "." not in name},
                choices=dict(sorted({**choices, **{path: text for path, text in texts.items() if "." in path}}.items())),
                values={name: plain(value) for name, value in values.items()}, failed=failed,
            )

    @cached_property
    def count(self) -> int:
        """The number of variants in the plan. Variants with equal settings are counted once."""
        if self.method is None and not self.listed:
            return math.prod(len(axis.values) for axis in self.axes)
        if self.method is not None and not self.listed and any(axis.range is not None and not axis.whole for axis in self.axes):
            return self.drawn
        return sum(1 for _ in self._unique(b""))

    @property
    def written(self) -> int:
        """The number of variants that the document specifies, including variants with equal settings."""
        if self.method is not None:
            return len(self.listed) + self.drawn
        return len(self.listed) + (math.prod(len(axis.values) for axis in self.axes) if self.axes or not self.listed else 0)

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of the content of the variants document that determines the variants and their files.

        Digests of other files, such as part files, are in `inputs`.
        """
        described = {
            "name": self.name, "assembly": self.assembly_relative, "fixed": _plain(self.fixed),
            "listed": [_plain(item) for item in self.listed],
            "axes": [
                [axis.key, axis.choice, [plain(item) for item in axis.values], [plain(item) for item in axis.range or ()], axis.whole]
                for axis in self.axes
            ],
            "sample": [self.method, self.drawn, self.seed], "rules": [rule.text for rule in self.rules],
            "modes": self.chosen_modes, "pose": self.pose, "reach": self.reach, "emit": self.emit,
        }
        return hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()

    @cached_property
    def dimensions(self) -> dict[str, Dimension]:
        """The physical dimension of each numeric parameter, and of each number that is set by path."""
        return {name: value.dimension for name, value in self.kinds.items() if isinstance(value, Quantity)}

    @cached_property
    def kinds(self) -> dict[str, ExpressionValue]:
        """An example value for each parameter and each value that is set by path. Valid values have the same type."""
        return {**self.own, **self.paths.kinds}

    @property
    def units(self) -> dict[str, str]:
        """The SI unit of each numeric parameter, and of each number that is set by path."""
        return {name: dimension.symbol for name, dimension in self.dimensions.items()}

    def folder_in(self, output: str | None) -> str:
        """Return the absolute path of the folder of the batch inside `output`.

        By default, `output` is the build folder of the workspace.
        """
        return os.path.join(os.path.abspath(output or os.path.join(self.workspace.root, self.workspace.build)), self.name)

    def choices_of(self, variant: Variant) -> dict[str, str | None]:
        """Return a mapping from the path of each choice to the value of the variant at this path."""
        return {path: variant.choices.get(path, self.own_choices.get(path)) for path in self.choice_paths}

    @cached_property
    def choice_paths(self) -> tuple[str, ...]:
        """The paths of all choices in the document, in order."""
        settings = (self.fixed, *self.listed)
        paths = [*(path for setting in settings for path in setting.choices), *(axis.key for axis in self.axes if axis.choice)]
        return tuple(dict.fromkeys(paths))

    def values(self, given: Mapping[str, ExpressionValue]) -> dict[str, ExpressionValue]:
        """Compute all parameters of the assembly and all values that the plan sets by path, if the values in `given` are set.

        Expressions that cannot be evaluated are omitted.
        """
        values: dict[str, ExpressionValue] = {}
        known = {**self._literals, **given}
        for name, expression in self._order:
            if name in known:
                values[name] = known[name]
            elif expression is not None:
                with suppress(ExpressionError):
                    values[name] = evaluate(expression, values)
        return {name: values[name] for name in self.kinds if name in values}

    @cached_property
    def _order(self) -> tuple[tuple[str, Expression | None], ...]:
        """The names of all parameters and paths, each with its expression, or with None if its value is not an expression.

        Each name follows all parameters that its expression uses.
        """
        raw = {name: entry.value if isinstance(entry, ParameterSpec) else entry for name, entry in self.assembly_spec.parameters.items()}
        expressions = {name: entry for name, entry in raw.items() if isinstance(entry, Expression)}
        uses = {name: [use.name for use in expressions[name].names] if name in expressions else () for name in raw}
        ordered = [(name, expressions.get(name)) for name in TopologicalSorter(uses).static_order() if name in raw]
        return (*ordered, *((path, self.paths.expressions.get(path)) for path in self.paths.kinds))

    @cached_property
    def document_values(self) -> dict[str, ExpressionValue]:
        """The values in the assembly document of all parameters, and of all values that the plan sets by path."""
        return {**self.own, **self.paths.own}

    @cached_property
    def _literals(self) -> dict[str, ExpressionValue]:
        """The values in the assembly document that are not expressions. Settings that equal these values are omitted from a variant."""
        expressions = {name for name, expression in self._order if expression is not None}
        return {name: value for name, value in self.document_values.items() if name not in expressions}

    def _settings(self) -> Iterator[Setting]:
        """Yield the settings of all variants that the document specifies, in order. The method can yield equal settings several times."""
        yield from self.listed
        if self.method is not None:
            for point in points(self.method, len(self.axes), self.drawn, self.seed):
                yield self._setting(axis.draw(u) for axis, u in zip(self.axes, point, strict=True))
        elif self.axes or not self.listed:
            for values in itertools.product(*(axis.values for axis in self.axes)):
                yield self._setting(values)

    def _setting(self, values: Iterable[ExpressionValue]) -> Setting:
        parameters, choices = dict(self.fixed.parameters), dict(self.fixed.choices)
        for axis, value in zip(self.axes, values, strict=True):
            if axis.choice:
                choices[axis.key] = str(value)
            else:
                parameters[axis.key] = value
        return Setting(name=None, parameters=parameters, choices=choices)

    def _unique(self, done: Sequence[int]) -> Iterator[tuple[int, str, Setting, dict[str, ExpressionValue], dict[str, str]]]:
        """Yield the distinct settings of all variants that are not `done`, with the index and the id of each variant.

        Settings that equal the values in the assembly document are omitted. Points of a grid, and points with a coordinate that is sampled
        from an interval, are always distinct. For settings that can be equal, only their ids are stored, so long plans need little memory.
        """
        listed = len(self.listed)
        discrete = self.method is not None and all(axis.range is None or axis.whole for axis in self.axes)
        literals = {name: plain(value) for name, value in self._literals.items()}
        seen: set[str] = set()
        index = -1
        for number, setting in enumerate(self._settings()):
            if not listed and not discrete and index + 1 < len(done) and done[index + 1]:
                index += 1
                continue
            parameters = {
                name: value for name, value in setting.parameters.items()
                if name not in literals or plain(value) != literals[name]
            }
            choices = {path: text for path, text in setting.choices.items() if self.own_choices.get(path) != text}
            id = identity(self.assembly_relative, parameters, choices)
            if id in seen:
                continue
            index += 1
            if number < listed or discrete:
                seen.add(id)
            if index >= len(done) or not done[index]:
                yield index, id, setting, parameters, choices

    def command(self, variant: Variant) -> list[str]:
        """Return the command line that builds a single variant. The command must be run in the folder of the workspace."""
        arguments = ["thingc", "build", self.assembly_relative]
        for name, text in variant.parameters.items():
            arguments += ["-p", f"{name}={text}"]
        for path, text in variant.choices.items():
            arguments += ["--set", f"{path}={text}"]
        for mode in self.chosen_modes:
            arguments += ["--mode", mode]
        return [*arguments, *(argument for target in self.emit for argument in ("--emit", target))]


def _holds(rule: Rule, values: Mapping[str, ExpressionValue]) -> bool:
    """Return True if a variant satisfies a rule on parameters.

    Also return True if the rule cannot be evaluated, because the build reports this error.
    """
    try:
        return rule.holds(values, {})
    except (ExpressionError, KeyError):
        return True


def _plain(setting: Setting) -> list[object]:
    return [setting.name, {name: plain(value) for name, value in sorted(setting.parameters.items())}, dict(sorted(setting.choices.items()))]


def rebase_path(text: str, source: str, target: str) -> str:
    """Convert a path that is relative to the document `source` to a path that is relative to the document `target`.

    Both documents are specified by their paths in the workspace.
    """
    place = posixpath.normpath(posixpath.join(posixpath.dirname(source), text.replace(os.sep, "/")))
    return posixpath.relpath(place, posixpath.dirname(target) or ".")
