"""Resolve the values of a document that override properties of a part, such as mass, material or collision shape, and added mounts."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, Literal

from thingc.base.diagnostics import Code
from thingc.base.inertia import HEAVIEST, LARGEST_MOMENT
from thingc.base.interfaces import Bolts, Bore, Boss, Connector, MatingFeature, Shank
from thingc.base.numeric import tau
from thingc.base.pose import NO_POSE
from thingc.base.source import Path
from thingc.base.suggestions import did_you_mean
from thingc.base.units import ANGLE, INERTIA, LENGTH, MASS
from thingc.documents.spec.interfaces import InterfaceSpec
from thingc.documents.spec.link_shapes import ChoiceSpec, CollisionSpec, DecomposeSpec
from thingc.documents.spec.mass import CentreOfMassSpec, InertiaSpec, MassSpec
from thingc.model.resolve.document_scope import ComponentScope
from thingc.model.resolve.materials import process
from thingc.model.resolve.plausibility import LARGEST
from thingc.model.resolve.references import ORIGIN, suggest
from thingc.model.resolve.repeats import check_names
from thingc.model.resolve.scope import DefaultLayers, LayeredValue, Scope
from thingc.model.resolve.types import CollisionChoice, ExtraMount, Material, Overrides, StatedValue

NO_OVERRIDES = Overrides()

_FEATURES: dict[str, Callable[..., MatingFeature]] = {"bolts": Bolts, "bore": Bore, "boss": Boss, "shank": Shank}
"""The classes of mating features, by key of an interface."""
_SIGNED = ("at", "clearance", "start")
"""Values of mating features that may be negative."""

MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""The entries of an inertia matrix, in the order of resolved values."""

_OF_PARTS = ("material", "mass", "com", "inertia", "collision", "visual", "process", "print", "bom")
"""Keys of a component that are valid only for a part or a frame."""


def refuse_on_assembly(node: ComponentScope) -> None:
    """Report errors for overrides, such as `mass`, of a nested assembly.

    Such an override is ambiguous, because it could apply to any component of the assembly.
    """
    for key in _OF_PARTS:
        entire = key == "bom" and node.spec.bom is not None and node.spec.bom.as_ is not None
        if key in node.spec.model_fields_set and getattr(node.spec, key) is not None and not entire:
            help = "set the key on a component of the nested document"
            node.scope.error(
                Code.OVERRIDE, f"`{key}` cannot be set on the nested assembly `{node.name}`", (*node.path, key), key=True,
                help="add `as: one` to list the assembly as one bought part" if key == "bom" else help,
                notes=node.scope.second_note(f"`{node.name}` is defined as an assembly here", (*node.path, "assembly"), (*node.path, key)),
            )


def overrides(scope: Scope, layers: DefaultLayers, modes: Collection[str]) -> Overrides:
    """Return the overrides of a component, such as mass and collision shape. The material is not included.

    Overrides of the component are merged with the defaults in `layers`, key by key. Invalid values are reported and omitted. `modes`
    contains the names of the modes of the document.
    """
    mass, com, inertia = _mass(scope, layers), _com(scope, layers), _inertia(scope, layers)
    collision, visual = layers.pick("collision"), layers.pick("visual")
    choice = _choice(scope, *collision) if collision else CollisionChoice()
    variants = collision.value.variants if isinstance(collision.value, CollisionSpec) else {}
    for key, name in variants:
        if key == "modes" and name not in modes:
            help = suggest(name, modes, what="modes")
            scope.error(Code.UNKNOWN_MODE, f"there is no mode `{name}`", (*collision.path, key, name), key=True, help=help)
    process_layers, zero = layers.sub("process"), "`up` must not be zero, found `0 0 0`"
    raw, path = layers.sub("print").pick("up")
    up = raw if raw == "auto" else scope.direction(raw, path, "a component of `up`", Code.OUT_OF_RANGE, zero, "up: [0, 0, 1]")
    if not any((mass, com, inertia, collision, visual, up, process_layers)):
        return NO_OVERRIDES
    return Overrides(
        mass=mass, com=com, inertia=inertia, collision=choice.collision, pieces=choice.pieces,
        variants={inner: _choice(scope, spec, (*collision.path, *inner)) for inner, spec in variants.items()},
        visual=visual.value if visual else True, process=process(scope, process_layers) if process_layers else None, up=up,
    )


def _choice(scope: Scope, spec: str | ChoiceSpec, path: Path) -> CollisionChoice:
    """Return collision shapes, without lists of shapes."""
    if isinstance(spec, str):
        return CollisionChoice(collision=spec)
    if spec.shapes is not None:
        return CollisionChoice(collision="shapes")
    if spec.decompose is not None:
        return CollisionChoice(collision="decompose", pieces=most_pieces(scope, spec.decompose, (*path, "decompose")))
    return CollisionChoice(collision=(spec.kind if isinstance(spec, CollisionSpec) else None) or "hull")


def most_pieces(scope: Scope, spec: DecomposeSpec | Literal[True] | None, path: Path) -> int:
    """Return the largest number of convex pieces, or 0 for any number. An invalid number is reported."""
    if not isinstance(spec, DecomposeSpec) or spec.pieces is None:
        return 0
    return scope.count(spec.pieces, (*path, "pieces"), "`pieces`", least=1) or 0


