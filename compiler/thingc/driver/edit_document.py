"""Change values in a document file, as `thingc set` does, unless the new values would cause errors."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from msgspec.structs import replace

from thingc.base.diagnostics import Code, Diagnostic, Severity, Stage
from thingc.base.frozen_struct import FrozenStruct
from thingc.base.memo import Memo
from thingc.base.replacement import ReplacementRefused, replace_files
from thingc.base.source import Document, MappingNode, Node, SequenceNode, Span, line_of, node_at
from thingc.documents.format.value_edits import CannotSetValue, Keys, Written, changes, set_values
from thingc.documents.load.documents import Documents, load
from thingc.documents.load.yaml_tree import is_flow, read_flow
from thingc.documents.spec.settable_values import expand_short_form, parse, split_nested
from thingc.documents.spec.validation import validate
from thingc.driver import pipeline
from thingc.driver.environment import Environment, Options


class EditResult(FrozenStruct):
    """The result of changing values in a document.

    `found` contains all diagnostics. `changed` contains the old documents and their new texts, and is empty if errors occurred before the
    texts were computed. `done` contains the path, the previous value and the new value of each change. The previous value is None if the
    key did not exist.
    """

    found: tuple[Diagnostic, ...]
    changed: tuple[tuple[Document, str], ...] = ()
    done: tuple[tuple[str, str | None, str], ...] = ()


def write_values(document: str, settings: Mapping[str, str], options: Options, *, strict: bool = False, dry: bool = False) -> EditResult:
    """Change values in a document file, unless the new values would cause errors.

    `settings` maps names of parameters, and paths of other values, to the new values as strings. With `dry`, the new values are checked,
    but the file is not written. With `strict`, warnings are treated as errors. Raises `OSError` if the document cannot be read.
    """
    settings = {parameter_name(path): text for path, text in settings.items()}
    parameters = {path: text for path, text in settings.items() if "." not in path}
    choices = {path: text for path, text in settings.items() if "." in path}
    documents, diagnostics = check_document(document, replace(options, parameters=parameters, choices=choices), strict=strict)
    if documents is None or any(d.code in (Code.CHOICE_OPTION, Code.PARAMETER_OPTION) for d in diagnostics):
        return EditResult(found=tuple(diagnostics))
    root = documents.root
    errors = [fault for path in choices if (fault := _nested_value_error(root, path)) is not None]
    if errors:
        return EditResult(found=tuple(errors))
    values = {keys_of(root, path): text for path, text in settings.items()}
    long_forms = [inner for keys in values if (inner := expand_short_form(root.tree, keys)) is not None]
    try:
        expanded = set_values(root, {keys: _node_texts(node) for keys, node in long_forms})
        text = set_values(expanded, {keys: _parse_value(text) for keys, text in values.items()}).text
    except CannotSetValue as fault:
        return EditResult(found=(_error(str(fault), "edit the document by hand", fault.span),))
    return write_texts(root, {root.path: (root, text)}, tuple(changes(expanded, values)), options, strict=strict, dry=dry)


def write_texts(
    root: Document, texts: Mapping[str, tuple[Document, str]], done: tuple[tuple[str, str | None, str], ...], options: Options, *,
    strict: bool = False, dry: bool = False,
) -> EditResult:
    """Replace the texts of document files, unless the document `root` would have errors.

    `texts` maps paths to the old documents and their new texts. `done` describes the changes. See `write_values` for the other arguments.
    """
    files = {path: document_change(*change) for path, change in texts.items()}
    _, diagnostics = check_document(root.path, replace(options, texts={path: after for path, (_, after) in files.items()}), strict=strict)
    all_diagnostics, changed = tuple(diagnostics), tuple(texts.values())
    if any(d.severity is Severity.ERROR for d in all_diagnostics):
        return EditResult(found=all_diagnostics, changed=changed)
    try:
        replace_files({} if dry else files)
    except ReplacementRefused as fault:
        return EditResult(found=(fault.diagnostic,))
    return EditResult(found=all_diagnostics, changed=changed, done=done)


def parameter_name(path: str) -> str:
    """Remove the prefix `parameters.` from the path of a parameter, such as `parameters.reach`.

    Paths without this prefix are returned unchanged.
    """
    name = path.removeprefix("parameters.")
    return path if "." in name else name


def document_change(root: Document, text: str) -> tuple[bytes, bytes]:
    """Encode the original text and the new text of a document as bytes.

    If the original file begins with a byte order mark, both results begin with it.
    """
    original = root.text.encode()
    mark = b"" if hashlib.sha256(original).hexdigest() == root.sha256 else b"\xef\xbb\xbf"
    return mark + original, mark + text.encode()


def load_documents(document: str, options: Options, memo: Memo) -> Documents | None:
    """Load and validate a document and all documents that it references. Return None if one of the documents has errors."""
    with Environment(document, options, memo=memo) as environment:
        if environment.workspace is None:
            return None
        documents = load(environment.document, environment.workspace, environment.report, memo=memo)
        if documents is not None:
            validate(documents, environment.report, memo)
        return None if environment.report.failed else documents


def check_document(
    document: str, options: Options, *, strict: bool = False, memo: Memo | None = None,
) -> tuple[Documents | None, list[Diagnostic]]:
    """Compile a document. Return the document with all documents that it references, and the diagnostics.

    The documents are None if the document cannot be read. `memo` caches the parsed documents between calls.
    """
    with Environment(document, replace(options, lock=True), memo=memo) as environment:
        compilation = pipeline.compile(environment)
    pipeline.report_unneeded(compilation, [Stage.CHECK])
    return compilation.documents, compilation.report.apply_strict(strict=strict).sorted_diagnostics()


def keys_of(root: Document, path: str) -> Keys:
    """Convert the name of a parameter, or a path with dots, to the sequence of keys that lead to the value in the document."""
    if "." in path:
        return tuple(path.split("."))
    full = isinstance(node_at(root.tree, ("parameters", path)), MappingNode)
    return ("parameters", path, "value") if full else ("parameters", path)


def _parse_value(text: str) -> Written:
    """Parse a YAML list or mapping in flow style, such as `[1, 2]`. Other strings are returned unchanged."""
    tree = read_flow(text, line_of("")) if is_flow(text) else None
    return text if tree is None or isinstance(tree, Diagnostic) else _node_texts(tree)


def _node_texts(node: Node) -> Written:
    if isinstance(node, MappingNode):
        return {key: _node_texts(child) for key, child in node.entries.items()}
    return [_node_texts(child) for child in node.items] if isinstance(node, SequenceNode) else node.text


def _nested_value_error(root: Document, path: str) -> Diagnostic | None:
    """Return an error if the value at `path` is in a nested document or belongs to a copy of a component, and otherwise None."""
    nested = split_nested(path)
    if nested is None:
        choice = parse(path)
        name = choice.components[0] if choice is not None and choice.components else None
        if name is None or node_at(root.tree, ("components", name)) is not None:
            return None
        return _error(f"`{path}` is a copy of a repeated component", "set the value of the repeated component")
    component, inner_path = nested
    text = node_at(root.tree, ("components", component, "assembly"))
    inner = getattr(text, "text", "the nested document")
    return _error(f"`{path}` is defined in the nested document `{inner}`", f"run `thingc set {inner} '{inner_path}=...'`")


def _error(message: str, help: str, span: Span | None = None) -> Diagnostic:
    return Diagnostic(code=Code.COMMAND_LINE, severity=Severity.ERROR, message=message, help=help, span=span)
