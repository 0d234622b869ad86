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
from thingc.documents.names.document_names import (
    GLOB,
    SPECIAL,
    DocumentNames,
    NameOccurrence,
    pattern_of,
    referenced_element,
    setting_words,
)
from thingc.documents.names.part_names import Name, NamePlace, PartClass, PartNames, Role
from thingc.documents.spec.name_types import DeclaresName, ReferenceKind, RefersTo

Hit = tuple[int, int, Name, Role]
"""An occurrence of a name in a string: the start, the end (exclusive), the name, and the role of the name."""
Word = tuple[int, str]
"""A word of a string and its start index."""


def _shift_hits(offset: int, hits: Iterable[Hit]) -> Iterator[Hit]:
    """Convert the positions of names in a substring to positions in the whole string, which contains the substring at `offset`."""
    return ((offset + start, offset + end, name, role) for start, end, name, role in hits)


def _words(text: str) -> list[Word]:
    words, offset = [], 0
    for word in text.split("."):
        words.append((offset, word))
        offset += len(word) + 1
    return words


class NameReader:
    """Resolves the names in the strings of one document."""

    def __init__(self, documents: Mapping[str, DocumentNames], parts: PartNames, own: DocumentNames) -> None:
        self.documents = documents
        self.parts = parts
        self.own = own
        self.base: DocumentNames | None = own
        """The assembly to which names belong. For a variants document, the assembly that the variants modify."""
        if own.document.kind == "variants":
            self.base = self.document(own, own.text("assembly"))

    def places(self) -> Iterator[NamePlace]:
        """Yield the location of every declaration and every use of a name in the document."""
        for mention in self.own.mentions:
            spans = [self.own.around(mention)]
            parent = node_at(self.own.document.tree, mention.path[:-1])
            if mention.key and isinstance(parent, MappingNode):  # TOML repeats a key in every header below it
                spans += [span for key, span in parent.again if key == mention.path[-1]]
            for start, end, name, role in self.hits(mention):
                for span in spans:
                    exact = self.own.place(span, mention.text, start, end)
                    yield NamePlace(name, exact or span, role if exact is not None else "fits")

    def hits(self, mention: NameOccurrence) -> Iterator[Hit]:
        """Yield the names that a string of the document declares or refers to."""
        written, path, text = self.own, mention.path, mention.text
        index = written.index_of(path)
        if index and "$" in text:
            for use in re.finditer(rf"\$\{{?({index})(?![A-Za-z0-9])", text):
                yield use.start(1), use.end(1), self.own_name("index", index, path), "used"
        if isinstance(mention.names, DeclaresName):
            yield 0, len(text), self.own_name(mention.names.what, text, path), "declared"
            if mention.names.what == "sensor" and written.text(*path, "type") == "joint" and written.text(*path, "joint") is None:
                yield from self.joints(written, text, "")
            return
        yield from self.find_names(self.base, mention.names.what, text, path, index)

    def own_name(self, what: str, text: str, path: Path) -> Name:
        """Return the name that a key or a string of this document declares."""
        owner = f"{path[0]}.{path[1]}" if what in ("index", "mount") else ""
        return Name(what, self.own.path, text, owner)

    def find_names(self, base: DocumentNames | None, what: ReferenceKind, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names in the assembly `base` to which the string at `path` refers."""
        match what:
            case "assembly document":
                yield from self._document(self.document(self.own, text), text)
            case "materials document":
                yield from self._document(self.document(self.own, text) or self.find_packaged(text), text)
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
                yield from self.components(base, _words(text), index)
            case "mount" | "mount or export" | "root":
                yield from self.mount(base, text, index, what)
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
                for inner in self.components_of(base, [word for _, word in _words(str(path[-1]))], index):
                    yield from self.in_section(self.find_nested(*inner), "pose", text)
            case "pose" | "poses" | "mode" | "modes" | "motion" | "tendon":
                yield from self.in_section(base, what.removesuffix("s"), text)
            case "sensor":
                yield from self.in_section(base, "sensor", text.partition(":")[0])
            case "material":
                yield from self.material(base, text)
            case "parameter of a nested assembly" | "mode of a nested assembly":
                yield from self.in_section(self.find_nested(base, str(path[1])), what.partition(" ")[0], text)
            case "parameter of a part":
                if (thing := self.thing(base, str(path[1]))) is not None:
                    yield 0, len(text), thing.parameter(text), "used"

    def find_pose_names(self, base: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names to which the key of a pose at `path` refers: a joint, or a nested assembly."""
        said = node_at(self.own.document.tree, path)
        pose = isinstance(said, ScalarNode) and isinstance(said.value, str) and re.fullmatch(r"\s*[A-Za-z]\w*\s*", said.value)
        exact = list(self.exact_joint(base, text, index))
        yield from exact or (self.components(base, _words(text), index) if pose else self.joints(base, text, index))

    # --- documents and parts ----------------------------------------------------------------------------------------

    def document(self, beside: DocumentNames, text: str | None) -> DocumentNames | None:
        """Return the document to which the reference `text` in the document `beside` points."""
        return self.documents.get(resolve_path(text, beside.path) or "") if text else None

    def find_packaged(self, text: str) -> DocumentNames | None:
        """Return the document of a package with the dotted name `package.document`."""
        end = os.sep + text.replace(".", os.sep) + "."
        return next((one for path, one in self.documents.items() if f"{without_suffix(path)}.".endswith(end)), None)

    def find_nested(self, written: DocumentNames, component: str) -> DocumentNames | None:
        """Return the document of a component that is a nested assembly, or None."""
        return self.document(written, written.text("components", component, "assembly"))

    def thing(self, written: DocumentNames, component: str) -> PartClass | None:
        """Return the part class of a component with the key `part`, or None."""
        reference = written.text("components", component, "part")
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

    def components_of(self, written: DocumentNames, words: Sequence[str], index: str) -> list[tuple[DocumentNames, str]]:
        """Return the components that a list of component names selects, through nested documents: the document and the key of each."""
        level = [written]
        reached: list[tuple[DocumentNames, str]] = []
        for depth, word in enumerate(words):
            reached = [(one, key) for one in level for key in one.fitting("components", word, index if not depth else "")]
            level = [inner for one, key in reached if (inner := self.find_nested(one, key)) is not None]
        return reached

    def components(self, written: DocumentNames, words: Sequence[Word], index: str) -> Iterator[Hit]:
        """Yield every existing component to which one of the `words` of a reference refers."""
        for depth, (at, word) in enumerate(words):
            for one, key in self.components_of(written, [text for _, text in words[: depth + 1]], index):
                yield self._hit(one, "components", "component", key, at, word)

    def _hit(self, written: DocumentNames, section: str, what: str, key: str, at: int, word: str) -> Hit:
        stem = written.stem(section, key, word)
        return at, at + (len(key) if stem else len(word)), Name(what, written.path, key), "used" if stem else "fits"

    def mount(self, written: DocumentNames, text: str, index: str, what: str) -> Iterator[Hit]:
        """Yield the names to which a reference `component.mount` refers.

        For some values of `what`, the reference can also be an exported mount or a component.
        """
        *words, (at, last) = _words(text)
        if not words:
            if what != "mount" and last in written.section("mounts"):
                yield 0, len(text), Name("export", written.path, text), "used"
            elif what == "root":
                yield from self.components(written, [(at, last)], index)
            return
        yield from self.components(written, words, index)
        has_mount = False
        owners = self.components_of(written, [word for _, word in words], index)
        for owner, key in owners:
            for hit in _shift_hits(at, self.of_component(owner, key, last, index)):
                has_mount = True
                yield hit
        if what == "root" and not has_mount:
            for owner, key in owners:
                if (nested := self.find_nested(owner, key)) is not None:
                    yield from self.components(nested, [(at, last)], "")

    def of_component(self, written: DocumentNames, key: str, word: str, index: str) -> Iterator[Hit]:
        """Yield the mounts of a component whose name matches `word`, the last word of a reference.

        The mounts can be added by the document, exported by a nested assembly, or declared by the part.
        """
        added = node_at(written.document.tree, ("components", key, "mounts"))
        pattern = pattern_of(word, index)
        for mount in entries_of(added):
            if pattern.match(mount):
                yield 0, len(word), Name("mount", written.path, mount, f"components.{key}"), "used" if mount == word else "fits"
        if (nested := self.find_nested(written, key)) is not None:
            for mount in nested.section("mounts"):
                if pattern.match(mount):
                    yield 0, len(word), Name("export", nested.path, mount), "used" if mount == word else "fits"
        elif (thing := self.thing(written, key)) is not None and word != "origin":
            first = SPECIAL.search(word)
            for one in thing.mounts(word if first is None else word[: first.start()], pattern if first is not None else None):
                stem = word.startswith(one.text)
                yield 0, len(one.text) if stem else len(word), one, "used" if stem else "fits"

    def own_mount(self, written: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the names in a reference of `attach` to a mount of the component itself: `back`, or `cap.pen` inside an assembly."""
        key = str(path[1])
        if "." not in text:
            yield from self.of_component(written, key, text, index)
        elif (nested := self.find_nested(written, key)) is not None:
            yield from self.mount(nested, text, index, "mount")

    def exact_joint(self, written: DocumentNames, text: str, index: str) -> Iterator[Hit]:
        """Yield the joint to which a string refers: `hand.finger`, or one of its coordinates such as `wrist[0]`.

        The string does not contain patterns.
        """
        *words, (at, last) = _words(re.sub(r"\[\d+\]$", "", text))
        if any(GLOB.search(word) for _, word in (*words, (at, last))):
            return
        owners = [written]
        if words:
            components = self.components_of(written, [word for _, word in words], index)
            owners = [inner for one, key in components if (inner := self.find_nested(one, key)) is not None]
        keys = [(owner, key) for owner in owners for key in owner.fitting("joints", last, index)]
        if keys:
            yield from self.components(written, words, index)
            for owner, key in keys:
                yield self._hit(owner, "joints", "joint", key, at, last)

    def joints(self, written: DocumentNames, text: str, index: str) -> Iterator[Hit]:
        """Yield the joints that a name or a pattern matches. In a pattern, `*` also matches dots."""
        exact = list(self.exact_joint(written, text, index))
        if exact or not GLOB.search(text):
            yield from exact
            return
        pattern, words = pattern_of(text, index), _words(text)
        for way in self.all_joints(written, ()):
            if not any(pattern.match(item) or pattern.match(f"{item}[0]") for item in _item_names(way)):
                continue
            if len(words) == len(way) and all(one.fitting(section, word) for (one, section, _), (_, word) in zip(way, words, strict=True)):
                for (one, section, key), (at, word) in zip(way, words, strict=True):
                    if key in one.fitting(section, word):
                        yield self._hit(one, section, section[:-1], key, at, word)
            else:
                for one, section, key in way:
                    yield 0, len(text), Name(section[:-1], one.path, key), "fits"

    def all_joints(
        self, written: DocumentNames, way: tuple[tuple[DocumentNames, str, str], ...],
    ) -> Iterator[tuple[tuple[DocumentNames, str, str], ...]]:
        """Yield every joint of an assembly and of its nested assemblies.

        Each item contains the parent components and the joint, each with its document and section.
        """
        for key in written.section("joints"):
            yield (*way, (written, "joints", key))
        for key in written.section("components"):
            inner = self.find_nested(written, key)
            if inner is not None and all(inner is not one for one, _, _ in way) and inner is not written:
                yield from self.all_joints(inner, (*way, (written, "components", key)))

    def in_section(self, written: DocumentNames | None, what: str, text: str) -> Iterator[Hit]:
        """Yield the names in one section, for example `poses`, that match a string. Yield nothing if the document is None."""
        if written is None:
            return
        entries = written.section(f"{what}s")
        if text in entries:
            yield 0, len(text), Name(what, written.path, text), "used"
        elif GLOB.search(text):
            for key in entries:
                if pattern_of(text, "").match(key):
                    yield 0, len(text), Name(what, written.path, key), "fits"

    def material(self, written: DocumentNames, text: str) -> Iterator[Hit]:
        """Yield the material `text`, which the document or one of its materials documents defines."""
        node = written.document.tree.entries.get("materials")
        sources = [written]
        if not isinstance(node, MappingNode):
            texts = [one.value for one in getattr(node, "items", ()) if isinstance(one, ScalarNode) and isinstance(one.value, str)]
            sources = [one for text in texts if (one := self.document(written, text) or self.find_packaged(text)) is not None]
        for source in sources:
            if text in source.section("materials"):
                yield 0, len(text), Name("material", source.path, text), "used"
                return

    # --- values -----------------------------------------------------------------------------------------------------

    def expression(self, written: DocumentNames, text: str, path: Path, index: str) -> Iterator[Hit]:
        """Yield the parameters and the repeat index that an expression uses."""
        try:
            uses = parse_expression(text).names
        except ExpressionError:
            return
        for use in uses:
            if index and use.name == index:
                yield use.offset, use.end, self.own_name("index", index, path), "used"
            elif use.name in written.section("parameters"):
                yield use.offset, use.end, Name("parameter", written.path, use.name), "used"

    def rule(self, written: DocumentNames, text: str) -> Iterator[Hit]:
        """Yield the names in a rule, which is a comparison of parameters, settings and results."""
        try:
            uses = parse_expression(text, dotted=True).names
        except ExpressionError:
            return
        for use in uses:
            name, at = use.name, use.offset
            for prefix in ("parameters.", "results."):
                if name.startswith(prefix):
                    name, at = name.removeprefix(prefix), at + len(prefix)
            if name.startswith("length."):
                yield from _shift_hits(at + len("length."), self.joints(written, name.removeprefix("length."), ""))
            else:
                yield from self.setting(written, name, at)

    def setting(self, written: DocumentNames, text: str, at: int) -> Iterator[Hit]:
        """Yield the parameter to which a setting refers, or the names in the path of another value of the assembly."""
        if "." not in text:
            yield from _shift_hits(at, self.in_section(written, "parameter", text))
            return
        for word in setting_words(text):
            one = self._through(written, word.through)
            if one is None:
                return
            inside = NameReader(self.documents, self.parts, one)
            yield from _shift_hits(at + word.offset, inside.key(word.path, str(word.path[-1]), word.names))

    def key(self, path: Path, text: str, names: DeclaresName | RefersTo) -> Iterator[Hit]:
        """Yield the name that the key at a path of this document declares or refers to.

        The document need not contain the key.
        """
        if isinstance(names, RefersTo):
            key = self.own.fitting("components", str(path[1])) if path[0] == "components" and len(path) > 2 else [path[1]]
            for one in key:
                yield from self.find_names(self.own, names.what, text, (path[0], one, *path[2:]), "")
        elif path[0] in ("components", "joints") and len(path) == 2:
            section = str(path[0])
            for one in self.own.fitting(section, text) or ([text] if text in self.own.section(section) else []):
                yield self._hit(self.own, section, section[:-1], one, 0, text)
        elif node_at(self.own.document.tree, path) is not None:
            yield 0, len(text), self.own_name(names.what, text, path), "used"

    def _through(self, written: DocumentNames, components: Iterable[str]) -> DocumentNames | None:
        one: DocumentNames | None = written
        for word in components:
            if one is None:
                return None
            keys = one.fitting("components", word) or [word]
            one = self.find_nested(one, keys[0])
        return one

    def choice(self, written: DocumentNames, text: str, path: Path) -> Iterator[Hit]:
        """Yield the part, document or material that a choice selects.

        The path of the choice determines whether the string names a part, a document or a material.
        """
        chosen = next(step for step in reversed(path) if isinstance(step, str))
        kind = chosen.rpartition(".")[2]
        if kind == "part":
            yield from self._part(text)
        elif kind == "assembly":
            yield from self._document(self.document(self.own, text), text)
        elif kind == "material":
            components = re.findall(r"components\.(\w+)", chosen)
            inner = self._through(written, components if chosen.endswith("defaults.component.material") else components[:-1])
            if inner is not None:
                yield from self.material(inner, text)

    def raw(self, written: DocumentNames, text: str, path: Path) -> Iterator[Hit]:
        """Yield the names in the path of an element in output files, such as `hand/finger`."""
        kind = referenced_element(path) or "" if path[2] == "add" else str(path[2])
        dotted = text.replace("/", ".")
        words = _words(dotted)
        answers: list[list[Hit]] = []
        if kind in (sections := {"key": "pose", "sensor": "sensor", "camera": "sensor", "tendon": "tendon", "actuator": "tendon"}):
            answers.append(list(self.in_section(written, sections[kind], text)))
        if kind == "material":
            answers.append(list(self.material(written, text)))
        if kind not in ("joint", "actuator"):
            answers.append(list(self.in_section(written, "link", text)))
            answers.append(list(self.mount(written, dotted, "", "mount or export")) if kind in ("site", "link", "object") else [])
            answers.append(list(self.components(written, words, "")))
        if kind != "default":
            answers.append(list(self.exact_joint(written, dotted, "")))
            answers.append(list(self.exact_joint(written, re.sub(r"_\d+$", "", dotted), "")))
        yield from next((hits for hits in answers if hits and kind != "default"), [])


def _item_names(way: Sequence[tuple[DocumentNames, str, str]]) -> Iterator[str]:
    """Yield the dotted names of all items of a joint, including the names of its parent components."""
    (written, section, key), *rest = way
    for item in written.items(section, key):
        yield from (f"{item}.{inner}" for inner in _item_names(rest)) if rest else (item,)
