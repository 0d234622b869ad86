"""The committed schemas checked by a second implementation, `check-jsonschema`: whether they are valid schemas, accept every valid document
of the repository, and which share of the faults in invalid documents they reject.

Faults that they cannot reject are listed with the reason. `check-jsonschema` also has its own parsers of YAML and TOML."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import check_jsonschema
import pytest
from check_jsonschema.regex_variants import _RegressImplementation
from check_jsonschema.schema_loader import SchemaLoader
from code_pages import read_page, unpack
from hypothesis import given, settings, strategies as st

from docs.pages import PAGES, documents, meant_to_be_wrong
from thingc.base.diagnostics import Code
from thingc.documents.spec import fields
from thingc.documents.spec.validation import KINDS
from thingc.tools.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "tests" / "cases"
SCHEMAS = [ROOT / "schemas" / f"{kind}-1.json" for kind in sorted(KINDS)]

BEYOND = {
    "TC209": "whether a text is an expression takes a parser: brackets nest, names have to be functions",
}
"""Codes for which a JSON Schema cannot detect most faults, and the reason."""
EXCEPTIONS = {
    ("spec/expressions.yaml", "parameters.k"): "a unit inside an expression",
    ("modes/gravity.yaml", "modes.bench.gravity[2]"): "the dimension of a product of units",
    ("spec/numbers_out_of_all_bounds.yaml", "joints.hinge.limit.lower"): "a number beyond all doubles, in a text",
    ("spec/numbers_out_of_all_bounds.yaml", "joints.hinge.limit.upper"): "a number beyond all doubles, in a text",
    ("spec/unit_of_a_file.yaml", "components.motor.unit"): "which files carry a unit of their own is a matter of their endings",
    ("spec/mesh_keys.yaml", "components.trunk.shapes[2].unit"): "which files carry a unit of their own is a matter of their endings",
    ("spec/quaternions.yaml", "modes.one.hold.base.long.quat"): "a hold that carries force alone takes no angles",
    ("TC211.yaml", "materials.petg.color"): "colours are taken in any case, and JSON Schema's patterns know no case",
}
"""Other faults that the schemas accept: document and key path, and the reason."""
SHARES = {
    "TC201": 1.0, "TC202": 1.0, "TC203": 1.0, "TC204": 1.0, "TC205": 1.0, "TC206": 0.9, "TC207": 0.9, "TC208": 0.85, "TC209": 0.0,
    "TC210": 1.0, "TC211": 0.7, "TC212": 0.9, "TC213": 1.0, "TC214": 1.0,
}
"""For each code, the minimum share of the faults in `tests/cases` and `docs/codes` that the schemas reject."""


def run(*words: object) -> dict[str, object]:
    """Result of `check-jsonschema` as JSON."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        check_jsonschema.main(["--output-format", "json", *map(str, words)])
    answer: dict[str, object] = json.loads(out.getvalue())
    return answer


def kind_of(path: Path) -> str | None:
    """The kind in the first key of a document, or None if it is not a known kind."""
    found = re.search(r"^[\"']?thingc[\"']?\s*[:=]\s*[\"']?(\w+)/1", path.read_text(encoding="utf-8", errors="replace"), re.MULTILINE)
    return found.group(1) if found and found.group(1) in KINDS else None


def faults(paths: Iterable[Path]) -> dict[str, list[tuple[str, ...]]]:
    """Key paths that the schema of its kind rejects in each document, by file name."""
    by_kind: dict[str, list[Path]] = defaultdict(list)
    for path in paths:
        by_kind[kind_of(path) or "assembly"].append(path)
    refused: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for kind, some in by_kind.items():
        answer = run("--schemafile", ROOT / "schemas" / f"{kind}-1.json", *some)
        for error in answer.get("errors", []):  # type: ignore[attr-defined]
            refused[error["filename"]].append(split_key_path(error["path"]))
        assert not answer.get("parse_errors"), answer
    return refused


def split_key_path(path: str) -> tuple[str, ...]:
    """The names in a key path, independent of its brackets and dots."""
    return tuple(re.findall(r"\w+", path))


def test_schemas_match_the_metaschema() -> None:
    assert run("--check-metaschema", *SCHEMAS)["status"] == "ok"


def test_metaschema_check_detects_a_broken_schema(tmp_path: Path) -> None:
    broken = json.loads((ROOT / "schemas" / "calibration-1.json").read_text())  # a small one
    broken["properties"]["description"]["type"] = "txet"
    (tmp_path / "broken.json").write_text(json.dumps(broken))
    assert run("--check-metaschema", tmp_path / "broken.json")["status"] == "fail"


def checked(folder: Path) -> Iterator[tuple[str, Path, str]]:
    """Name, path and expected output of every case, and of every example of a code (written into `folder`), that is checked without
    options."""
    for path in sorted(CASES.rglob("*")):
        text = path.with_suffix(".txt")
        if path.suffix in (".yaml", ".yml", ".toml") and text.exists() and not path.read_text("latin-1").startswith("# $ "):
            yield path.relative_to(CASES).as_posix(), path, re.sub(r"exit \d\n$", "", text.read_text())
    for code in Code:
        page = read_page(code)
        for side, example in page.examples.items():
            if example.command == f"thingc check {example.document}":
                unpack(page, side, folder / f"{code.code}_{side}")
                yield example.document, folder / f"{code.code}_{side}" / example.document, example.printed


