"""Create the instances of parts, links and frames. Each component of a definition is processed once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from thingc.base.diagnostics import Code, Note, first_notes, noted
from thingc.base.inertia import physical_fault
from thingc.base.memo import Memo
from thingc.base.pose import NO_POSE, Mirror
from thingc.base.source import Origin, line_of
from thingc.base.suggestions import Hint, did_you_mean, nearest
from thingc.geometry.print_slices import SliceFailure
from thingc.geometry.record import FailureKind, ImpureInputs, PartDefinition, PartFailure, PartRecord, PartWarning
from thingc.model.assembly.hag import FRAME, Definition
from thingc.model.assembly.mass import (
    NOTHING,
    Density,
    MassResult,
    component_mass,
    estimate_of,
    layers_too_high,
    missing_keys,
    slicing_of,
    unsaid_keys,
)
from thingc.model.assembly.print_settings import material_of, process_of
from thingc.model.assembly.report import LinkReport, written_at
from thingc.model.assembly.shape_links import Meshes, MissingDensity, listed, warn_far, weigh_shapes
from thingc.model.assembly.types import MountFrame, PartInstance
from thingc.model.resolve.link_definition import LinkDefinition, mesh_files_of
from thingc.model.resolve.plausibility import density_cure, density_doubt, mass_doubt, mass_words, said_by_file
from thingc.model.resolve.types import AssemblyDefinition, BomEntry, Component, Material, Process

_WRITE_WHERE = "write files only to `tempfile.gettempdir()`, a temporary folder that is deleted when the part is finished"
_FAILED: Mapping[FailureKind, tuple[Code, str, str]] = {
    "raised": (Code.PART_RAISED, "raised an exception", "change the `params` of the component, or fix the part file"),
    "hung": (Code.PART_HUNG, "took too long", "fix the part, or allow more time with `--part-timeout`"),
    "crashed": (Code.PART_CRASHED, "crashed the interpreter", "change the `params` of the component, or the CAD calls in the part file"),
    "trespassed": (Code.PART_WRITES, "writes files outside its own folder", _WRITE_WHERE),
    "swarmed": (Code.PART_SWARMED, "starts too many processes", "start fewer processes, and wait for each process"),
    "starved": (Code.PART_STARVED, "needs too much memory", "simplify the part, or raise `part_memory` in `thingc.toml`"),
    "empty": (Code.PART_EMPTY, "has no volume", "return a solid from `result()`, or None for a part without geometry"),
    "refused": (Code.PART_REFUSED, "is not allowed", "use a part from the `parts` folders or the `packages` of the workspace"),
    "missing": (Code.PART_MISSING, "does not exist", "write `module:Class`, with a module in a part folder and a class in that module"),
    **dict.fromkeys(("invalid", "resultless", "absent"), (Code.PART_INVALID, "is not valid", "fix the part file")),
    "unbounded": (Code.PART_INVALID, "cannot be simplified to so few triangles", "increase `faces`"),
    "stale": (Code.LOCK_STALE, "has changed", "run `thingc lock`, and commit `parts.lock.json`"),
    "unlocked": (Code.NOT_LOCKED, "is not locked", "run `thingc lock`, and commit `parts.lock.json`"),
}
"""For each kind of failure: the diagnostic code, the end of the message after the name of the part, and the help text."""
_INSTEAD: Mapping[ImpureInputs, str] = {
    ImpureInputs.ENVIRONMENT: "pass the value as a parameter, or in a file that the part reads with `asset(...)`",
    ImpureInputs.CLOCK: "pass the value as a parameter",
    ImpureInputs.CHANCE: "seed the generator: `random.Random(7)`, `numpy.random.default_rng(7)`",
    ImpureInputs.PROCESS: "write the output of the program to a file beforehand, and read the file with `asset(...)`",
    ImpureInputs.NETWORK: "download the data to a file beforehand, and read the file with `asset(...)`",
    ImpureInputs.LEFT: "wait for processes that the part starts: use `subprocess.run(...)`, or a pool in a `with` block",
}
"""Help texts that suggest replacements for impure inputs of parts."""
_SHOWN_PLACES = 8


class PartInstances:
    """Creates the instances of parts, links and frames, and caches them by component.

    If an assembly is used several times, the properties of its parts are computed once.

    `unknown` contains the parts whose properties are not known exactly (see `PartRecord.exact`). The caller must report these parts.
    """

    def __init__(self, records: Mapping[str, PartRecord | PartFailure], meshes: Meshes, findings: LinkReport, memo: Memo) -> None:
        self._memo = memo
        self._meshes = meshes
        self._records = records
        self._findings = findings
        self._known: dict[int, PartInstance | None] = {}
        self._failures: dict[str, list[tuple[Component, str, Origin]]] = {}
        self._unknown: dict[tuple[str, str, bool], list[tuple[Component, PartRecord, AssemblyDefinition, str, Origin]]] = {}
        self._warned: set[tuple[str, str]] = set()
        self._told: set[tuple[str, SliceFailure]] = set()
        self.unknown = False

    def of(self, component: Component, scope: AssemblyDefinition, path: str, origin: Origin) -> PartInstance | None:
        """Return the part instance of a component of the assembly `scope`.

        `path` is the path of the first use of the part in the robot. Return None if the part could not be built.
        """
        key = id(component)
        if key not in self._known:
            self._known[key] = self._remembered(component, scope, path, origin)
        return self._known[key]

    def _remembered(self, component: Component, scope: AssemblyDefinition, path: str, origin: Origin) -> PartInstance | None:
        """Return the cached instance, or create it.

        An instance is not cached if diagnostics, including suppressed diagnostics, were reported for it.
        """
        record = self._records.get(component.definition.text) if isinstance(component.definition, PartDefinition) else None
        material = scope.materials.get(record.material) if isinstance(record, PartRecord) and record.material else None
        choices = component.overrides.choices.values()
        files = [file for listed in (component.definition, *(one.shapes for one in choices)) for file in mesh_files_of(listed)]
        inputs = (component, record, material, scope.materials_known, tuple(self._meshes.get(file) for file in files))
        instance: PartInstance | None = self._memo.last(("part instance", path), inputs)
        if instance is None:
            report, allowed = self._findings.report, self._findings.report.allowed
            instance = self._work_out(component, scope, path, origin)
            told = self._findings.incomplete or report.diagnostics or report.allowed > allowed or self._unknown
            if instance is not None and not told:
                self._memo.keep(("part instance", path), inputs, instance)
        return instance

    def report_materials(self) -> None:
        """Report each default material of a part class that the document does not define.

        The error is reported at the first component that needs the material, and notes show further components.
        """
        for (_, name, needed), users in self._unknown.items():
            component, record, scope, path, origin = users[0]
            hint = did_you_mean(name, scope.materials, what="materials")
            near = nearest(name, scope.materials)
            if near is None:
                hint = f"{hint}; list a document that defines it under `materials:` (`thingc_stock.materials` defines common ones)"
                hint = f"{hint}, or set `material:` here"
            notes = list(noted(f"`{near}` is defined here", scope.materials[near].origin)) if near is not None else []
            notes += written_at(f"`{component.label}`", record.code)
            places = {place: other for other, _, _, _, place in reversed(users[1:]) if place[:1] != origin[:1]}
            others = [note for place, other in reversed(places.items()) for note in noted(f"`{other.name}` also uses this material", place)]
            notes += first_notes(others, _SHOWN_PLACES - 1, "more component")
            say = self._findings.error if needed else self._findings.warn
            say(
                Code.UNKNOWN_MATERIAL, f"`{component.name}` (`{component.label}`) is made of `{name}` by default, "
                f"which is not among the materials of `{scope.name}`", origin, path=path, help=hint, notes=notes,
            )

    def report_failures(self) -> None:
        """Report each part that could not be built.

        The error is reported at the first component that uses the part, and notes show further components.
        """
        for text, users in self._failures.items():
            failure = self._records[text]
            component, path, origin = users[0]
            if not isinstance(failure, PartFailure) or not isinstance(component.definition, PartDefinition):
                continue
            help: Hint
            code, what, help = _FAILED[failure.kind]
            others = [note for other, _, place in users[1:] for note in noted(f"`{other.name}` also uses this part", place)]
            notes = first_notes(others, _SHOWN_PLACES - 1, "more component")
            if component.definition.parameters:
                given = zip(component.definition.parameters, component.definition.words)
                notes.append(Note(message=f"parameters of the part: {', '.join(f'{name}={words}' for (name, _), words in given)}"))
            if failure.file is not None:
                notes.append(Note(message="location in the part file", span=line_of(failure.file, failure.line or 1)))
            message = f"`{path}` (`{component.label}`) {what}: {failure.message}"
            if failure.candidates:
                help = did_you_mean(failure.subject, failure.candidates, what="parts")
            elif component.definition.kind == "file" and failure.kind in ("invalid", "raised", "crashed"):
                help = "open the file in a CAD program, and export the part again as a solid"
            elif component.definition.kind == "file" and code is Code.PART_EMPTY:
                unit = "" if said_by_file(component.definition) else "set the unit of the file (such as `unit: m`; default: mm), or "
                help = f"{unit}export it again as a solid"
            self._findings.error(code, message, origin, path=path, notes=notes, detail=failure.detail, help=help)

    def _work_out(self, component: Component, scope: AssemblyDefinition, path: str, origin: Origin) -> PartInstance | None:
        record: PartRecord | None = None
        definition = FRAME
        if isinstance(component.definition, PartDefinition):
            part = component.definition
            answer = self._records.get(part.text)
            if isinstance(answer, PartFailure):
                self._failures.setdefault(part.text, []).append((component, path, origin))
                return None
            if answer is None:
                return None
            record = answer
            if not record.exact:  # the values belong to a similar part, so errors that depend on these values are not reported
                self._findings.leave_out()
                self.unknown = True
            self._warn(component, record, path, origin)
            definition = Definition.of(part)
        elif isinstance(component.definition, LinkDefinition):
            definition = Definition.of(component.definition)
        elif not component.frame:
            return None
        material = material_of(component, record, scope)
        unknown = material is None and record is not None and record.material is not None
        if record is not None:
            self._warn_mirrored(component, record, material, scope, path, origin)
        shapes = {name: one.shapes for name, one in component.overrides.choices.items() if one.shapes is not None}
        for several in shapes.values():
            warn_far(several, record, self._meshes, path, self._findings)
        weighed = self._weigh(component, record, material, unknown, scope, path, origin)
        sound = weighed is not None and self._physical(component, record, path, origin)
        return PartInstance(
            component=component, definition=definition, record=record, material=material,
            color=(record.color if record is not None else None) or (material.color if material is not None else None),
            bom=bom_of(component, record, scope), properties=weighed.properties if weighed is not None else NOTHING,
            mass_source=weighed.source if weighed is not None else "derived", estimate=weighed.estimate if weighed is not None else None,
            mounts=self._mounts(component, record, path, origin), sound=sound,
            listed=listed(component.definition, material, self._meshes) if isinstance(component.definition, LinkDefinition) else None,
            contacts={name: listed(several, material, self._meshes).touching for name, several in shapes.items()},
        )

    def _warn(self, component: Component, record: PartRecord, path: str, origin: Origin) -> None:
        """Report each warning of a part once, at the first component that does not suppress it."""
        of = f"`{component.label}`"
        findings, place = self._findings, written_at(of, record.code)
        for warning in record.warnings:
            key = (record.text, warning.message)
            if warning.asked is None and key not in self._warned and findings.warn(
                Code.PART_WARNING, f"{of}: {warning.message}", origin, path=path, notes=_places([warning]),
            ):
                self._warned.add(key)
        asked: dict[tuple[ImpureInputs, str], list[PartWarning]] = {}
        for warning in record.warnings:
            # a line outside all classes affects every part of the module
            if warning.asked is not None and (_line(warning) or record.text, warning.message) not in self._warned:
                asked.setdefault((warning.asked, warning.message), []).append(warning)
        for (what, message), where in asked.items():
            code = Code.PART_LEFT if what is ImpureInputs.LEFT else Code.PART_ASKS
            if findings.warn(code, f"{of} {message}", origin, path=path, notes=_places(where), help=_INSTEAD[what]):
                self._warned.update((_line(warning) or record.text, message) for warning in where)
        if record.apart:
            key = (record.text, Code.APART.code)
            volumes = ", ".join(f"{float(f'{1e6 * volume:.3g}'):g}" for volume in record.apart[:_SHOWN_PLACES])
            more = ", ..." if len(record.apart) > _SHOWN_PLACES else ""
            if key not in self._warned and findings.warn(
                Code.APART, f"{of} consists of {len(record.apart)} separate solids ({volumes}{more} cm^3)", origin, path=path,
                notes=place, help="make the solids overlap, or return a list if separate solids are intended: `return [a, b]`",
                allow=True,
            ):
                self._warned.add(key)

    def _warn_mirrored(
        self, component: Component, record: PartRecord, material: Material | None, scope: AssemblyDefinition, path: str, origin: Origin,
    ) -> None:
        """Warn of a mirrored part that equals its mirror image, or that is a bought part. Each part is reported once."""
        plain = component.definition.plain if isinstance(component.definition, PartDefinition) else None
        if plain is None or not record.exact:
            return
        bom, process = bom_of(component, record, scope), process_of(component, material)
        bought = bom.make == "buy" or bom.make is None and process is not None and (process.kind or "").lower() == "bought"
        if record.own_image and component.image_of is None:
            code = Code.OWN_IMAGE
            message = f"`{component.name}` is mirrored, but the mirror image of `{plain.label}` has the same shape"
            help = "remove `mirror`"
        elif bought and bom.number is None:
            code = Code.MIRRORED_BOUGHT
            message = f"`{component.name}` is the mirror image of `{plain.label}`, a purchased part: a mirrored version may not exist"
            help = "remove `mirror`, or add the order number of the mirror image: `bom: {number: ...}`"
            if component.image_of is not None:
                help = "move the component from the mirrored assembly to the enclosing assembly"
        else:
            return
        if (record.text, code.code) not in self._warned and self._findings.warn(code, message, origin, path=path, help=help, allow=True):
            self._warned.add((record.text, code.code))

    def _weigh(
        self, component: Component, record: PartRecord | None, material: Material | None, unknown: bool,
        scope: AssemblyDefinition, path: str, origin: Origin,
    ) -> MassResult | None:
        findings, overrides = self._findings, component.overrides
        if isinstance(component.definition, LinkDefinition):
            return self._weigh_link(component, component.definition, material, path, origin)
        process = process_of(component, material)
        weighed = component_mass(record, _density(record, material), process, overrides)
        if record is not None and record.exact and weighed is not None:
            self._doubt(component, record, material, weighed, path, origin)
        needs_density = record is not None and record.volume > 0.0 and record.mass is None and overrides.mass is None
        if unknown and not scope.materials_known:
            findings.leave_out()
        elif record is not None and unknown:
            key = (scope.document, record.material or "", weighed is None)
            self._unknown.setdefault(key, []).append((component, record, scope, path, origin))
            if weighed is None:
                findings.leave_out()
        elif weighed is None and record is not None and material is None:
            findings.error(
                Code.NO_MATERIAL, f"`{component.name}` (`{component.label}`) has neither a material nor a mass", origin, path=path, help=(
                    f"add `material:` ({did_you_mean('', scope.materials, what='materials')}) or `mass:`" if scope.materials
                    else "list a document under `materials:` and set `material:` to one of its materials, or add `mass:`"
                ),
            )
        elif weighed is None and material is not None:
            findings.error(
                Code.NO_MATERIAL, f"`{component.name}` is made of `{material.name}`, which has no density", origin, path=path,
                help=f"add `density:` to `{material.name}`, or `mass:` to `{component.name}`",
                notes=noted(f"`{material.name}` is defined here", material.origin),
            )
        if needs_density and weighed is not None and missing_keys(process):
            if unsaid := unsaid_keys(process):
                self._incomplete(component, material, unsaid, path, origin)
            else:
                findings.leave_out()
            return None
        if needs_density and weighed is not None and estimate_of(process) == "layers" and process is not None:
            if layers_too_high(process):
                self._high_layers(component, material, process, path, origin)
                return None
            if weighed.estimate == "skin":
                self._unsliced(component, record, process, path, origin)
        return weighed

    def _weigh_link(
        self, component: Component, definition: LinkDefinition, material: Material | None, path: str, origin: Origin,
    ) -> MassResult | None:
        try:
            return weigh_shapes(definition, material, self._meshes, component.overrides)
        except MissingDensity as why:
            if not str(why):  # the file was not read, or its error has been reported
                self._findings.leave_out()
                self.unknown = True
                return None
            self._findings.error(
                Code.NO_MATERIAL, f"`{component.name}` {why}", origin, path=path,
                help="give every shape, or the link, a `material` with a density, or add `mass:`, `com:` and `inertia:`",
            )
            return None

    def _doubt(
        self, component: Component, record: PartRecord, material: Material | None, weighed: MassResult, path: str, origin: Origin,
    ) -> None:
        """Warn of a density that is implausible, or of a mass that is implausible for the volume, at the location in the document."""
        stated, warn = component.overrides.mass, self._findings.warn
        if record.volume <= 0.0 or stated is not None and stated.stand_in:
            return
        if stated is not None:
            doubt = mass_doubt(weighed.properties.mass, record.volume)
            if doubt is not None:
                warn(
                    Code.DENSITY, f"`{component.name}` {doubt.words}", component.located(stated.origin, origin), path=path,
                    help=None if doubt.meant is None else f"probably `{mass_words(doubt.meant)}` was meant", allow=True,
                )
        elif record.mass is not None or record.density is not None:
            self._doubt_thing(component, record, path, origin)
        elif material is not None and material.density is not None:
            doubt = density_doubt(material.density)
            if doubt is not None:
                warn(
                    Code.DENSITY, f"`{material.name}` {doubt.words}", material.density_origin, path=path,
                    notes=noted(f"`{component.name}` is made of this material", origin), help=density_cure(doubt), allow=True,
                )

    def _doubt_thing(self, component: Component, record: PartRecord, path: str, origin: Origin) -> None:
        """Warn of a density or mass of a Thing that is implausible, at the first component that uses the Thing."""
        key = (record.text, Code.DENSITY.code)
        method, unit, doubt = "mass", "kg", None
        if record.mass is not None:
            doubt = mass_doubt(record.mass.value, record.volume)
        elif record.density is not None:
            method, unit, doubt = "density", "kg/m^3", density_doubt(record.density.value)
        if doubt is not None and key not in self._warned and self._findings.warn(
            Code.DENSITY, f"`{component.label}` {doubt.words}", origin, path=path, notes=written_at(f"`{component.label}`", record.code),
            help=f"`{method}()` returns {unit}" + ("" if doubt.meant is None else f", probably {doubt.meant:.6g}"), allow=True,
        ):
            self._warned.add(key)

    def _high_layers(self, component: Component, material: Material | None, process: Process, path: str, origin: Origin) -> None:
        """Report a layer height above the line width.

        If a material specifies both, the error is reported once per material, otherwise once per component.
        """
        of_material = material is not None and material.process is not None and layers_too_high(material.process)
        self._findings.error(
            Code.HIGH_LAYERS, f"`layer` is {1e3 * (process.layer or 0.0):g} mm, and `line_width` only "
            f"{1e3 * (process.line_width or 0.0):g} mm: a line must be at least as wide as it is high",
            material.process_origin if of_material and material is not None else origin, path=path,
            help="write, for example, `layer: 0.2 mm, line_width: 0.45 mm`",
            notes=noted(f"`{component.name}` is made of this material", origin) if of_material else
            noted(f"the process of `{material.name}` is defined here", material.process_origin) if material is not None else (),
        )

    def _unsliced(self, component: Component, record: PartRecord | None, process: Process, path: str, origin: Origin) -> None:
        """Report the reason why the mass of a part cannot be estimated from its layers. Each part is reported once."""
        slicing = slicing_of(process, component.overrides, record) if record is not None else None
        slices = record.slices.get(slicing) if record is not None and slicing is not None else None
        if record is None or not isinstance(slices, SliceFailure) or (record.text, slices) in self._told:
            return
        self._told.add((record.text, slices))
        self._findings.warn(
            Code.UNSLICED, f"`{component.name}` (`{component.label}`) cannot be sliced: it {slices.reason}; its mass is estimated "
            "from its surface", origin, path=path, help="fix the part, or set `process: {estimate: skin}` in the component",
        )

    def _incomplete(self, component: Component, material: Material | None, missing: tuple[str, ...], path: str, origin: Origin) -> None:
        """Report the process settings that are missing for the estimate of the mass.

        If the process belongs to a material, the error is reported once per material, otherwise once per component.
        """
        of_material = material.process if material is not None and unsaid_keys(material.process) else None
        keys = unsaid_keys(of_material) or missing
        listed = " and ".join(filter(None, (", ".join(f"`{key}`" for key in keys[:-1]), f"`{keys[-1]}`")))
        needed = {"walls", "line_width"} & set(keys)
        instead = "`infill: 100 %`" if needed else "`estimate: skin`, which needs only `walls` and `line_width`"
        if material is not None and of_material is not None:
            self._findings.error(
                Code.INFILL, f"`{material.name}` is printed with an infill, but its `process` has no {listed}", material.process_origin,
                path=path, help=f"add {listed}, or write {instead}", notes=noted(f"`{component.name}` is made of this material", origin),
            )
            return
        self._findings.error(
            Code.INFILL, f"`{component.name}` is printed with an infill, but its process has no {listed}", origin, path=path,
            help=f"add {listed} to the `process` of the material or of the component, or write {instead}",
            notes=noted(f"the process of `{material.name}` is defined here", material.process_origin) if material is not None else (),
        )

    def _physical(self, component: Component, record: PartRecord | None, path: str, origin: Origin) -> bool:
        """Return whether a rigid body can have the inertia that the Thing specifies. An error is reported if the inertia is not physical.

        Inertias in documents are checked by the function `check_stated`. Inertias that are computed from geometry need no check.
        """
        if component.overrides.inertia is not None:
            return True
        if record is not None and record.exact and record.matrix is not None:
            fault = physical_fault(record.matrix.value)
            if fault is not None:
                self._findings.error(
                    Code.NOT_PHYSICAL, f"the inertia of `{component.label}` is not physical: {fault}", origin, path=path,
                    help="`matrix_of_inertia()` returns the inertia relative to the centre of mass, in the axes of the part, in kg m^2",
                    notes=written_at(f"`{component.label}`", record.code),
                )
            return fault is None
        return True

    def _mounts(self, component: Component, record: PartRecord | None, path: str, origin: Origin) -> dict[str, MountFrame]:
        """Return the mounts of a component: first `origin`, then the mounts of the part, then the mounts that the document adds."""
        mounts = {"origin": MountFrame(pose=NO_POSE)}
        if record is not None:
            mirror = Mirror(component.mounts_mirrored) if component.mounts_mirrored is not None else None
            for name, m in record.mounts.items():
                features = m.features if mirror is None else tuple(one.mirrored() for one in m.features)
                mounts[name] = MountFrame(
                    pose=m.pose if mirror is None else mirror.mount(m.pose), interface=m.interface, features=features,
                )
        for name, extra in component.mounts.items():
            if name in mounts:
                place = component.located(extra.origin, origin)
                self._findings.error(
                    Code.MOUNT_CLASH, f"`{component.name}` already has a mount `{name}`", place, path=path,
                    help="rename the mount that is added here",
                    notes=written_at(f"`{component.label}`", record.code) if record is not None and name in record.mounts else (),
                )
                continue
            mounts[name] = MountFrame(pose=extra.pose, interface=extra.interface, features=extra.features)
        return mounts


def bom_of(component: Component, record: PartRecord | None, scope: AssemblyDefinition) -> BomEntry:
    """Return the entry of a component in the bill of materials.

    Values in the document take precedence over values in its catalogue, and these over values in the part class.
    """
    stated = record.bom if record is not None else {}
    number, supplier, cost, make, link = map(stated.get, ("number", "supplier", "cost", "make", "link"))
    thing = BomEntry(number=number, supplier=supplier, cost=cost, make=make, link=link)
    number = component.bom.number or thing.number
    return component.bom.over(scope.catalog.get(number, BomEntry()) if number is not None else BomEntry()).over(thing)


def _density(record: PartRecord | None, material: Material | None) -> Density | None:
    """Return the density of a part class or, if the class does not specify a density, of the material."""
    if record is not None and record.density is not None:
        return Density(value=float(record.density.value), estimated=record.density.source == "estimated")
    return Density(value=material.density) if material is not None and material.density is not None else None


def _line(warning: PartWarning) -> str:
    """Return the location (`file:line`) of a warning in a part file, or an empty string."""
    return "" if warning.file is None else f"{warning.file}:{warning.line}"


def _places(warnings: Sequence[PartWarning]) -> list[Note]:
    """Return notes with the locations of warnings in part files."""
    places = [line_of(warning.file, warning.line or 1) for warning in warnings if warning.file is not None]
    return first_notes([Note(message="location in the part file", span=place) for place in places], _SHOWN_PLACES, "more line")
