"""The function `thingc.family(document)`, and the class `RobotFamily` that this function returns."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar, overload

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.suggestions import did_you_mean
from thingc.base.units import Quantity
from thingc.batch.families.batching import Batches, make_batches
from thingc.batch.families.document_numbers import DocumentNumbers
from thingc.batch.families.evaluation import Evaluation
from thingc.batch.families.mjspec_recompile import ModelTemplate
from thingc.batch.families.models import ModelsOfMode
from thingc.batch.families.results import Evaluated, Explanation, NoModel
from thingc.batch.families.search_space import SearchSpace
from thingc.batch.measurements import SITE, TEST, TORQUES, tested_values
from thingc.batch.plans.build_templates import Builds
from thingc.batch.plans.numeric_plan import PlanCache
from thingc.batch.plans.refusals import Refusals
from thingc.batch.results import FamilyError, require_known
from thingc.batch.run_options import as_names, at_least, is_whole
from thingc.batch.values import unit_in
from thingc.batch.variant import Variant
from thingc.documents.spec.assembly import AssemblySpec
from thingc.driver.api import CompileError
from thingc.driver.environment import Options
from thingc.driver.pipeline import UnknownChoice, chosen_consumers
from thingc.driver.session import Session
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.targets.modes_json import emit_alone

if TYPE_CHECKING:
    import mujoco

    from thingc.batch.families.function import FamilyFunction
    from thingc.batch.families.mjx_family import FamilyMjx
    from thingc.batch.families.sensitivity import Sensitivity
    from thingc.batch.planning import Plan
    from thingc.modes import Modes

T = TypeVar("T")


class ModeNames(tuple[str, ...]):
    """The names of all modes of a family of robots.

    Call this object with settings to get a `thingc.modes.Modes`, which switches the robot between modes at run time. Further arguments
    select modes by name (default: all modes). For refused settings, the call returns `NoModel`, which is false in a boolean context. Raises
    `UnknownChoice` for an unknown mode.
    """

    of: Callable[[Mapping[str, Any] | Variant, Sequence[str]], Modes | NoModel]

    def __call__(self, settings: Mapping[str, Any] | Variant, *modes: str) -> Modes | NoModel:
        """Return the modes of the robot with the given settings."""
        return self.of(settings, modes)


class RobotFamily(AbstractContextManager["RobotFamily"]):
    """A family of robots: an assembly or variants document that is compiled in memory for many settings.

    Settings are a mapping from names of parameters, or from paths in the document such as `joints.elbow.limit.upper` or
    `joints.*.dynamics.damping`, to values. A value is a number in SI units, or a string as in documents. Methods also accept a `Variant` of
    a plan as settings. Settings are checked as for `thingc build -p`, and errors in settings are part of the results. The documents are
    read once, so later changes of the documents have no effect.

    Most models and results are computed without a compilation. Some of these models and results are compared with a compilation. If
    `verify` is a number n, the first model or result is compared, and then one in n (0: none). If `verify` is None, the first, second,
    fourth, eighth and so on are compared.

    This class is not thread-safe. After a fork, or after unpickling, each process has its own copy of the family. On exit, the context
    manager ends the worker process that builds parts. All methods that build parts or read their meshes raise `StoreUnusable` if the store
    cannot be used, or if files are missing.
    """

    def __init__(
        self, document: str | os.PathLike[str], *, store: str | None = None, jobs: int = 0, mode: str | None = None,
        verify: int | None = None, compat: Iterable[str] | str | None = None, options: Options | None = None,
    ) -> None:
        """Open a document as a family. `options` replaces `store`, `jobs` and `compat`.

        Raises `CompileError` for a document with errors, `UnknownChoice` for an unknown mode or program, and `FamilyError` if `jobs` or
        `verify` is negative or not an integer.
        """
        at_least(0, jobs=jobs)
        if verify is not None and not is_whole(verify, 0):
            raise FamilyError(f"expected `verify` to be None, 0 (compare none), 1 (all) or N (one in N), found `{verify}`")
        path, store = os.fsdecode(document), None if store is None else os.fsdecode(store)
        options = options or Options(store=store, jobs=jobs, compat=None if compat is None else chosen_consumers(compat))
        self._reopen = partial(RobotFamily, os.path.abspath(path), mode=mode, verify=verify, options=options)
        self._plan = _read_plan(path, options)
        self._session = Session(self._plan.assembly if self._plan is not None else path, options)
        sources = self._session.sources
        report = self._session.report
        if sources is None or report.failed or not isinstance(sources.specs.get(sources.documents.root.relative), AssemblySpec):
            self.close()
            raise CompileError(report.sorted_diagnostics())
        self._root = sources.documents.root
        self._verify = verify
        fixed = {} if self._plan is None else {**self._plan.fixed.parameters, **self._plan.fixed.choices}
        kinds = None if self._plan is None else self._plan.paths.kinds
        fixed_values = {name: value.value if isinstance(value, Quantity) else value for name, value in fixed.items()}
        self._reader = SettingsReader(sources, fixed_values, kinds)
        self._numbers = DocumentNumbers(sources, self._reader, self._plan)
        first = self._session.compile(self._reader.settings(self._reader.read({})))
        if first.assembly is None:
            self.close()
            raise CompileError(first.report.sorted_diagnostics())
        self.name: str = first.assembly.name
        names = self._plan.modes if self._plan is not None else tuple(known.name for known in first.assembly.modes)
        self.modes = ModeNames(names)
        self.modes.of = self._switch_modes
        self.mode = self.modes[0] if mode is None else self._mode_name(mode)
        self._planners: dict[tuple[Any, ...], Any] = {}

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Support copying and pickling of the family. A copied family reads the documents again."""
        return self._reopen, ()

    def close(self) -> None:
        """End the worker process that builds parts, if it is running."""
        self._session.__exit__()

    def __repr__(self) -> str:
        return f"RobotFamily({self.name!r}, modes=[{', '.join(self.modes)}])"

    # --- results and models ---------------------------------------------------------------------------------------------

    @overload
    def evaluate(self, settings: Mapping[str, Any] | Variant, *, tests: bool = False) -> Evaluated: ...
    @overload
    def evaluate(self, settings: Iterable[Mapping[str, Any] | Variant], *, tests: bool = False) -> list[Evaluated]: ...
    def evaluate(self, settings: Any, *, tests: bool = False) -> Evaluated | list[Evaluated]:
        """Compute the results of the robot for one set of settings. For a list of settings, return a list of results.

        The variants document specifies the mode and the pose. For an assembly document, use the mode of the family, and the pose of this
        mode. With `tests`, also run the tests of the assembly document. Errors in settings do not raise exceptions, but are part of the
        results.
        """
        found = list(self._evaluation_of(self.mode).each(map(self._read, as_many(settings)), tests=tests))
        return found[0] if is_single(settings) else found

    def model(
        self, settings: Mapping[str, Any] | Variant, *, mode: str | None = None, visual: bool = True, floor: bool = False,
    ) -> mujoco.MjModel | NoModel:
        """Return a new MuJoCo model of the robot with the given settings.

        For refused settings, return a `NoModel`, which is false in a boolean context. `mode` is the name of the mode of the model. Without
        `visual`, the model does not contain visual geometry. With `floor`, the model includes the floor of its scene. Raises
        `UnknownChoice` for an unknown mode.
        """
        return next(self._models_of(mode, visual, floor).each([self._read(settings)], share=False))

    def models(
        self, many: Iterable[Mapping[str, Any] | Variant], *, mode: str | None = None, share: bool = False, visual: bool = False,
        floor: bool = False,
    ) -> Iterator[mujoco.MjModel | NoModel]:
        """Yield the MuJoCo models of the robot for many settings, in order. At most 128 settings are read ahead.

        With `share`, several yielded models can be the same object. With `share`, a model is valid only until the next model is requested.
        An `MjData` remains valid as long as the yielded model is the same object. If the caller changes a shared model, the change may
        persist in the next model. For refused settings, the iterator yields a `NoModel`. Raises `UnknownChoice` for an unknown mode.
        """
        return self._models_of(mode, visual, floor).each(map(self._read, as_many(many)), share=share)

    def batched(
        self, many: Iterable[Mapping[str, Any] | Variant], *, mode: str | None = None, union: bool = True, floor: bool = False,
    ) -> Batches:
        """Convert many settings to a few MuJoCo models without visual geometry, and to arrays with the values that differ between settings.

        With `union`, settings with different geometry can share a model, which contains the meshes of all these settings. With `floor`,
        models include the floor of their scenes. Raises `UnknownChoice` for an unknown mode.
        """
        models, parsed = self._models_of(mode, False, floor), [self._read(entry) for entry in as_many(many)]
        models.undo_changes()
        return make_batches(models.each(parsed, share=True), (lambda index: models.source(parsed[index][1])) if union else None)

    def write(
        self, settings: Mapping[str, Any] | Variant, folder: str | os.PathLike[str], *, emit: Sequence[str] | str = (),
    ) -> tuple[Diagnostic, ...]:
        """Write a build for these settings into `folder`, with the same bytes as `thingc build`, and return the diagnostics.

        If the settings have errors, the method does not write any files. `emit` contains the names of the targets, or is a string as for
        the option `--emit`. By default, write the targets of the variants document, or else the default targets of a build. The files of
        all targets except `hag`, `glb` and `html` can be computed without a compilation. MuJoCo does not check computed models, unless they
        are compared with a compilation. Raises `UnknownChoice` for an unknown target, `OutputError` for an error of the operating system,
        and `UnexpectedFilesError` if the folder contains other files.
        """
        from thingc.driver.output import OutputError, write_build
        from thingc.geometry.store.local import BlobMissing

        assigned, parsed = self._read(settings)
        if parsed.report is not None:
            return tuple(parsed.report.sorted_diagnostics())
        document_settings = self._reader.settings(parsed, self._numbers.units, self._reader.original_texts(assigned))
        named = emit if isinstance(emit, Iterable) and not isinstance(emit, str) else (emit,)
        builds = self._builds_of(tuple(map(str, named)))
        store = self._session.environment.store
        try:
            files, problems = builds.build(document_settings)
            if files:
                parent, name = os.path.split(os.path.abspath(os.fsdecode(folder)))
                if not name or "\0" in name:
                    raise OutputError(f"`{os.fsdecode(folder)!r}` cannot be a build folder", "use a separate folder")
                write_build(parent, name, files, store, self._root.relative)
        except BlobMissing as fault:
            message = f"the cache `{store.root}` no longer contains the meshes of parts"
            raise OutputError(message, "create the family again") from fault
        return problems

    def _switch_modes(self, settings: Mapping[str, Any] | Variant, modes: Sequence[str]) -> Modes | NoModel:
        """Return a `Modes` object for the robot with the given settings, which switches between modes at run time."""
        from thingc.modes import Modes

        assigned, parsed = self._read(settings)
        if parsed.report is not None:
            return NoModel(settings=assigned, problems=tuple(parsed.report.sorted_diagnostics()))
        chosen = tuple(map(self._mode_name, modes or self.modes))
        builds = self._planner(Builds, modes=chosen, targets=("mjcf",), emit=emit_alone, patience=2)
        files, problems = builds.build(self._reader.settings(parsed))
        described = files.get("modes.json")
        return Modes.parse(described) if isinstance(described, bytes) else NoModel(settings=assigned, problems=problems)

    def adopt(self, settings: Mapping[str, Any] | Variant) -> tuple[Diagnostic, ...]:
        """Write settings into the assembly document, as the command `thingc set` does, and return the diagnostics.

        The document keeps its comments and layout, and values are written in the units of the document. If the settings have errors, the
        method does not change the document. This `RobotFamily` object does not change. Raises `OSError` if the document cannot be read.
        """
        from thingc.driver.edit_document import write_values

        _, parsed = self._read(settings)
        if parsed.report is not None:
            return tuple(parsed.report.sorted_diagnostics())
        nodes = self._numbers.find_nodes(parsed.names)
        document_settings = self._reader.settings(parsed, self._numbers.units or {name: unit_in(node.text) for name, node in nodes.items()})
        values = {**document_settings.parameters, **document_settings.choices}
        environment = self._session.environment
        return write_values(environment.document, values, environment.options).found if values else ()

    def function(
        self, names: Sequence[str] | str, outputs: Sequence[str] | str = ("mass", "centre"), *, mode: str | None = None,
        at: Mapping[str, Any] | None = None,
    ) -> FamilyFunction:
        """Return a differentiable function that maps numbers in the document to results of the robot.

        `names` contains names of parameters, or paths in the document. `outputs` contains names of results of `evaluate`, names of groups
        of results (`centre`, `inertia`, `box`), or positions of mounts in the world (`site:hook`, `site:hook.z`). Alternatively, `outputs`
        contains only values that document tests measure, such as `tests.weight`. `at` contains additional settings, which are fixed. The
        function does not apply the rules of a variants document.

        Raises `FamilyError` for an unknown result or for a name that does not belong to a number, and `UnknownChoice` for an unknown mode.
        """
        from thingc.batch.families.function import FamilyFunction

        results = as_names(outputs=outputs)
        sites = tuple(dict.fromkeys(name[len(SITE):] for name in results if name.startswith(SITE)))
        tests = tuple(dict.fromkeys(name.split(".")[1] for name in results if name.startswith(TEST)))
        self._check_tests(tests, alone=all(name.startswith(TEST) for name in results))
        evaluation = self._evaluation_of(
            self.mode if mode is None else self._mode_name(mode), sites, TORQUES in results, tests, judged=False,
        )
        reopen = partial(self.function, names, outputs, mode=mode, at=at)
        space, by = self._numbers.parameters, as_names(names=names)
        return FamilyFunction(evaluation, self._reader, space, by, results, {} if at is None else at, reopen)

    def sensitivity(
        self, outputs: Sequence[str] | str = ("mass", "centre"), names: Sequence[str] | str = (), *, mode: str | None = None,
        at: Mapping[str, Any] | None = None,
    ) -> list[Sensitivity]:
        """Compute the derivative of each output by each number in `names`.

        `names` contains names of parameters, or paths in the document (default: all numeric parameters of the document). `outputs` has the
        same meaning as in `function`, and can also contain patterns such as `tests.*`. `at` contains further settings, and can also contain
        values of the numbers in `names`. Raises the same errors as `function`, and `FamilyError` for settings without results.
        """
        from thingc.batch.families.sensitivity import results_by_function, sensitivities

        point = dict(at or {})
        numeric = [dimension.name for dimension in self.space if isinstance(dimension.value, float)]
        by = as_names(names=names) or list(self._numbers.find_nodes(numeric))
        kinds = {name: test.kind for name, test in self._numbers.spec.tests.items()}
        fixed = {name: value for name, value in point.items() if name not in by}
        x: dict[str, float] = {}

        def alone(result: str, name: str) -> FamilyFunction:
            return self.function(name, result, mode=mode, at={**fixed, **{other: value for other, value in x.items() if other != name}})

        derivatives: list[Sensitivity] = []
        for results in results_by_function(as_names(outputs=outputs), kinds):
            function = self.function(by, results, mode=mode, at=fixed)
            parsed = self._reader.read({**dict(zip(by, function.start.tolist(), strict=True)), **point})
            x.update(zip(parsed.names, parsed.values, strict=True))
            derivatives += sensitivities(function, x, kinds, self._numbers.find_nodes(by), alone)
        return derivatives

    def mjx(
        self, names: Sequence[str] | str, *, mode: str | None = None, at: Mapping[str, Any] | None = None, floor: bool = False,
        dtype: str = "float64", delays: bool = False,
    ) -> FamilyMjx:
        """Return a pure function that maps numbers in the document to models of MJX (MuJoCo in JAX).

        `names` contains names of parameters, or paths in the document. `at` contains additional settings, which are fixed. With `floor`,
        models include the floor of their scenes. Raises `FamilyError` for a name that does not belong to a number, and for features that
        MJX does not support. With `delays`, models can have delays of drives, which MJX ignores. With `dtype="float64"`, also raises
        `FamilyError` if JAX does not use 64-bit numbers. Raises `UnknownChoice` for an unknown mode.
        """
        from thingc.batch.families.mjx_family import FamilyMjx

        return FamilyMjx(self._models_of(mode, False, floor), self.function(names, (), mode=mode, at=at), dtype, delays)

    @property
    def space(self) -> SearchSpace:
        """The search space of the family: the axes of the variants document, or the parameters of the assembly document."""
        return self._numbers.space

    @overload
    def numbers(self, settings: Mapping[str, Any] | Variant) -> dict[str, float]: ...
    @overload
    def numbers(self, settings: Iterable[Mapping[str, Any] | Variant]) -> list[dict[str, float]]: ...
    def numbers(self, settings: Any) -> dict[str, float] | list[dict[str, float]]:
        """Return the values [SI] of numbers and flags (0 or 1) in the document for the given settings, keyed by name.

        The mapping includes fixed values of the family, and values that expressions compute from the settings. Values that equal the values
        in the document are omitted, unless `settings` contains them. For a list of settings, return a list of mappings.
        """
        found = self._numbers.values([self._read(one)[1] for one in as_many(settings)])
        return found[0] if is_single(settings) else found

    @property
    def variants(self) -> Iterator[Variant]:
        """An iterator over the variants of the variants document, in order. The iterator is empty for an assembly document."""
        return iter(self._plan or ())

    def explain(self, name: str, value: Any = None, *, mode: str | None = None) -> Explanation | NoModel:
        """Explain how the MuJoCo models of a mode depend on one number in the document, and how fast new models are computed.

        `name` is the name of a parameter, or a path in the document. The number is set to `value` and to nearby values. If `value` is None,
        the value in the document is used. Returns `NoModel` if the number cannot be set to `value`.
        """
        models = self._models_of(mode, False)
        settings: dict[str, Any] = {
            match: self._numbers.value_of(match) if value is None else value for match in self._reader.matching_names(str(name))
        }
        parsed = self._reader.read(settings or {name: ""})
        cache: PlanCache[Any] = PlanCache()
        plan = models.plan(parsed, cache) if settings.keys() <= set(parsed.names) else None
        if plan is None:
            reason = "; ".join(dict.fromkeys(cache.reasons.values())) or cache.failure
            if not reason and isinstance(refused := next(models.each([(settings, parsed)], share=False)), NoModel):
                return refused
            return Explanation(name=name, mode=models.mode, way="passes", why=reason or "the setting is not a number in the document")
        if isinstance(plan.template, ModelTemplate):
            return Explanation(name=name, mode=models.mode, way="text" if plan.exchange is None else "parts", why=plan.template.why)
        return Explanation(name=name, mode=models.mode, way="arrays", fields=tuple(sorted(plan.template.written)))

    # --- implementation -------------------------------------------------------------------------------------------------

    def _read(self, settings: Any) -> tuple[Mapping[str, Any], ParsedSettings]:
        if isinstance(settings, Variant):
            settings = {**settings.parameters, **settings.choices}
        return settings if isinstance(settings, Mapping) else {}, self._reader.read(settings)

    def _mode_name(self, mode: str) -> str:
        if mode not in self.modes:
            raise UnknownChoice(f"`{self.name}` has no mode `{mode}`", did_you_mean(str(mode), self.modes, what="modes"))
        return mode

    def _models_of(self, mode: str | None, visual: bool, floor: bool = False) -> ModelsOfMode:
        mode = self.mode if mode is None else self._mode_name(mode)
        return self._planner(ModelsOfMode, mode=mode, refusals=self._refusals_of(mode), visual=visual, floor=floor)

    def _refusals_of(self, mode: str) -> Refusals:
        return self._planner(Refusals, modes=(mode,))

    def _planner(self, kind: Callable[..., T], **options: Any) -> T:
        """Return the planner of the class `kind` with the given options. Create the planner at the first call."""
        key = (kind, *(value for value in options.values() if value is not self._plan))
        known: T = self._planners.get(key) or kind(self._session, self._reader, verify=self._verify, **options)
        self._planners[key] = known
        return known

    def _evaluation_of(
        self, mode: str, sites: tuple[str, ...] = (), torques: bool = True, tests: tuple[str, ...] = (), *, judged: bool = True,
    ) -> Evaluation:
        options = {"sites": sites, "torques": torques, "tests": tests, "judged": judged}
        return self._planner(Evaluation, mode=mode, plan=self._plan, refusals=self._refusals_of(mode), **options)

    def _check_tests(self, names: Sequence[str], *, alone: bool) -> None:
        """Raise `FamilyError` if a test does not exist or has no derivatives, or if tests and other results are requested together.

        `alone` is True if only tests are requested.
        """
        for name in names:
            require_known(name, self._numbers.spec.tests, f"there is no test `{name}`", what="tests")
            if not tested_values(kind := self._numbers.spec.tests[name].kind):
                raise FamilyError(f"`{TEST}{name}` has no derivatives (kind `{kind}`)", f"remove `{TEST}{name}`")
        if names and not alone:
            raise FamilyError(
                f"`{TEST}{names[0]}` cannot be computed together with results that are not tests", "use a separate function for the tests",
            )

    def _builds_of(self, targets: tuple[str, ...]) -> Builds:
        from thingc.targets.registry import parse_targets, unknown

        plan = self._plan
        for _, message, hint in unknown(targets):
            raise UnknownChoice(message, hint)
        chosen = plan.emit if plan is not None and not targets else tuple(parse_targets(targets))
        return self._planner(Builds, modes=plan.chosen_modes if plan is not None else (), targets=chosen)


