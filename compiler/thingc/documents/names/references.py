"""Find the names to which the strings in a document refer.

The field types of document models determine the kind of name to which a string refers (`document_names.py`). The documents are not compiled
and may contain other errors.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from thingc.base.filesystem import without_suffix
from thingc.base.source import MappingNode, Path, ScalarNode, entries_of, node_at
from thingc.documents.expressions.parsing import parse_expression
from thingc.documents.expressions.terms import ExpressionError
from thingc.documents.load.paths import resolve_path
from thingc.documents.names.document_names import GLOB, SPECIAL, DocumentNames, NameOccurrence, pattern_of, referenced_kind, setting_words
from thingc.documents.names.part_names import Name, NamePlace, PartClass, PartNames, Role
from thingc.documents.spec.name_types import DeclaresName, ReferenceKind, RefersTo

Hit = tuple[int, int, Name, Role]
"""An occurrence of a name in a string: the start, the end (exclusive), the name, and the role of the name."""
Word = tuple[int, str]
"""A name in a dotted reference: its start index and its text."""


def _shift_hits(offset: int, hits: Iterable[Hit]) -> Iterator[Hit]:
    """Convert positions in a substring to positions in the whole string, given the start index `offset` of the substring."""
    return ((offset + start, offset + end, name, role) for start, end, name, role in hits)


def _split_words(text: str) -> list[Word]:
    """Split a dotted reference into its words."""
    words, offset = [], 0
    for word in text.split("."):
        words.append((offset, word))
        offset += len(word) + 1
    return words


class NameReader:
    """Resolves the names in the strings of the document `source`.

    `documents` contains all documents of the workspace by absolute path. Most methods have a parameter `scope`: the assembly document whose
    names a reference uses. For a reference inside a repeat, `index` is the name of the repeat index; otherwise it is empty.
    """

    def __init__(self, documents: Mapping[str, DocumentNames], parts: PartNames, source: DocumentNames) -> None:
        self.documents = documents
        self.parts = parts
        self.source = source
        self.base: DocumentNames | None = source
        """The assembly to which names belong. For a variants document, the assembly that the variants modify."""
        if source.document.kind == "variants":
            self.base = self.document(source, source.text("assembly"))

    def places(self) -> Iterator[NamePlace]:
        """Yield the location of every declaration and every use of a name in the document."""
        for occurrence in self.source.occurrences:
            spans = [self.source.span_of(occurrence)]
            parent = node_at(self.source.document.tree, occurrence.path[:-1])
            if occurrence.key and isinstance(parent, MappingNode):  # TOML repeats a key in every header below it
                spans += [span for key, span in parent.again if key == occurrence.path[-1]]
            for start, end, name, role in self.hits(occurrence):
                for span in spans:
                    exact = self.source.narrow_span(span, occurrence.text, start, end)
                    yield NamePlace(name, exact or span, role if exact is not None else "fits")

    def hits(self, occurrence: NameOccurrence) -> Iterator[Hit]:
        """Yield the names that a string of the document declares or refers to."""
        scope, path, text = self.source, occurrence.path, occurrence.text
        index = scope.repeat_index(path)
        if index and "$" in text:
            for use in re.finditer(rf"\$\{{?({index})(?![A-Za-z0-9])", text):
                yield use.start(1), use.end(1), self.declared_name("index", index, path), "used"
        if isinstance(occurrence.names, DeclaresName):
            yield 0, len(text), self.declared_name(occurrence.names.kind, text, path), "declared"
            if occurrence.names.kind == "sensor" and scope.text(*path, "type") == "joint" and scope.text(*path, "joint") is None:
                yield from self.joints(scope, text, "")
            return
        yield from self.find_names(self.base, occurrence.names.kind, text, path, index)

    def declared_name(self, kind: str, text: str, path: Path) -> Name:
        """Return the name that a key or a string of this document declares."""
        owner = f"{path[0]}.{path[1]}" if kind in ("index", "mount") else ""
        return Name(kind, self.source.path, text, owner)

    def find_names(self, base: DocumentNames | None, kind: ReferenceKind, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names in the assembly `base` to which the string at `path` refers."""
        match kind:
            case "assembly document":
                yield from self._document(self.document(self.source, text), text)
            case "materials document":
                yield from self._document(self.document(self.source, text) or self.find_packaged(text), text)
            case "part":
                yield from self._part(text)
            case _ if base is None:
                return
            case "expression":
                yield from self.expression(base, text, path, index)
            case "rule":
                yield from self.rule(base, text)
            case "setting":
                yield from self.setting(base, text, 0)
            case "choice":
                yield from self.choice(base, text, path)
            case "raw":
                yield from self.raw(base, text, path)
            case "component":
                yield from self.components(base, _split_words(text), index)
            case "mount" | "mount or export" | "root":
                yield from self.mount(base, text, index, kind)
            case "mount of its own":
                yield from self.own_mount(base, text, path, index)
            case "joint" | "coordinate":
                yield from self.joints(base, text, index)
            case "coordinate or tendon":
                yield from self.joints(base, text, index)
                yield from self.in_section(base, "tendon", text)
            case "joint or nested assembly":
                yield from self.find_pose_names(base, text, path, index)
            case "pose of a nested assembly":
                for inner in self.components_of(base, _split_words(str(path[-1])), index):
                    yield from self.in_section(self.find_nested(*inner), "pose", text)
            case "pose" | "poses" | "mode" | "modes" | "motion" | "tendon":
                yield from self.in_section(base, kind.removesuffix("s"), text)
            case "sensor":
                yield from self.in_section(base, "sensor", text.partition(":")[0])
            case "material":
                yield from self.material(base, text)
            case "parameter of a nested assembly" | "mode of a nested assembly" | "pose of this nested assembly":
                yield from self.in_section(self.find_nested(base, str(path[1])), kind.partition(" ")[0], text)
            case "parameter of a part":
                if (thing := self.thing(base, str(path[1]))) is not None:
                    yield 0, len(text), thing.parameter(text), "used"

    def find_pose_names(self, base: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names in a key of a pose: a joint, or a nested assembly whose pose is used. `path` is the path of the value."""
        node = node_at(self.source.document.tree, path)
        names_pose = isinstance(node, ScalarNode) and isinstance(node.value, str) and re.fullmatch(r"\s*[A-Za-z]\w*\s*", node.value)
        exact = list(self.exact_joint(base, text, index))
        yield from exact or (self.components(base, _split_words(text), index) if names_pose else self.joints(base, text, index))

    # --- documents and parts ----------------------------------------------------------------------------------------

    def document(self, referring: DocumentNames, text: str | None) -> DocumentNames | None:
        """Return the document to which the path `text` in the document `referring` points, or None."""
        return self.documents.get(resolve_path(text, referring.path) or "") if text else None

    def find_packaged(self, text: str) -> DocumentNames | None:
        """Return the document of a package with the dotted name `package.document`."""
        end = os.sep + text.replace(".", os.sep) + "."
        return next((document for path, document in self.documents.items() if f"{without_suffix(path)}.".endswith(end)), None)

    def find_nested(self, scope: DocumentNames, component: str) -> DocumentNames | None:
        """Return the document of a component that is a nested assembly, or None."""
        return self.document(scope, scope.text("components", component, "assembly"))

    def thing(self, scope: DocumentNames, component: str) -> PartClass | None:
        """Return the part class of a component with the key `part`, or None."""
        reference = scope.text("components", component, "part")
        return self.parts.thing(reference) if reference is not None else None

    def _document(self, target: DocumentNames | None, text: str) -> Iterator[Hit]:
        if target is not None:
            yield 0, len(text), Name("document", target.path, os.path.basename(target.path)), "fits"

    def _part(self, reference: str) -> Iterator[Hit]:
        thing = self.parts.thing(reference)
        if thing is not None:
            start = reference.rfind(":") + 1
            yield start, len(reference), Name("part", thing.file, reference[start:]), "used"

    # --- references -------------------------------------------------------------------------------------------------

    def components_of(self, scope: DocumentNames, words: Sequence[Word], index: str) -> list[tuple[DocumentNames, str]]:
        """Return the components that a dotted reference selects. Each item is the document of the component and its key there.

        Each word after the first names a component of the nested assembly that the previous word selects.
        """
        level = [scope]
        selected: list[tuple[DocumentNames, str]] = []
        for depth, (_, word) in enumerate(words):
            selected = [(outer, key) for outer in level for key in outer.matching_keys("components", word, index if not depth else "")]
            level = [inner for outer, key in selected if (inner := self.find_nested(outer, key)) is not None]
        return selected

    def components(self, scope: DocumentNames, words: Sequence[Word], index: str) -> Iterator[Hit]:
        """Yield the existing components to which each of the `words` of a dotted reference refers."""
        for depth, (start, word) in enumerate(words):
            for document, key in self.components_of(scope, words[: depth + 1], index):
                yield self._hit(document, "components", key, start, word)

    def _hit(self, scope: DocumentNames, section: str, key: str, start: int, word: str) -> Hit:
        stem = scope.starts_with_key(section, key, word)
        return start, start + (len(key) if stem else len(word)), Name(section[:-1], scope.path, key), "used" if stem else "fits"

    def mount(self, scope: DocumentNames, text: str, index: str, kind: str) -> Iterator[Hit]:
        """Yield the names to which a reference `component.mount` refers.

        If `kind` is not "mount", the reference can also be an exported mount. If it is "root", it can also be a component.
        """
        *words, (start, last) = _split_words(text)
        if not words:
            if kind != "mount" and last in scope.section("mounts"):
                yield 0, len(text), Name("export", scope.path, text), "used"
            elif kind == "root":
                yield from self.components(scope, [(start, last)], index)
            return
        yield from self.components(scope, words, index)
        has_mount = False
        owners = self.components_of(scope, words, index)
        for owner, key in owners:
            for hit in _shift_hits(start, self.of_component(owner, key, last, index)):
                has_mount = True
                yield hit
        if kind == "root" and not has_mount:
            for owner, key in owners:
                if (nested := self.find_nested(owner, key)) is not None:
                    yield from self.components(nested, [(start, last)], "")

    def of_component(self, scope: DocumentNames, key: str, word: str, index: str) -> Iterator[Hit]:
        """Yield the mounts of the component `key` that match `word`, the last word of a reference.

        A mount is added by the document, exported by the nested assembly, or declared by the part class.
        """
        added = node_at(scope.document.tree, ("components", key, "mounts"))
        pattern = pattern_of(word, index)
        for mount in entries_of(added):
            if pattern.match(mount):
                yield 0, len(word), Name("mount", scope.path, mount, f"components.{key}"), "used" if mount == word else "fits"
        if (nested := self.find_nested(scope, key)) is not None:
            for mount in nested.section("mounts"):
                if pattern.match(mount):
                    yield 0, len(word), Name("export", nested.path, mount), "used" if mount == word else "fits"
        elif (thing := self.thing(scope, key)) is not None and word != "origin":
            special = SPECIAL.search(word)
            for name in thing.mounts(word if special is None else word[: special.start()], pattern if special is not None else None):
                stem = word.startswith(name.text)
                yield 0, len(name.text) if stem else len(word), name, "used" if stem else "fits"

    def own_mount(self, scope: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names in a key of `attach`, which refers to a mount of the component: `back`, or `cap.pen` of a nested assembly."""
        key = str(path[1])
        if "." not in text:
            yield from self.of_component(scope, key, text, index)
        elif (nested := self.find_nested(scope, key)) is not None:
            yield from self.mount(nested, text, index, "mount")

    def exact_joint(self, scope: DocumentNames, text: str, index: str) -> Iterator[Hit]:
        """Yield the joint, and its parent components, to which a string such as `hand.finger` or `wrist[0]` refers.

        Yield nothing for a pattern.
        """
        *words, (start, last) = _split_words(re.sub(r"\[\d+\]$", "", text))
        if any(GLOB.search(word) for _, word in (*words, (start, last))):
            return
        owners = [scope]
        if words:
            components = self.components_of(scope, words, index)
            owners = [inner for document, key in components if (inner := self.find_nested(document, key)) is not None]
        keys = [(owner, key) for owner in owners for key in owner.matching_keys("joints", last, index)]
        if keys:
            yield from self.components(scope, words, index)
            for owner, key in keys:
                yield self._hit(owner, "joints", key, start, last)

    def joints(self, scope: DocumentNames, text: str, index: str) -> Iterator[Hit]:
        """Yield the joints that a name or a pattern matches. In a pattern, `*` also matches dots."""
        exact = list(self.exact_joint(scope, text, index))
        if exact or not GLOB.search(text):
            yield from exact
            return
        pattern, words = pattern_of(text, index), _split_words(text)
        for chain in self.all_joints(scope, ()):
            if not any(pattern.match(item) or pattern.match(f"{item}[0]") for item in _item_names(chain)):
                continue
            if len(words) == len(chain) and all(step[0].matching_keys(step[1], word) for step, (_, word) in zip(chain, words, strict=True)):
                for (document, section, key), (start, word) in zip(chain, words, strict=True):
                    if key in document.matching_keys(section, word):
                        yield self._hit(document, section, key, start, word)
            else:
                for document, section, key in chain:
                    yield 0, len(text), Name(section[:-1], document.path, key), "fits"

    def all_joints(
        self, scope: DocumentNames, chain: tuple[tuple[DocumentNames, str, str], ...],
    ) -> Iterator[tuple[tuple[DocumentNames, str, str], ...]]:
        """Yield every joint of an assembly and of its nested assemblies.

        Each item is the chain of nested components that leads to the joint, followed by the joint. Each element of a chain is a document,
        a section (`components` or `joints`) and a key. `chain` contains the components that lead to `scope`.
        """
        for key in scope.section("joints"):
            yield (*chain, (scope, "joints", key))
        for key in scope.section("components"):
            inner = self.find_nested(scope, key)
            if inner is not None and all(inner is not enclosing for enclosing, _, _ in chain) and inner is not scope:
                yield from self.all_joints(inner, (*chain, (scope, "components", key)))

    def in_section(self, scope: DocumentNames | None, kind: str, text: str) -> Iterator[Hit]:
        """Yield the names in one section, for example `poses`, that match a string. Yield nothing if the document is None."""
        if scope is None:
            return
        entries = scope.section(f"{kind}s")
        if text in entries:
            yield 0, len(text), Name(kind, scope.path, text), "used"
        elif GLOB.search(text):
            for key in entries:
                if pattern_of(text, "").match(key):
                    yield 0, len(text), Name(kind, scope.path, key), "fits"

    def material(self, scope: DocumentNames, text: str) -> Iterator[Hit]:
        """Yield the material `text`, which the document or one of its materials documents defines."""
        node = scope.document.tree.entries.get("materials")
        sources = [scope]
        if not isinstance(node, MappingNode):
            texts = [one.value for one in getattr(node, "items", ()) if isinstance(one, ScalarNode) and isinstance(one.value, str)]
            sources = [one for text in texts if (one := self.document(scope, text) or self.find_packaged(text)) is not None]
        for source in sources:
            if text in source.section("materials"):
                yield 0, len(text), Name("material", source.path, text), "used"
                return

    # --- values -----------------------------------------------------------------------------------------------------

    def expression(self, scope: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the parameters and the repeat index that an expression uses."""
        try:
            uses = parse_expression(text).names
        except ExpressionError:
            return
        for use in uses:
            if index and use.name == index:
                yield use.offset, use.end, self.declared_name("index", index, path), "used"
            elif use.name in scope.section("parameters"):
                yield use.offset, use.end, Name("parameter", scope.path, use.name), "used"

    def rule(self, scope: DocumentNames, text: str) -> Iterator[Hit]:
        """Yield the names in a rule, which is a comparison of parameters, settings and results."""
        try:
            uses = parse_expression(text, dotted=True).names
        except ExpressionError:
            return
        for use in uses:
            name, offset = use.name, use.offset
            for prefix in ("parameters.", "results."):
                if name.startswith(prefix):
                    name, offset = name.removeprefix(prefix), offset + len(prefix)
            if name.startswith("length."):
                yield from _shift_hits(offset + len("length."), self.joints(scope, name.removeprefix("length."), ""))
            else:
                yield from self.setting(scope, name, offset)

    def setting(self, scope: DocumentNames, text: str, offset: int) -> Iterator[Hit]:
        """Yield the names in a setting, which is a parameter or the path of another value (`joints.elbow.limit.upper`).

        Positions are relative to a string that contains the setting at `offset`.
        """
        if "." not in text:
            yield from _shift_hits(offset, self.in_section(scope, "parameter", text))
            return
        for word in setting_words(text):
            nested = self._through(scope, word.through)
            if nested is None:
                return
            inside = NameReader(self.documents, self.parts, nested)
            yield from _shift_hits(offset + word.offset, inside.key(word.path, str(word.path[-1]), word.names))

    def key(self, path: Path, text: str, names: DeclaresName | RefersTo) -> Iterator[Hit]:
        """Yield the names that the key `text` at `path` would declare or refer to. The document need not contain the key."""
        if isinstance(names, RefersTo):
            keys = self.source.matching_keys("components", str(path[1])) if path[0] == "components" and len(path) > 2 else [path[1]]
            for entry in keys:
                yield from self.find_names(self.source, names.kind, text, (path[0], entry, *path[2:]), "")
        elif path[0] in ("components", "joints") and len(path) == 2:
            section = str(path[0])
            for entry in self.source.matching_keys(section, text) or ([text] if text in self.source.section(section) else []):
                yield self._hit(self.source, section, entry, 0, text)
        elif node_at(self.source.document.tree, path) is not None:
            yield 0, len(text), self.declared_name(names.kind, text, path), "used"

    def _through(self, scope: DocumentNames, components: Iterable[str]) -> DocumentNames | None:
        document: DocumentNames | None = scope
        for word in components:
            if document is None:
                return None
            keys = document.matching_keys("components", word) or [word]
            document = self.find_nested(document, keys[0])
        return document

    def choice(self, scope: DocumentNames, text: str, path: Path) -> Iterator[Hit]:
        """Yield the part, document or material that a choice selects.

        The path of the choice determines whether the string names a part, a document or a material.
        """
        chosen = next(step for step in reversed(path) if isinstance(step, str))
        kind = chosen.rpartition(".")[2]
        if kind == "part":
            yield from self._part(text)
        elif kind == "assembly":
            yield from self._document(self.document(self.source, text), text)
        elif kind == "material":
            components = re.findall(r"components\.(\w+)", chosen)
            inner = self._through(scope, components if chosen.endswith("defaults.component.material") else components[:-1])
            if inner is not None:
                yield from self.material(inner, text)

    def raw(self, scope: DocumentNames, text: str, path: Path) -> Iterator[Hit]:
        """Yield the names in the path of an element in output files, such as `hand/finger`."""
        kind = referenced_kind(path) or "" if path[2] == "add" else str(path[2])
        dotted = text.replace("/", ".")
        candidates: list[list[Hit]] = []
        if kind == "default":
            return
        if kind in (sections := {"key": "pose", "sensor": "sensor", "camera": "sensor", "tendon": "tendon", "actuator": "tendon"}):
            candidates.append(list(self.in_section(scope, sections[kind], text)))
        if kind == "material":
            candidates.append(list(self.material(scope, text)))
        if kind not in ("joint", "actuator"):
            candidates.append(list(self.in_section(scope, "link", text)))
            candidates.append(list(self.mount(scope, dotted, "", "mount or export")) if kind in ("site", "link", "object") else [])
            candidates.append(list(self.components(scope, _split_words(dotted), "")))
        candidates += list(self.exact_joint(scope, dotted, "")), list(self.exact_joint(scope, re.sub(r"_\d+$", "", dotted), ""))
        yield from next(filter(None, candidates), [])


def _item_names(chain: Sequence[tuple[DocumentNames, str, str]]) -> Iterator[str]:
    """Yield the dotted names of all joints that the last element of `chain` creates (`leg_0.knee`), including items of repeats."""
    (scope, section, key), *following = chain
    for item in scope.item_names(section, key):
        yield from (f"{item}.{inner}" for inner in _item_names(following)) if following else (item,)