def valid_documents(folder: Path) -> list[Path]:
    """All valid documents of the repository: robots, examples of documentation pages (written into `folder`), and cases and examples
    with the result `ok`."""
    robots = [path for path in (ROOT / "assemblies").rglob("*") if path.suffix in (".yaml", ".yml", ".toml")]
    shown = []
    for page in PAGES:
        for number, block in enumerate(documents(page)):
            if not meant_to_be_wrong(block):
                suffix = Path(block.file or "x.yaml").suffix
                shown.append(folder / f"{page.stem}_{number}{suffix}")
                shown[-1].write_text(block.text)
    cases = [path for _, path, printed in checked(folder) if printed == f"{path.name}: ok\n"]
    assert len(robots) > 5 and len(shown) > 10 and len(cases) > 80
    return [path for path in (*robots, *shown, *cases, ROOT / "thingc.toml") if kind_of(path) is not None]


@pytest.fixture
def trusted_schemas(monkeypatch: pytest.MonkeyPatch) -> None:
    """`check-jsonschema` does not check the schemas again, which `test_schemas_match_the_metaschema` does, and compiles each pattern
    once."""
    monkeypatch.setattr(SchemaLoader, "validate_schema", False)
    monkeypatch.setattr(_RegressImplementation, "_compile_pattern", cache(_RegressImplementation._compile_pattern))


@pytest.mark.usefixtures("trusted_schemas")
def test_valid_documents_are_accepted(tmp_path: Path) -> None:
    paths = valid_documents(tmp_path)
    assert dict(faults(paths)) == {}


@pytest.mark.usefixtures("trusted_schemas")
def test_invalid_documents_are_rejected_at_each_fault(shared_store: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A fault counts as rejected if the schema reports its key, a key that contains it, or a value in it."""
    monkeypatch.setenv("THINGC_STORE", shared_store)
    wrong = {path: name for name, path, printed in checked(tmp_path) if re.search(r"\[TC2\d\d\]", printed)}
    assert len(wrong) > 50
    # ruamel, which reads for check-jsonschema, takes a lone `=` for the default value of YAML 1.1 and gives up.
    copies = {path: tmp_path / f"{number}{path.suffix}" for number, path in enumerate(wrong)}
    for path, copy in copies.items():
        copy.write_bytes(re.sub(rb": =\n", b': "="\n', path.read_bytes()))
    refused = faults(copies.values())
    seen: dict[str, list[bool]] = defaultdict(list)
    missed = set()
    for path, name in wrong.items():
        monkeypatch.chdir(path.parent)
        with contextlib.redirect_stdout(io.StringIO()) as out:
            main(["check", path.name, "--format", "json"])
        for d in json.loads(out.getvalue())["diagnostics"]:
            if not d["code"].startswith("TC2") or d["file"] != path.name:
                continue
            own = split_key_path(d["path"] or "")
            near = any(
                (own[: len(of)] == of and (of or len(own) <= 1)) or of[: len(own)] == own for of in refused.get(str(copies[path]), [])
            )
            seen[d["code"]].append(near)
            if not near and d["code"] not in BEYOND:
                missed.add((name, d["path"]))
    shares = {code: sum(found) / len(found) for code, found in sorted(seen.items())}
    assert {code: share for code, share in shares.items() if share < SHARES[code]} == {}
    assert set(shares) == set(SHARES)
    assert missed == set(EXCEPTIONS)
    assert {code for code, share in shares.items() if share < 0.5} == set(BEYOND)


# --- the patterns take whatever the compiler takes -------------------------------------------------------------------

_PIECES = st.lists(
    st.sampled_from([
        "0", "12", "-3.5", "+.5", "1e3", "0.0", "-0", ".", "e", " ", "  ", "mm", "kg", "deg", "%", "s", "N", "rad", "Hz", "x", "*", "/",
        "·", "^2",
        "**-1", "²", "=", "reach", "(", ")", "\n", "mmm", "$i", "plate", "[", "true", "°",
    ]),
    max_size=8,
).map("".join)


def matches(schema: dict[str, object], text: str) -> bool:
    branches = schema.get("anyOf", [schema])
    patterns = [branch["pattern"] for branch in branches if "pattern" in branch]  # type: ignore[attr-defined]
    assert patterns
    return any(re.search(pattern, text) for pattern in patterns)


CHECKED = {
    name: getattr(fields, name).__metadata__[0]
    for name in (
        "LengthField", "AngleField", "MassField", "RatioField", "EffortField", "DampingField", "MultiplierField", "JointValueField",
        "AnyQuantityField", "Vector3Length", "ReferenceField", "NumberField", "CountField",
    )
}


@settings(max_examples=250)
@given(name=st.sampled_from(sorted(CHECKED)), text=_PIECES)
def test_patterns_accept_all_values_the_compiler_accepts(name: str, text: str) -> None:
    checked = CHECKED[name]
    try:
        checked.validate(text)
    except Exception:
        return
    assert matches(checked.schema, text), (name, text)


@pytest.mark.parametrize(("name", "text"), [
    ("LengthField", "5 kg"), ("LengthField", "5 mmm"), ("LengthField", "5"), ("LengthField", "mm"), ("LengthField", "1,5 mm"),
    ("LengthField", "="),
    ("MassField", "12 mm"), ("EffortField", "3 kg"), ("AngleField", "90 s"), ("Vector3Length", "0 40 mm"), ("Vector3Length", "1 2 3"),
    ("Vector3Length", "1 2 3 deg"), ("JointValueField", "about 90 deg"), ("ReferenceField", "plate..top"), ("ReferenceField", "plate/top"),
    ("AnyQuantityField", "3 zz"), ("NumberField", "many"),
])
def test_patterns_reject_invalid_values(name: str, text: str) -> None:
    with pytest.raises(Exception, match="."):
        CHECKED[name].validate(text)
    assert not matches(CHECKED[name].schema, text)
