"""Resolve the materials that a document can use.

Materials are defined in materials documents, in the document itself, or in the library bd_materials.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from thingc.base.diagnostics import Code, Note
from thingc.base.inertia import DENSEST
from thingc.base.source import Document, Path
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, DENSITY, LENGTH, NUMBER, TIME, VELOCITY, shorten
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.materials import FrictionSpec, MaterialSpec, MaterialsSpec, ProcessSpec
from thingc.model.resolve.document_scope import ResolveRun
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import Material, Process

_STAND_IN = 1000.0
"""Placeholder [kg/m^3] for an invalid density. With the placeholder, later passes do not report a missing density.

Build outputs never contain the placeholder, because an invalid density is an error.
"""

_ABOVE_ZERO = {"line_width": LENGTH, "layer": LENGTH, "tolerance": LENGTH, "tilt": ANGLE, "speed": VELOCITY, "layer_time": TIME}
"""Settings of a process that must be above 0, with their dimensions."""

BRIDGE_FLOWS = (0.1, 2.0)
"""Plausible range for the flow ratio of bridges."""


def in_scope(context: ResolveRun, scope: Scope, spec: AssemblySpec) -> dict[str, Material | None]:
    """Return all materials that a document can use, by name.

    A material from an invalid document is None, so that its name is not reported as unknown.
    """
    if isinstance(spec.materials, Mapping):
        return _resolve_materials(scope, spec.materials)
    materials: dict[str, Material | None] = {}
    documents = (context.documents.find_referenced(scope.document, text) for text in spec.materials)
    for document in {document.relative: document for document in documents if document is not None}.values():
        for name, entry in of_document(context, document).items():
            first = materials.setdefault(name, entry)
            if first is not None and entry is not None and first is not entry:
                context.report.add(
                    Code.NAME_CLASH, f"material `{name}` is defined in two documents", entry.origin,
                    help="rename one of the two materials, or list only one of the documents", path=f"materials.{name}", notes=[
                        Note(message=f"`{name}` is also defined here", span=first.origin[0]),
                        Note(message="both documents are listed here", span=scope.span(("materials",))),
                    ],
                )
    return materials


def unreadable(context: ResolveRun, scope: Scope, spec: AssemblySpec) -> bool:
    """Return whether any materials document of an assembly could not be read. If the result is True, unknown materials are not reported."""
    if scope.doubts.lacks("materials"):
        return True
    if isinstance(spec.materials, Mapping):
        return False
    named = [context.documents.find_referenced(scope.document, text) for text in spec.materials]
    return any(
        document is None or not isinstance(context.specs.get(document.relative), MaterialsSpec)
        or context.doubts(document).lacks("materials") for document in named
    )


def of_document(context: ResolveRun, document: Document) -> dict[str, Material | None]:
    """Return the materials of a `materials/1` document by name.

    The result is cached for one run. If the document is invalid, return an empty mapping.
    """
    materials = context.materials.get(document.relative)
    if materials is None:
        materials = context.materials[document.relative] = {}
        spec = context.specs.get(document.relative)
        if isinstance(spec, MaterialsSpec):
            scope = context.scope(document, {})
            materials.update(_resolve_materials(scope, spec.materials))
    return materials


def _resolve_materials(scope: Scope, specs: Mapping[str, MaterialSpec]) -> dict[str, Material | None]:
    """Resolve the materials that one document defines. A material that validation removed as invalid gets a placeholder density."""
    materials: dict[str, Material | None] = {name: material(scope, name, entry, ("materials", name)) for name, entry in specs.items()}
    for name in scope.doubts.names("materials"):
        materials.setdefault(name, Material(name=name, density=_STAND_IN, origin=scope.origin(("materials", name), key=True)))
    return materials


def material(scope: Scope, name: str, spec: MaterialSpec, path: Path) -> Material:
    """Resolve one material, including values from the library. Invalid values are reported and omitted."""
    library = None if spec.base is None else _library(scope, spec.base, (*path, "base"))
    density, base_color = library or (None, None)
    wrong = scope.doubts.touch(path) or spec.base is not None and library is None
    if spec.density is not None:
        density = scope.number(spec.density, (*path, "density"), DENSITY, f"the density of `{name}`", above=0.0, most=DENSEST)
        wrong = density is None
    slide, torsion, roll = friction(scope, spec.friction, (*path, "friction"))
    of_material = process(scope, DefaultLayers(((spec, path),)).sub("process")) if spec.process is not None else None
    return Material(
        name=name, density=_STAND_IN if wrong and density is None else density, color=spec.color or base_color, slide=slide,
        price_per_kg=spec.price_per_kg, torsion=torsion, roll=roll, process=of_material, origin=scope.origin(path, key=True),
        process_origin=scope.origin((*path, "process")) if of_material is not None else (),
        density_origin=scope.origin((*path, "density" if spec.density is not None else "base")) if density is not None else (),
    )


def friction(scope: Scope, spec: FrictionSpec | None, path: Path) -> tuple[float | None, float | None, float | None]:
    """Return the coefficients of sliding, torsional and rolling friction.

    Missing and invalid values are None. Invalid values are reported.
    """
    if spec is None:
        return None, None, None
    slide = scope.number(spec.slide, (*path, "slide"), NUMBER, "sliding friction", least=0.0)
    torsion = scope.number(spec.torsion, (*path, "torsion"), (LENGTH, NUMBER), "torsional friction", least=0.0)
    return slide, torsion, scope.number(spec.roll, (*path, "roll"), (LENGTH, NUMBER), "rolling friction", least=0.0)


def process(scope: Scope, layers: DefaultLayers) -> Process:
    """Resolve the settings of a manufacturing process.

    A missing setting is replaced by its default in `layers`. Invalid settings are reported and omitted.
    """
    settings = {key: layers.pick(key) for key in ProcessSpec.model_fields}
    values: dict[str, Any] = {key: settings[key].value for key in ("kind", "estimate")}
    values |= {key: scope.count(*settings[key], f"`{key}`") for key in ("walls", "top", "bottom")}
    values |= {key: scope.number(*settings[key], dimension, f"`{key}`", above=0.0) for key, dimension in _ABOVE_ZERO.items()}
    for key, bounds in (("infill", (0.0, 1.0)), ("overlap", (0.0, 1.0)), ("bridge_flow", BRIDGE_FLOWS)):
        values[key] = _share(scope, *settings[key], key, *bounds)
    origins = {key: scope.origin(setting.path) for key, setting in settings.items() if setting}
    removed = {key for key in values for _, path in layers.items if scope.doubts.touch((*path, key))}
    wrong = frozenset(key for key, value in values.items() if value is None and (key in origins or key in removed))
    return Process(**values, origins=origins, wrong=wrong)


def _share(scope: Scope, raw: Any, path: Path, key: str, least: float, most: float) -> float | None:
    value = scope.number(raw, path, NUMBER, f"`{key}`")
    if value is not None and not least <= value <= most:
        text = scope.source_text(path) or f"{value:g}"
        help = f"write `{text} %`" if most < value <= 100.0 * most and not text.startswith("=") and "%" not in text else None
        scope.error(
            Code.OUT_OF_RANGE, f"`{key}` must be between {100.0 * least:g} % and {100.0 * most:g} %, found `{text}`", path, help=help,
        )
        return None
    return value


_BASE = re.compile(r"bd_materials:(.*)")


def _library(scope: Scope, text: str, path: Path) -> tuple[float, str | None] | None:
    """Return the density [kg/m^3] and the colour of a material `bd_materials:NAME`, which is read from the library `bd_materials`.

    If the name is unknown, report an error and return None.
    """
    match = _BASE.fullmatch(text.strip())
    if match is None:
        scope.error(
            Code.REFERENCE, f"expected a library material `bd_materials:NAME`, found `{shorten(text)}`", path,
            help=f"write, for example, `bd_materials:{shorten(text.strip().rpartition(':')[2]) or 'abs'}`",
        )
        return None
    try:
        import bd_materials
    except ImportError:
        scope.error(Code.LIBRARY, f"`{shorten(text)}` requires the package `bd_materials`, which is not installed", path,
                    help="install the package, or use `density` and `color` instead of `base`")
        return None
    name = match.group(1).strip()
    try:
        entry = bd_materials.resolve(name)
    except ValueError:
        scope.error(
            Code.UNKNOWN_MATERIAL, f"the library `bd_materials` has no material `{shorten(name)}`", path,
            help=did_you_mean(name, bd_materials.material_names(), what="library materials"),
        )
        return None
    color = entry.color
    return float(entry.material.density), color if isinstance(color, str) and re.fullmatch("#[0-9a-f]{6}", color) else None


