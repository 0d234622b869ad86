"""What a floating mode stands on: mounts that the floor pushes, and does not hold."""

from __future__ import annotations

from thingc.base.diagnostics import Code
from thingc.base.joints.bases import BaseType
from thingc.base.source import Path
from thingc.base.units import NUMBER
from thingc.documents.spec.modes import StandingSpec
from thingc.model.resolve import references
from thingc.model.resolve.defaults import DefaultLayers
from thingc.model.resolve.document_scope import DocumentScope
from thingc.model.resolve.references import GLOB, suggested
from thingc.model.resolve.scope import Scope
from thingc.model.resolve.types import Reference, Standing


def standing(table: DocumentScope, scope: Scope, name: str, layers: DefaultLayers, base: BaseType) -> Standing | None:
    """The mounts under `standing_on`, each once, and the friction that is stated, as far as they are sound (else reported); None where
    there are none."""
    said = layers.pick("standing_on")
    if said is None or said[0] == []:
        return None
    written, path = said
    if base != "free":
        scope.error(
            Code.STANDING, f"mode `{name}` stands on mounts, and its base is `{base}`: that carries it already", path,
            help="write `base: free`, or take `standing_on` out",
        )
        return None
    texts, friction = written, None
    if isinstance(written, StandingSpec):
        texts = written.mounts
        if written.friction is not None:
            friction = scope.number(written.friction, (*path, "friction"), NUMBER, "the friction", least=0.0)
        path = (*path, "mounts")
    mounts: dict[tuple[tuple[str, ...], str | None], Reference] = {}
    for index, text in enumerate(texts):
        for reference in mounts_fitting(table, scope, text, (*path, index)):
            mounts.setdefault((reference.path, reference.mount), reference)
    return Standing(mounts=tuple(mounts.values()), friction=friction, origin=scope.origin(path))


def mounts_fitting(table: DocumentScope, scope: Scope, text: str, path: Path) -> list[Reference]:
    """The mounts that a name or pattern fits: those that the document exports by their names, else `components.mount`."""
    if not GLOB.search(text):
        reference = references.shown_mount(table, scope, text, path)
        return [reference] if reference is not None else []
    components, _, mount = text.rpartition(".")
    fitting = [f"{name}.{mount}" for name, _ in references.matching(table, components)]
    if not fitting and not table.unbuilt:
        scope.error(
            Code.NO_MATCH, f"pattern `{text}` fits no mount", path,
            help=suggested(components, table.nodes, what="components") if components else "write for example `leg_*.sole`",
        )
    shown = (references.shown_mount(table, scope, one, path) for one in fitting)
    return [one for one in shown if one is not None]