def _with_source(setting: LayeredValue) -> tuple[LayeredValue, str]:
    """Return the mass, the centre of mass or the inertia in a setting, and its source, which the long form of the setting contains."""
    if isinstance(setting.value, (MassSpec, CentreOfMassSpec, InertiaSpec)):
        return LayeredValue(setting.value.value, (*setting.path, "value")), setting.value.source
    return setting, "stated"


def _mass(scope: Scope, layers: DefaultLayers) -> StatedValue | None:
    setting = layers.pick("mass")
    if not setting:
        return None
    stated, source = _with_source(setting)
    value = scope.number(*stated, MASS, "the mass", above=0.0, most=HEAVIEST)
    # Replace invalid values by a placeholder, so that no later pass reports the values as missing.
    return StatedValue(value=(1.0 if value is None else value,), source=source, origin=scope.origin(setting.path), stand_in=value is None)


def _com(scope: Scope, layers: DefaultLayers) -> StatedValue | None:
    setting = layers.pick("com")
    stated, source = _with_source(setting)
    value = scope.vector(*stated, LENGTH, "the centre of mass")
    return None if value is None else StatedValue(value=value, source=source, origin=scope.origin(setting.path))


def _inertia(scope: Scope, layers: DefaultLayers) -> StatedValue | None:
    setting = layers.pick("inertia")
    if not setting:
        return None
    (matrix, at), source = _with_source(setting)
    values = [
        scope.number(getattr(matrix, key), (*at, key), INERTIA, f"`{key}`", least=-LARGEST_MOMENT, most=LARGEST_MOMENT) for key in MOMENTS
    ]
    sound = tuple(value for value in values if value is not None)
    return StatedValue(value=sound, source=source, origin=scope.origin(setting.path)) if len(sound) == len(MOMENTS) else None


def material(scope: Scope, layers: DefaultLayers, known: dict[str, Material | None], *, unreadable: bool) -> Material | None:
    """Return the material that the document specifies for a component, or None.

    An unknown material is reported, unless a materials document could not be read.
    """
    name, path = layers.pick("material")
    if name is None:
        return None
    if name in known:
        return known[name]
    if not unreadable:
        help = did_you_mean(name, known, what="materials")
        if not known:
            help = "list a materials document: `materials: [materials.yaml]`"
        scope.error(Code.UNKNOWN_MATERIAL, f"there is no material `{name}` in the document or its `materials`", path, help=help)
    # Return a placeholder with a density, so that no later pass reports the density as missing.
    return Material(name=name, density=1000.0, origin=scope.origin(path))


def extra_mounts(node: ComponentScope) -> dict[str, ExtraMount]:
    """Return the mounts that the document adds to a component.

    A mount with an invalid pose is reported, and placed at the origin of the component. A mount with a reserved name is reported and
    returned, so that references to the mount remain valid.
    """
    scope = node.scope
    path: Path = (*node.path, "mounts")
    check_names(scope, [(name, (*path, name), "a mount") for name in node.spec.mounts])
    mounts: dict[str, ExtraMount] = {}
    for name, spec in node.spec.mounts.items():
        if name == ORIGIN:  # every component has this mount
            continue
        at = (*path, name)
        pose = scope.pose(spec, at)
        interface = spec.interface if isinstance(spec.interface, InterfaceSpec) else InterfaceSpec(name=spec.interface)
        features = _features(scope, interface, (*at, "interface"))
        tolerance = scope.number(spec.tolerance, (*at, "tolerance"), LENGTH, "`tolerance`", least=0.0)
        mounts[name] = ExtraMount(
            pose=pose or NO_POSE, interface=interface.name, tolerance=tolerance, features=features, origin=scope.origin(at, key=True),
        )
    return mounts


def _features(scope: Scope, spec: InterfaceSpec, path: Path) -> tuple[MatingFeature, ...]:
    """Return the mating features of the interface at `path`. Invalid features are reported and omitted."""
    features: list[MatingFeature] = [Connector(spec.connector, spec.side, spec.counterpart)] if spec.connector is not None else []
    for key, create in _FEATURES.items():
        feature = getattr(spec, key)
        values = {name: _feature_value(scope, name, raw, (*path, key, name)) for name, raw in feature or () if raw is not None}
        if feature is not None and None not in values.values():
            try:
                features.append(create(**values))
                features[-1].check_lengths()
            except ValueError as error:
                scope.error(Code.OUT_OF_RANGE, str(error), (*path, key))
    return tuple(features)


def _feature_value(scope: Scope, name: str, raw: Any, path: Path) -> Any:
    """Return a value of a feature in SI units. An invalid value is reported, and None is returned."""
    if isinstance(raw, list):
        values = tuple(_feature_value(scope, name, one, (*path, index)) for index, one in enumerate(raw))
        return None if None in values else values
    if name == "thread":
        return raw
    if name == "count":
        return scope.count(raw, path, "`count`", least=1)
    dimension, most = (ANGLE, tau) if name == "start" else (LENGTH, LARGEST)
    above, least = (None, -most) if name in _SIGNED else (0.0, None)
    return scope.number(raw, path, dimension, f"`{name}`", above=above, least=least, most=most)
