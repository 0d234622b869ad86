"""Create the instances of parts, links and frames. Each component of a definition is processed once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from thingc.base.diagnostics import Code, Note, first_notes, make_notes
from thingc.base.inertia import physical_fault
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE
from thingc.base.source import Origin, line_of
from thingc.base.suggestions import Hint, did_you_mean, nearest
from thingc.geometry.print_slices import SliceFailure
from thingc.geometry.record import ImpureInputs, MountRecord, PartDefinition, PartFailure, PartRecord, PartWarning
from thingc.model.assembly.hag import FRAME, Definition
from thingc.model.assembly.mass import NOTHING, MassResult, component_mass, material_of, slicing_of
from thingc.model.assembly.report import LinkReport, written_at
from thingc.model.assembly.shape_links import Meshes, MissingDensity, list_shapes, warn_far, weigh_shapes
from thingc.model.assembly.types import PartInstance, Unit
from thingc.model.resolve.bom import entry_of
from thingc.model.resolve.link_definition import LinkDefinition, mesh_files_of
from thingc.model.resolve.parts import FAILURES
from thingc.model.resolve.plausibility import density_cure, density_doubt, mass_doubt, mass_words, said_by_file
from thingc.model.resolve.types import AssemblyDefinition, BomEntry, Component, Material, Process

_INSTEAD: Mapping[ImpureInputs, str] = {
    ImpureInputs.ENVIRONMENT: "pass the value as a parameter",
    ImpureInputs.CLOCK: "pass the value as a parameter",
    ImpureInputs.CHANCE: "seed the generator: `random.Random(7)`, `numpy.random.default_rng(7)`",
    ImpureInputs.PROCESS: "save the output of the program in a file, and read the file with `asset(...)`",
    ImpureInputs.NETWORK: "save the data in a file, and read the file with `asset(...)`",
    ImpureInputs.LEFT: "wait for the process, for example with `subprocess.run(...)`",
}
"""Help texts that suggest replacements for impure inputs of parts."""
_SHOWN_PLACES = 8


@dataclass(slots=True, eq=False)
class _Use:
    """A part, a link or a frame of the assembly `scope`, at its first use in the robot. Diagnostics are reported at this use by default."""

    component: Component
    scope: AssemblyDefinition
    path: str
    origin: Origin
    findings: LinkReport
    record: PartRecord | None = None
    material: Material | None = None

    @property
    def label(self) -> str:
        """The label of the definition in backticks."""
        return f"`{self.component.label}`"

    @property
    def written(self) -> tuple[Note, ...]:
        """A note with the location of the part class, if it is known."""
        return written_at(self.label, self.record.code) if self.record is not None else ()

    def error(self, code: Code, message: str, *, help: Hint, origin: Origin | None = None, notes: Sequence[Note] = ()) -> None:
        """Report an error at `origin`, by default at the component."""
        self.findings.error(code, message, self.origin if origin is None else origin, path=self.path, help=help, notes=notes)

    def warn(
        self, code: Code, message: str, *, help: Hint | None = None, origin: Origin | None = None, notes: Sequence[Note] = (),
        allow: bool = True,
    ) -> bool:
        """Report a warning at `origin`, by default at the component. Return False if the document suppresses the warning there."""
        place = self.origin if origin is None else origin
        return self.findings.warn(code, message, place, path=self.path, help=help, notes=notes, allow=allow)


class PartInstances:
    """Creates the instances of parts, links and frames, and caches them by component.

    If an assembly is used several times, the properties of its parts are computed once.

    `unknown` is True if the properties of any part are not known exactly (see `PartRecord.exact`). The caller must report this.
    """

    def __init__(self, records: Mapping[str, PartRecord | PartFailure], meshes: Meshes, findings: LinkReport, memo: Memo) -> None:
        self._memo = memo
        self._meshes = meshes
        self._records = records
        self._findings = findings
        self._known: dict[int, PartInstance | None] = {}
        self._failures: dict[str, list[_Use]] = {}
        self._unknown_materials: dict[tuple[str, str, bool], list[_Use]] = {}
        self._warned: set[tuple[str, str]] = set()
        self._reported_slices: set[tuple[str, SliceFailure]] = set()
        self.unknown = False

    def of(self, component: Component, scope: AssemblyDefinition, path: str, origin: Origin) -> PartInstance | None:
        """Return the part instance of a component of the assembly `scope`.

        `path` is the path of the first use of the part in the robot. Return None if the part could not be built.
        """
        key = id(component)
        if key not in self._known:
            self._known[key] = self._get_or_create(_Use(component, scope, path, origin, self._findings))
        return self._known[key]

    def unit_of(self, component: Component, nested: AssemblyDefinition, scope: AssemblyDefinition, path: str, origin: Origin) -> Unit:
        """Return the unit of a nested assembly that is one part in the bill of materials. The arguments are as in `of`.

        Warn of the mirror image of a bought assembly. It keeps the order number, because symmetric assemblies are not recognized. A lump
        with neither `number` nor `make` may stand for an assembly that is not bought.
        """
        bom = bom_of(component, None, scope)
        bought = bom.make == "buy" or bom.make is None and (not nested.lump or bom.number is not None)
        if nested.plain is not None and bought and (bom.number is None or component.image_of is not None):
            self._warn_purchase(_Use(component, scope, path, origin, self._findings), nested.text, f"assembly `{nested.plain.label}`")
        return Unit(path=path, definition=Definition.of(nested), bom=bom)

    def _get_or_create(self, use: _Use) -> PartInstance | None:
        """Return the cached instance, or create it.

        An instance is not cached if diagnostics, including suppressed diagnostics, were reported for it.
        """
        component, materials = use.component, use.scope.materials
        record = self._records.get(component.definition.text) if isinstance(component.definition, PartDefinition) else None
        material = materials.get(record.material) if isinstance(record, PartRecord) and record.material else None
        choices = component.overrides.choices.values()
        files = [file for listed in (component.definition, *(choice.shapes for choice in choices)) for file in mesh_files_of(listed)]
        inputs = (component, record, material, use.scope.materials_known, tuple(self._meshes.get(file) for file in files))
        instance: PartInstance | None = self._memo.last(("part instance", use.path), inputs)
        if instance is None:
            report, allowed = self._findings.report, self._findings.report.allowed
            instance = self._create(use)
            reported = self._findings.incomplete or report.diagnostics or report.allowed > allowed or self._unknown_materials
            if instance is not None and not reported:
                self._memo.keep(("part instance", use.path), inputs, instance)
        return instance

    def report_materials(self) -> None:
        """Report each default material of a part class that the document does not define.

        The error is reported at the first component that needs the material, and notes show further components.
        """
        for (_, name, needed), (first, *others) in self._unknown_materials.items():
            materials = first.scope.materials
            hint = did_you_mean(name, materials, what="materials")
            similar = nearest(name, materials)
            if similar is None:
                hint = f"{hint}; set `material:`, or list a document that defines `{name}` under `materials:`"
            notes = list(make_notes(f"`{similar}` is defined here", materials[similar].origin)) if similar is not None else []
            notes += first.written
            places = {use.origin: use for use in reversed(others) if use.origin[:1] != first.origin[:1]}
            notes += _further_uses(reversed(places.values()), "material")
            message = f"unknown default material `{name}` of `{first.component.name}` ({first.label})"
            if needed:
                first.error(Code.UNKNOWN_MATERIAL, message, help=hint, notes=notes)
            else:
                first.warn(Code.UNKNOWN_MATERIAL, message, help=hint, notes=notes, allow=False)

    def report_failures(self) -> None:
        """Report each part that could not be built.

        The error is reported at the first component that uses the part, and notes show further components.
        """
        for text, (first, *others) in self._failures.items():
            failure, part = self._records[text], first.component.definition
            if not isinstance(failure, PartFailure) or not isinstance(part, PartDefinition):
                continue
            help: Hint
            code, description, help = FAILURES[failure.kind]
            notes = _further_uses(others, "part")
            if part.parameters:
                parameters = zip(part.parameters, part.words)
                notes.append(Note(message=f"parameters of the part: {', '.join(f'{name}={value}' for (name, _), value in parameters)}"))
            if failure.file is not None:
                notes.append(Note(message="location in the part file", span=line_of(failure.file, failure.line or 1)))
            message = f"`{first.path}` ({first.label}) {description}: {failure.message}"
            if failure.candidates:
                help = did_you_mean(failure.subject, failure.candidates, what="parts")
            elif part.kind == "file" and failure.kind in ("invalid", "raised", "crashed"):
                help = "open the file in a CAD program, and export the part again as a solid"
            elif part.kind == "file" and code is Code.PART_EMPTY:
                unit = "" if said_by_file(part) else "set the unit of the file, such as `unit: m`, or "
                help = f"{unit}export the file again as a solid"
            self._findings.error(code, message, first.origin, path=first.path, notes=notes, detail=failure.detail, help=help)

    def _create(self, use: _Use) -> PartInstance | None:
        component, definition = use.component, use.component.definition
        if isinstance(definition, PartDefinition):
            result = self._records.get(definition.text)
            if isinstance(result, PartFailure):
                self._failures.setdefault(definition.text, []).append(use)
            if result is None or isinstance(result, PartFailure):
                return None
            use.record = result
            if not result.exact:  # the values belong to a similar part, so errors that depend on these values are not reported
                self._findings.incomplete = self.unknown = True
            self._warn(use, result)
        elif not isinstance(definition, LinkDefinition) and not component.frame:
            return None
        record = use.record
        material = use.material = material_of(component, record.material if record is not None else None, use.scope)
        if record is not None:
            self._warn_mirrored(use, record)
        shapes = {path: choice.shapes for path, choice in component.overrides.choices.items() if choice.shapes is not None}
        for listed in shapes.values():
            warn_far(listed, record, self._meshes, use.path, self._findings)
        weighed = self._weigh(use)
        sound = weighed is not None and self._is_physical(use)
        return PartInstance(
            component=component, definition=Definition.of(definition) if isinstance(definition, PartDefinition | LinkDefinition) else FRAME,
            record=record, material=material,
            color=(record.color if record is not None else None) or (material.color if material is not None else None),
            bom=bom_of(component, record, use.scope), properties=weighed.properties if weighed is not None else NOTHING,
            mass_source=weighed.source if weighed is not None else "derived", estimate=weighed.estimate if weighed is not None else None,
            mounts=self._mounts(use), sound=sound,
            listed=list_shapes(definition, material, self._meshes) if isinstance(definition, LinkDefinition) else None,
            contacts={path: list_shapes(listed, material, self._meshes).touching for path, listed in shapes.items()},
        )

    def _warn(self, use: _Use, record: PartRecord) -> None:
        """Report each warning of a part once, at the first component that does not suppress it."""
        for warning in record.warnings:
            if warning.asked is None:
                message = f"{use.label}: {warning.message}"
                self._warn_once((record.text, warning.message), use, Code.PART_WARNING, message, notes=_places([warning]), allow=False)
        impure: dict[tuple[ImpureInputs, str], list[PartWarning]] = {}
        for warning in record.warnings:
            # a line outside all classes affects every part of the module
            if warning.asked is not None and (_line(warning) or record.text, warning.message) not in self._warned:
                impure.setdefault((warning.asked, warning.message), []).append(warning)
        for (inputs, message), warnings in impure.items():
            code = Code.PART_LEFT if inputs is ImpureInputs.LEFT else Code.PART_ASKS
            if use.warn(code, f"{use.label} {message}", notes=_places(warnings), help=_INSTEAD[inputs], allow=False):
                self._warned.update((_line(warning) or record.text, message) for warning in warnings)
        if record.apart:
            volumes = ", ".join(f"{float(f'{1e6 * volume:.3g}'):g}" for volume in record.apart[:_SHOWN_PLACES])
            ellipsis = ", ..." if len(record.apart) > _SHOWN_PLACES else ""
            message = f"{use.label} consists of {len(record.apart)} separate solids ({volumes}{ellipsis} cm^3)"
            help = "make the solids overlap, or return a list of solids: `return [a, b]`"
            self._warn_once((record.text, Code.APART.code), use, Code.APART, message, help=help, notes=use.written)

    def _warn_once(
        self, key: tuple[str, str], use: _Use, code: Code, message: str, *, help: Hint | None = None, notes: Sequence[Note] = (),
        allow: bool = True,
    ) -> None:
        """Report a warning, unless a warning with this key was reported at another component."""
        if key not in self._warned and use.warn(code, message, help=help, notes=notes, allow=allow):
            self._warned.add(key)

    def _warn_mirrored(self, use: _Use, record: PartRecord) -> None:
        """Warn of a mirrored part that equals its mirror image, or that is a bought part. Each part is reported once."""
        component = use.component
        original = component.definition.plain if isinstance(component.definition, PartDefinition) else None
        if original is None or not record.exact:
            return
        bom, process = bom_of(component, record, use.scope), component.overrides.process_with(use.material)
        bought = bom.make == "buy" or bom.make is None and (process.kind or "").lower() == "bought"
        if record.own_image and component.image_of is None:
            message = f"`mirror` has no effect on the symmetric part `{component.name}` (`{original.label}`)"
            self._warn_once((record.text, Code.OWN_IMAGE.code), use, Code.OWN_IMAGE, message, help="remove `mirror`")
        elif bought and bom.number is None:
            self._warn_purchase(use, record.text, f"part `{original.label}`")

    def _warn_purchase(self, use: _Use, text: str, original: str) -> None:
        """Warn of the mirror image `text` of a bought part or assembly."""
        help = "remove `mirror`, or add the order number of the mirror image: `bom: {number: ...}`"
        if use.component.image_of is not None:
            help = "move the component from the mirrored assembly to the enclosing assembly"
        message = f"`{use.component.name}` is the mirror image of the purchased {original}"
        self._warn_once((text, Code.MIRRORED_BOUGHT.code), use, Code.MIRRORED_BOUGHT, message, help=help)

    def _weigh(self, use: _Use) -> MassResult | None:
        component, record, material, findings = use.component, use.record, use.material, self._findings
        if isinstance(component.definition, LinkDefinition):
            return self._weigh_link(use, component.definition)
        process = component.overrides.process_with(material)
        weighed = component_mass(component, record, material)
        if record is not None and record.exact and weighed is not None:
            self._warn_of_density(use, record, weighed)
        if material is None and record is not None and record.material is not None:
            if use.scope.materials_known:
                self._unknown_materials.setdefault((use.scope.document, record.material, weighed is None), []).append(use)
            if weighed is None or not use.scope.materials_known:
                findings.incomplete = True
        elif weighed is None and record is not None and material is None:
            materials = use.scope.materials
            use.error(Code.NO_MATERIAL, f"`{component.name}` ({use.label}) has neither a material nor a mass", help=(
                f"add `material:` ({did_you_mean('', materials, what='materials')}) or `mass:`" if materials
                else "list a document under `materials:` and set `material:`, or add `mass:`"
            ))
        elif weighed is None and material is not None:
            use.error(
                Code.NO_MATERIAL, f"the material `{material.name}` of `{component.name}` has no density",
                help=f"add `density:` to `{material.name}`, or `mass:` to `{component.name}`",
                notes=make_notes(f"`{material.name}` is defined here", material.origin),
            )
        needs_density = record is not None and record.volume > 0.0 and record.mass is None and component.overrides.mass is None
        if weighed is None or not needs_density:
            return weighed
        if process.missing_keys:
            if process.unspecified_keys:
                self._report_missing_settings(use, process.unspecified_keys)
            else:
                findings.incomplete = True
            return None
        if process.estimation == "layers" and process.layers_too_high:
            self._report_high_layers(use, process)
            return None
        if process.estimation == "layers" and weighed.estimate == "skin":
            self._report_unsliced(use, process)
        return weighed

    def _weigh_link(self, use: _Use, definition: LinkDefinition) -> MassResult | None:
        try:
            return weigh_shapes(definition, use.material, self._meshes, use.component.overrides)
        except MissingDensity as why:
            if str(why):
                help = "set a `material` with a density for the link or for every shape, or add `mass:`, `com:` and `inertia:`"
                use.error(Code.NO_MATERIAL, f"`{use.component.name}` {why}", help=help)
            else:  # the file was not read, or its error has been reported
                self._findings.incomplete = self.unknown = True
            return None

    def _warn_of_density(self, use: _Use, record: PartRecord, weighed: MassResult) -> None:
        """Warn of a density that is implausible, or of a mass that is implausible for the volume, at the location in the document."""
        component, material, stated = use.component, use.material, use.component.overrides.mass
        if record.volume <= 0.0 or stated is not None and stated.stand_in:
            return
        if stated is not None:
            doubt = mass_doubt(weighed.properties.mass, record.volume)
            if doubt is not None:
                help = None if doubt.meant is None else f"try `{mass_words(doubt.meant)}`"
                place = component.full_origin(stated.origin, use.origin)
                use.warn(Code.DENSITY, f"the density of `{component.name}` {doubt.words}", origin=place, help=help)
        elif record.mass is not None or record.density is not None:
            self._warn_of_thing_density(use, record)
        elif material is not None and material.density is not None:
            doubt = density_doubt(material.density)
            if doubt is not None:
                notes = make_notes(f"`{component.name}` is made of this material", use.origin)
                message = f"the density of `{material.name}` {doubt.words}"
                use.warn(Code.DENSITY, message, origin=material.density_origin, notes=notes, help=density_cure(doubt))

    def _warn_of_thing_density(self, use: _Use, record: PartRecord) -> None:
        """Warn of a density or mass of a Thing that is implausible, at the first component that uses the Thing."""
        method, unit, doubt = "mass", "kg", None
        if record.mass is not None:
            doubt = mass_doubt(record.mass.value, record.volume)
        elif record.density is not None:
            method, unit, doubt = "density", "kg/m^3", density_doubt(record.density.value)
        if doubt is not None:
            help = f"return a value in {unit} from `{method}()`" + ("" if doubt.meant is None else f", such as {doubt.meant:.6g}")
            key = (record.text, Code.DENSITY.code)
            self._warn_once(key, use, Code.DENSITY, f"the density of {use.label} {doubt.words}", help=help, notes=use.written)

    def _report_high_layers(self, use: _Use, process: Process) -> None:
        """Report a layer height above the line width.

        If a material specifies both, the error is reported once per material, otherwise once per component.
        """
        of_material = use.material is not None and use.material.process is not None and use.material.process.layers_too_high
        message = f"`layer` ({1e3 * (process.layer or 0.0):g} mm) exceeds `line_width` ({1e3 * (process.line_width or 0.0):g} mm)"
        help = "write, for example, `layer: 0.2 mm, line_width: 0.45 mm`"
        _report_process(use, Code.HIGH_LAYERS, message, help, of_material=of_material)

    def _report_unsliced(self, use: _Use, process: Process) -> None:
        """Report the reason why the mass of a part cannot be estimated from its layers. Each part is reported once."""
        record = use.record
        slicing = slicing_of(process, use.component.overrides, record) if record is not None else None
        slices = record.slices.get(slicing) if record is not None and slicing is not None else None
        if record is None or not isinstance(slices, SliceFailure) or (record.text, slices) in self._reported_slices:
            return
        self._reported_slices.add((record.text, slices))
        subject = f"`{use.component.name}` ({use.label}) cannot be sliced"
        help = "fix the part, or set `process: {estimate: skin}` in the component"
        notes = [Note(message="the mass is estimated from the surface of the part")]
        use.warn(Code.UNSLICED, f"{subject}: {slices.reason}", help=help, notes=notes, allow=False)

    def _report_missing_settings(self, use: _Use, missing: tuple[str, ...]) -> None:
        """Report the process settings that are missing for the estimate of the mass.

        If the process belongs to a material, the error is reported once per material, otherwise once per component.
        """
        of_material = use.material.process.unspecified_keys if use.material is not None and use.material.process is not None else ()
        keys = of_material or missing
        listed = " and ".join(filter(None, (", ".join(f"`{key}`" for key in keys[:-1]), f"`{keys[-1]}`")))
        needed = {"walls", "line_width"} & set(keys)
        alternative = "`infill: 100 %`" if needed else "`estimate: skin`"
        name, advice = use.component.name, f"{listed} to the `process` of the material or of the component"
        if of_material and use.material is not None:
            name, advice = use.material.name, listed
        message = f"the print process of `{name}` lacks {listed}"
        _report_process(use, Code.INFILL, message, f"add {advice}, or write {alternative}", of_material=bool(of_material))

    def _is_physical(self, use: _Use) -> bool:
        """Return whether a rigid body can have the inertia that the Thing specifies. An error is reported if the inertia is not physical.

        Inertias in documents are checked by the function `check_stated`. Inertias that are computed from geometry need no check.
        """
        record = use.record
        if use.component.overrides.inertia is not None or record is None or not record.exact or record.matrix is None:
            return True
        fault = physical_fault(record.matrix.value)
        if fault is not None:
            help = "return the inertia relative to the centre of mass in kg m^2 from `matrix_of_inertia()`"
            use.error(Code.NOT_PHYSICAL, f"the inertia of {use.label} is not physical: {fault}", help=help, notes=use.written)
        return fault is None

    def _mounts(self, use: _Use) -> dict[str, MountRecord]:
        """Return the mounts of a component: first `origin`, then the mounts of the part, then the mounts that the document adds."""
        component, part_mounts = use.component, use.record.mounts if use.record is not None else {}
        axis = component.mounts_mirrored
        mounts = {"origin": MountRecord(pose=NO_POSE)}
        mounts |= {name: mount if axis is None else mount.mirror_image(axis) for name, mount in part_mounts.items()}
        for name, extra in component.mounts.items():
            if mounts.setdefault(name, extra) is not extra:
                use.error(
                    Code.MOUNT_CLASH, f"`{component.name}` already has a mount `{name}`", help="rename the new mount",
                    origin=component.full_origin(extra.origin, use.origin), notes=use.written if name in part_mounts else (),
                )
        return mounts


def _further_uses(others: Iterable[_Use], noun: str) -> list[Note]:
    """Return notes with the locations of further components that use a material or a part."""
    notes = [note for use in others for note in make_notes(f"`{use.component.name}` also uses this {noun}", use.origin)]
    return first_notes(notes, _SHOWN_PLACES - 1, "more component")


def _report_process(use: _Use, code: Code, message: str, help: str, *, of_material: bool) -> None:
    """Report an error in the process of a material or, if the material is not the cause, of the component."""
    material, origin, notes = use.material, use.origin, make_notes(f"`{use.component.name}` is made of this material", use.origin)
    if material is not None and of_material:
        origin = material.process_origin
    else:
        notes = make_notes(f"the process of `{material.name}` is defined here", material.process_origin) if material is not None else ()
    use.error(code, message, origin=origin, help=help, notes=notes)


def bom_of(component: Component, record: PartRecord | None, scope: AssemblyDefinition) -> BomEntry:
    """Return the entry of a component in the bill of materials.

    Values in the document take precedence over values in its catalogue, and these over values in the part class.
    """
    stated = {key: value for key, value in record.bom.items() if key != "name"} if record is not None else {}
    of_class = entry_of(stated.pop("cost", None), **stated)
    number = component.bom.number or of_class.number
    return component.bom.merge_over(scope.catalog.get(number, BomEntry()) if number is not None else BomEntry()).merge_over(of_class)


def _line(warning: PartWarning) -> str:
    """Return the location (`file:line`) of a warning in a part file, or an empty string."""
    return "" if warning.file is None else f"{warning.file}:{warning.line}"


def _places(warnings: Sequence[PartWarning]) -> list[Note]:
    """Return notes with the locations of warnings in part files."""
    places = [line_of(warning.file, warning.line or 1) for warning in warnings if warning.file is not None]
    return first_notes([Note(message="location in the part file", span=place) for place in places], _SHOWN_PLACES, "more line")
