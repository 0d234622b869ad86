"""Compute the MuJoCo models of a robot in one mode for many settings, in the fastest way that gives the same models as a build."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast
from weakref import WeakKeyDictionary

from msgspec.structs import replace

from thingc.base.diagnostics import Diagnostic, Report
from thingc.base.memo import Memo
from thingc.batch.families.merged_mesh_model import ModelSource
from thingc.batch.families.mjspec_recompile import ModelTemplate, NotInMjSpec, RecompiledSpec
from thingc.batch.families.results import NoModel
from thingc.batch.mesh_files import MountedFiles
from thingc.batch.mujoco_arrays.arrays import TOGETHER, Arrays
from thingc.batch.mujoco_arrays.entries import NotAnArrayEntry
from thingc.batch.mujoco_arrays.equality import different_fields
from thingc.batch.plans.numeric_plan import NumericPlan, PlanCache
from thingc.batch.plans.part_exchange import Exchange
from thingc.batch.plans.planner import Planner
from thingc.batch.plans.refusals import Refusals
from thingc.batch.plans.tape import Tape
from thingc.batch.plans.trace_compilation import TraceResult
from thingc.driver import pipeline
from thingc.driver.settings import ParsedSettings, SettingsReader
from thingc.geometry.store.local import BlobMissing, StoreUnusable
from thingc.targets.mjcf.emit import sources as model_sources

if TYPE_CHECKING:
    import mujoco

    from thingc.driver.pipeline import Compilation
    from thingc.driver.session import Session
    from thingc.targets.artifact import StoredArtifact

CACHED = 32
"""Maximum number of cached compiled models. The cache is useful for training, which uses the same morphologies repeatedly."""

Item = tuple[Mapping[str, Any], ParsedSettings]
WrittenModel = tuple[str, Mapping[str, "StoredArtifact"]]
"""The text of a model with slots for numbers of the tape, and a mapping from file names to meshes."""


class ModelsOfMode(Planner["Arrays | ModelTemplate", "mujoco.MjModel"]):
    """Computes the MuJoCo models of one mode, with or without visual geometry, and with or without the floor.

    Some of the models that a plan computes are compared with compiled models. If `verify` is a number n, the first model of each plan is
    compared, and then one in n. If `verify` is None, the first, second, fourth, eighth and so on are compared.
    """

    wrong = "a different model"

    def __init__(
        self, session: Session, reader: SettingsReader, mode: str, refusals: Refusals, *, visual: bool, floor: bool, verify: int | None,
    ) -> None:
        super().__init__(session, reader, (mode,), refusals, verify=verify)
        self.mode = mode
        self.visual = visual
        self.floor = floor
        self._meshes = MountedFiles()
        self._files: mujoco.MjVfs | None = None
        self._specs: WeakKeyDictionary[ModelTemplate, RecompiledSpec | None] = WeakKeyDictionary()
        self._cached: OrderedDict[tuple[ParsedSettings, bool], mujoco.MjModel] = OrderedDict()

    def each(self, items: Iterable[Item], *, share: bool) -> Iterator[mujoco.MjModel | NoModel]:
        """Yield the models for many settings in the order of the settings.

        With `share`, a model is valid only until the next model is requested.
        """
        waiting: list[tuple[Item, NumericPlan[Any], tuple[float, ...]]] = []
        for item in items:
            planned = None if self._uses_cache(item[1], share) else self.find_plan(item[1])
            if waiting and (planned is None or planned[0] is not waiting[0][1] or len(waiting) == TOGETHER):
                yield from self._together(waiting, share)
                waiting = []
            if planned is None:
                yield self._compile_cached(item, share)
            else:
                waiting.append((item, *planned))
        yield from self._together(waiting, share)

    def undo_changes(self) -> None:
        """Undo the changes of callers to shared models, so that later models do not contain these changes."""
        for cache in self.caches.values():
            for plan in cache.plans:
                if isinstance(plan.template, Arrays):
                    plan.template.undo_changes()
        self._cached = OrderedDict((key, model) for key, model in self._cached.items() if not key[1])

    def _uses_cache(self, parsed: ParsedSettings, share: bool) -> bool:
        """Return True if the compiled model of these settings is cached, and computing a model with a plan would not be faster."""
        return (parsed, share) in self._cached and not any(isinstance(plan.template, Arrays) for plan in self.cache_for(parsed).plans)

    def template_at(self, parsed: ParsedSettings) -> tuple[NumericPlan[ModelTemplate] | None, str]:
        """Create a plan that computes the XML of the model for these settings, and return the plan.

        Also return the reasons why some numbers must be constant. If no plan can be created, return None and the reason.
        """
        cache: PlanCache[Arrays | ModelTemplate] = PlanCache()
        plan = self.plan(parsed, cache, text=True)
        if plan is not None and plan.outputs(parsed.values) is not None:
            return cast(NumericPlan[ModelTemplate], plan), "; ".join(f"`{name}`: {reason}" for name, reason in cache.reasons.items())
        return None, cache.failure or "the compilation takes a different branch for these settings"

    def plan(
        self, parsed: ParsedSettings, cache: PlanCache[Arrays | ModelTemplate], *, text: bool = False,
    ) -> NumericPlan[Arrays | ModelTemplate] | None:
        """Create a plan that computes the same models as a compilation. With `text`, the plan computes only the XML of the models.

        If no plan can be created, store the reason in `cache` and return None.
        """
        first = self.run_passes(parsed)
        if first is None:  # refused settings do not prove that other settings have no plan
            return None

        slower, arrays = "", None

        def finish(trace: TraceResult, exchange: Exchange | None) -> tuple[Sequence[Any], Arrays | ModelTemplate]:
            nonlocal slower, arrays
            if exchange is not None:
                template = ModelTemplate(trace, "; ".join(dict.fromkeys(cache.modelled.values())), exchange.names)
                return template.outputs, template
            template = ModelTemplate(trace)
            assets = self.source(parsed).assets
            if not slower and not text:
                try:
                    arrays = Arrays(template.slotted, template.places, template.plain, assets, self._load)
                    return template.outputs, arrays
                except NotAnArrayEntry as fault:
                    slower = f"MuJoCo uses `{fault.attribute}` at compile time"
            template.why = slower
            return template.outputs, template

        while (plan := self.new_plan(parsed, cache, first, self._write_traced, finish, applies=text)) is None and arrays is not None:
            slower, cache.failure, arrays = f"with arrays, {cache.failure}", None, None
        return plan

    def _write_traced(self, compilation: Compilation, tape: Tape) -> WrittenModel:
        """Write the XML of the model of a traced compilation, with slots instead of traced numbers, and return it with its meshes."""
        request = replace(pipeline.request_of(self.session.environment, compilation, verify=False), memo=Memo())
        tape.writing = True
        texts, assets = model_sources(request, floor=self.floor)
        tape.writing = False
        return texts[self.mode], assets

    def assets(self, traced: WrittenModel) -> Mapping[str, StoredArtifact]:
        """Return the meshes of a traced model."""
        return traced[1]

    def run_passes(self, parsed: ParsedSettings) -> mujoco.MjModel | None:
        """Compile the model of the given settings. Return None if the settings are refused."""
        outcome = self._compile(parsed)
        return None if isinstance(outcome, tuple) else outcome

    def difference(self, computed: mujoco.MjModel, compiled: mujoco.MjModel) -> str:
        """Describe the first field in which two models differ, or return an empty string if they are equal."""
        fields = different_fields(computed, compiled)
        return f"a different `{fields[0]}`" if fields else ""

    def compute(self, plan: NumericPlan[Arrays | ModelTemplate], outputs: tuple[float, ...], parsed: ParsedSettings) -> mujoco.MjModel:
        """Compute a model with a plan."""
        if isinstance(plan.template, ModelTemplate):
            return self._by_text(plan, parsed, outputs)
        return plan.template.put(plan.template.prepare([outputs]), 0)

    def _by_text(self, plan: NumericPlan[Any], parsed: ParsedSettings, outputs: tuple[float, ...]) -> mujoco.MjModel:
        template: ModelTemplate = plan.template
        exchanged = plan.exchange_parts(parsed.values)
        meshes = () if exchanged is None else exchanged.names
        self._mount(template.assets if exchanged is None else exchanged.assets)
        spec = self._specs.get(template)
        if spec is not None:
            try:
                return spec.model(outputs, meshes, self._files)
            except ValueError:  # compile the XML to report the error
                self._specs[template] = None
        text = template.text(outputs, meshes)
        model = self._load(text)
        if template not in self._specs:
            self._specs[template] = self._create_spec(template, text, outputs, meshes, model)
        return model

    def _create_spec(
        self, template: ModelTemplate, text: str, outputs: tuple[float, ...], meshes: Sequence[str], model: mujoco.MjModel,
    ) -> RecompiledSpec | None:
        """Return an `MjSpec` that compiles to the same model as the XML `text`. Return None if no such `MjSpec` can be created."""
        try:
            spec = RecompiledSpec(template, self._add_options(text), meshes, self._files)
            return None if different_fields(spec.model(outputs, meshes, self._files), model) else spec
        except (NotInMjSpec, ValueError):
            return None

    def _together(
        self, waiting: Sequence[tuple[Item, NumericPlan[Any], tuple[float, ...]]], share: bool,
    ) -> Iterator[mujoco.MjModel | NoModel]:
        """Yield the models of consecutive settings that use the same plan."""
        if not waiting:
            return
        plan = waiting[0][1]
        prepared = None
        if isinstance(plan.template, Arrays):
            try:
                prepared = plan.template.prepare([outputs for _, _, outputs in waiting])
            except ValueError:  # MuJoCo rejects one of the models
                for item, _, _ in waiting:
                    yield self._compile_cached(item, share)
                return
        for index, (item, _, outputs) in enumerate(waiting):
            is_due = plan.is_due(self.verify)
            if prepared is None:
                model = self._by_text(plan, item[1], outputs)
            else:
                model = plan.template.put(prepared, index, share=share, exact=is_due)
            if is_due and not self.confirms(model, self.run_passes(item[1]), item[1], self.cache_for(item[1])):
                for wrong, _, _ in waiting[index:]:
                    yield self._compile_cached(wrong, share)
                return
            if share and prepared is None:
                self._add_to_cache(item[1], share, model)
            yield model if share or prepared is None else copy.copy(model)

    def _compile_cached(self, item: Item, share: bool) -> mujoco.MjModel | NoModel:
        """Return the model of the given settings from the cache, or compile it."""
        settings, parsed = item
        known = self._cached.get((parsed, share)) if parsed.report is None else None
        if known is None:
            refused = self.refusals.problems(parsed)
            outcome = self._compile(parsed) if refused is None else refused
            if isinstance(outcome, tuple):
                if refused is None:
                    self.refusals.learn(parsed, outcome)
                return NoModel(settings=settings, problems=outcome)
            known = outcome
        self._add_to_cache(parsed, share, known)
        return known if share else copy.copy(known)

    def _add_to_cache(self, parsed: ParsedSettings, share: bool, model: mujoco.MjModel) -> None:
        """Add a model to the cache.

        Shared models, which callers may change, and models that are copied for callers have separate caches.
        """
        self._cached[parsed, share] = model
        self._cached.move_to_end((parsed, share))
        if len(self._cached) > CACHED:
            self._cached.popitem(last=False)

    # --- through every pass ---------------------------------------------------------------------------------------------

    def _compile(self, parsed: ParsedSettings) -> mujoco.MjModel | tuple[Diagnostic, ...]:
        """Compile the document with the given settings. Return the MuJoCo model, or the diagnostics if the settings are refused."""
        if parsed.report is not None:
            return tuple(parsed.report.sorted_diagnostics())
        compilation = self.session.compile(self.reader.settings(parsed), (self.mode,))
        report: Report = compilation.report
        if report.failed:
            return tuple(report.sorted_diagnostics())
        texts, assets = model_sources(pipeline.request_of(self.session.environment, compilation, verify=False), floor=self.floor)
        if report.failed:
            return tuple(report.sorted_diagnostics())
        self._mount(assets)
        try:
            return self._load(texts[self.mode])
        except ValueError:
            self.session.emit(compilation, ["mjcf"])  # report the error with the reason
            return tuple(report.sorted_diagnostics())

    def source(self, parsed: ParsedSettings) -> ModelSource:
        """For valid settings, return the XML text of the model and the contents of its meshes."""
        compilation = self.session.compile(self.reader.settings(parsed), (self.mode,))
        texts, assets = model_sources(pipeline.request_of(self.session.environment, compilation, verify=False), floor=self.floor)
        self._mount(assets)
        return ModelSource(text=texts[self.mode], assets={file: self._bytes(stored) for file, stored in assets.items()})

    def _mount(self, assets: Mapping[str, StoredArtifact]) -> None:
        self._files = self._meshes.mount(assets, lambda file: self._bytes(assets[file]))

    def _bytes(self, stored: StoredArtifact) -> bytes:
        """Return the content of a mesh file in the store. Raises `StoreUnusable` if the store no longer contains the mesh file."""
        store = self.session.environment.store
        try:
            return store.read(stored.sha256)
        except BlobMissing as fault:
            message = "the meshes of parts are missing; create the family again"
            raise StoreUnusable(store.root, message) from fault

    def _load(self, text: str) -> mujoco.MjModel:
        import mujoco

        return mujoco.MjModel.from_xml_string(self._add_options(text), vfs=self._files)

    def _add_options(self, text: str) -> str:
        # MuJoCo has cached most meshes: starting threads would take longer.
        attributes = 'usethread="false"' if self.visual else 'usethread="false" discardvisual="true"'
        return text.replace("<compiler ", f"<compiler {attributes} ", 1)