def _read_plan(path: str, options: Options) -> Plan | None:
    """Return the plan of a variants document, or None for an assembly document. Raises `CompileError` if the document has errors."""
    from thingc.batch.variants_document import read_plan
    from thingc.documents.load.documents import load
    from thingc.documents.workspace import Workspace

    report, workspace = Report(), Workspace.find(os.path.abspath(path), Report())
    documents = None if workspace is None else load(path, workspace, Report(), kinds=("assembly", "variants"))
    if documents is None or documents.root.kind != "variants":
        return None
    plan = read_plan(path, options, report)
    if plan is None or report.failed:
        raise CompileError(report.sorted_diagnostics())
    return plan


def is_single(settings: Any) -> bool:
    """Return True if an argument is not a list of settings: a mapping, a string, or another value that cannot be iterated."""
    return isinstance(settings, (Mapping, str, bytes)) or not isinstance(settings, Iterable)


def as_many(settings: Any) -> Iterable[Any]:
    """Convert an argument, which is a single set of settings or an iterable of several sets, to an iterable."""
    return [settings] if is_single(settings) else settings


def family(
    document: str | os.PathLike[str], *, store: str | None = None, jobs: int = 0, mode: str | None = None, verify: int | None = None,
    compat: Iterable[str] | str | None = None,
) -> RobotFamily:
    """Open an assembly or variants document as a family of robots in memory, and return a `RobotFamily`.

    Args:
        store: The folder of the part cache (None: the user's cache).
        jobs: Number of parts to build in parallel.
        mode: The default mode (None: the first).
        verify: Controls how often a result is compared with a compilation.
        compat: Programs besides MuJoCo that read the models (`["mjx"]`; None: the list of the workspace).
    """
    return RobotFamily(document, store=store, jobs=jobs, mode=mode, verify=verify, compat=compat)
