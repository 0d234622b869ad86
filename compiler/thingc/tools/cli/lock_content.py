"""Create the content of `parts.lock.json`.

The geometry service provides all Things that the workspace can use, and all definitions that documents use.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from thingc.base.safe_text import json_text
from thingc.geometry.lock.json_format import record_values, schema_values
from thingc.geometry.lock.lock import VERSION, hash_of
from thingc.geometry.print_slices import Slicing
from thingc.geometry.record import NO_PARTS, PartDefinition, PartFailure, PartRecord, PartSchema
from thingc.geometry.service import GeometryService


def create_lock(
    geometry: GeometryService, references: Sequence[str], definitions: Sequence[PartDefinition],
    slicings: Mapping[str, Collection[Slicing]],
) -> tuple[dict[str, Any], list[PartFailure]]:
    """Return the content of a new lock file, and the failures of parts that could not be described or built.

    The lock file contains the parts that documents use: `references` (`module:Class`), `definitions`, and `slicings`, keyed by definition
    text.

    The lock file also contains all Things of the part folders, and the Things of packages that documents use. If a Thing cannot be built
    with its default parameters, the lock file has no record for these parameters, unless a document uses them.
    """
    in_folders = [reference for reference in geometry.catalogue() if geometry.in_part_folders(reference)]
    schemas = geometry.describe(sorted({*references, *in_folders}))
    failures = [*geometry.not_python(), *(
        answer for reference, answer in schemas.items()
        if isinstance(answer, PartFailure) and (reference in references or answer.kind not in NO_PARTS)
    )]
    schemas_by_reference = {
        reference: schema for reference, schema in schemas.items()
        if isinstance(schema, PartSchema) and (schema.kind == "thing" or reference in references)
    }
    defaults = [definition for schema in schemas_by_reference.values() if (definition := schema.default) is not None]
    used = {definition.text: definition for definition in definitions}
    all_definitions = {**{definition.text: definition for definition in defaults}, **used}
    modelled = [all_definitions[text] for text in sorted(all_definitions)]
    records = geometry.slice(modelled, geometry.realize(modelled), slicings)
    failures += [
        replace(answer, subject=used[text].label) for text, answer in records.items() if isinstance(answer, PartFailure) and text in used
    ]
    good = {text: record for text, record in records.items() if isinstance(record, PartRecord)}
    values = {
        "thingc": VERSION,
        "things": {
            reference: _thing(geometry, schema, [d for d in all_definitions.values() if d.reference == reference and d.text in good], good)
            for reference, schema in sorted(schemas_by_reference.items())
        },
        "files": {
            text: {"content": geometry.state(definition.reference), "record": record_values(good[text])}
            for text, definition in sorted(used.items()) if definition.kind == "file" and text in good
        },
        "others": sorted({reference for reference in in_folders if reference not in schemas_by_reference}),
    }
    return values, failures


def _thing(
    geometry: GeometryService, schema: PartSchema, definitions: Sequence[PartDefinition], records: Mapping[str, PartRecord],
) -> dict[str, Any]:
    texts = sorted(definition.text for definition in definitions)
    reads = {
        path: state for subject in (schema.reference, *texts) for path, state in geometry.reads.get(subject, {}).items()
        if not os.path.isabs(path) and not path.startswith("..")
    }
    lock_values: dict[str, Any] = {"code": hash_of(schema.reference, geometry.code(schema.reference), geometry.part_code)}
    if reads:
        lock_values["reads"] = dict(sorted(reads.items()))
    return {**lock_values, **schema_values(schema), "records": {text: record_values(records[text]) for text in texts}}


def lock_text(values: Mapping[str, Any]) -> str:
    """Return the text of the lock file, indented by two spaces.

    Each list of numbers is on one line, so that a changed number changes only one line. The file does not contain invisible characters, so
    that a reviewer sees every change.
    """
    return json_text(_format_json(values, "\n")) + "\n"


def _format_json(value: Any, newline: str) -> str:
    inner = newline + "  "
    if isinstance(value, Mapping) and value:
        entries = (f"{json.dumps(key, ensure_ascii=False)}: {_format_json(item, inner)}" for key, item in value.items())
        return "{" + inner + ("," + inner).join(entries) + newline + "}"
    kinds = set(map(type, value)) if isinstance(value, list) else set()
    if kinds & {dict, list} or kinds == {str} and len(value) > 3:
        return "[" + inner + ("," + inner).join(_format_json(item, inner) for item in value) + newline + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def differences(old_lock: Mapping[str, Any], new_lock: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Compare the contents of an existing lock file and a new lock file.

    Return each difference as a tuple `(key, description)`, in the order of the lock file.
    """
    differing: list[tuple[str, str]] = []
    for section, what in (("things", "part"), ("files", "file")):
        old, new = old_lock.get(section, {}), new_lock.get(section, {})
        for name in sorted({*old, *new}):
            if name not in old:
                differing.append((name, f"the {what} `{name}` is missing"))
            elif name not in new:
                differing.append((name, f"the {what} `{name}` is removed or unused"))
            else:
                differing += [(name, words) for words in _thing_differences(name, old[name], new[name])]
    if sorted(old_lock.get("others", [])) != new_lock.get("others", []):
        differing.append(("others", "other classes in the part folders have changed"))
    return differing


def _thing_differences(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    old_records, new_records = _records(old), _records(new)
    phrases = [f"`{text}` is missing" for text in sorted(set(new_records) - set(old_records))]
    phrases += [f"`{text}` is unused" for text in sorted(set(old_records) - set(new_records))]
    for text in sorted(set(old_records) & set(new_records)):
        path = _first_difference(old_records[text], new_records[text], "")
        if path is not None:
            phrases.append(f"`{path}` of `{text}` has changed")
    old_rest, new_rest = ({k: v for k, v in side.items() if k not in ("code", "record", "records")} for side in (old, new))
    path = _first_difference(old_rest, new_rest, "")
    if path is not None:
        phrases.append(f"`{path}` of `{name}` has changed")
    if old.get("code") != new.get("code") and not phrases:
        phrases.append(f"the code of `{name}` has changed")
    return phrases


def _records(values: Mapping[str, Any]) -> Mapping[str, Any]:
    return values.get("records") or ({"": values["record"]} if "record" in values else {})


_CLOSE = 1e-9


def _first_difference(old: Any, new: Any, path: str) -> str | None:
    """Return the path of the first value that differs between two JSON values, or None if they are equal.

    Small differences between numbers are ignored, because two builds of the CAD kernel can differ by rounding errors.
    """
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        if list(old) != list(new):
            return next((f"{path}.{key}".lstrip(".") for key in (*old, *new) if key not in old or key not in new), path or "order")
        return next((at for key in old if (at := _first_difference(old[key], new[key], f"{path}.{key}".lstrip("."))) is not None), None)
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        if new and all(isinstance(one, (int, float)) for one in (*old, *new)):
            size = max(abs(float(one)) for one in (*old, *new))
            return None if all(abs(a - b) <= _CLOSE * size for a, b in zip(old, new, strict=True)) else path
        return None if all(_first_difference(a, b, path) is None for a, b in zip(old, new, strict=True)) else path
    if type(old) is float and type(new) is float:
        return None if abs(old - new) <= _CLOSE * max(abs(old), abs(new)) else path
    return None if type(old) is type(new) and old == new else path
