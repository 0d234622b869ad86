"""Workspaces designed to exhaust the checker. Each function writes one into a folder that has a `thingc.toml`, and returns the name of
the document to check."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

HEAD = "thingc: assembly/1\nname: bomb\n"
FRAME = "components:\n  body: {frame: true, mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}\n"


def _document(folder: Path, text: str | bytes, name: str = "bomb.yaml") -> str:
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return name


def doubling(folder: Path) -> str:
    """Sixty nested documents; each uses the next one twice: 2^60 occurrences."""
    for level in range(60):
        inner = f"{{assembly: level{level + 1}.yaml}}" if level < 59 else "{frame: true}"
        one = f"  a: {inner}\n  b: {inner[:-1]}, at: {{in: a.origin, xyz: 0 0 1 mm}}}}\n"
        _document(folder, f"thingc: assembly/1\nname: level{level}\ncomponents:\n{one}", f"level{level}.yaml")
    return "level0.yaml"


def doubling_with_parameters(folder: Path) -> str:
    """Nested documents with different parameters at every use, so that no two uses share a definition: 2^24 definitions."""
    for level in range(24):
        inner = f"assembly: level{level + 1}.yaml, parameters: {{n: '=2*n"
        use = ("{frame: true}", "{frame: true, at: {in: a.origin}}") if level == 23 else (
            f"{{{inner}'}}}}", f"{{{inner}+1'}}, at: {{in: a.origin}}}}")
        text = f"thingc: assembly/1\nname: level{level}\nparameters: {{n: 1}}\ncomponents:\n  a: {use[0]}\n  b: {use[1]}\n"
        _document(folder, text, f"level{level}.yaml")
    return "level0.yaml"


def repeats_of_repeats(folder: Path) -> str:
    """10 000 times 10 000 components by nested repeats."""
    _document(folder, HEAD + "components:\n  base: {frame: true}\n  leaf: {frame: true, repeat: {count: 10000, as: i}, "
              "at: {in: base.origin}}\n", "inner.yaml")
    return _document(folder, HEAD + "components:\n  base: {frame: true}\n  inner: {assembly: inner.yaml, "
                     "repeat: {count: 10000, as: i}, at: {in: base.origin}}\n")


def repeats_beside(folder: Path) -> str:
    """A thousand repeats of 10 000 components."""
    lines = "".join(f"  leaf{n}: {{frame: true, repeat: {{count: 10000, as: i}}, at: {{in: base.origin}}}}\n" for n in range(1000))
    return _document(folder, HEAD + "components:\n  base: {frame: true}\n" + lines)


def as_many_as_allowed(folder: Path) -> str:
    """99 000 occurrences, which is within the limit."""
    _document(folder, HEAD + "components:\n  base: {frame: true}\n  leaf: {frame: true, repeat: {count: 989, as: i}, "
              "at: {in: base.origin}}\n", "inner.yaml")
    return _document(folder, HEAD + "components:\n  base: {frame: true}\n  inner: {assembly: inner.yaml, "
                     "repeat: {count: 99, as: i}, at: {in: base.origin}}\n")


def laughs(folder: Path) -> str:
    """Nested aliases that expand to 10^9 values ("billion laughs")."""
    lines = ["a0: &a0 [1,1,1,1,1,1,1,1,1,1]"]
    lines += [f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
    return _document(folder, HEAD + "\n".join(lines) + "\n")


def many_aliases(folder: Path) -> str:
    """Two million aliases of a small value."""
    return _document(folder, HEAD + "a: &a 1\nb: [" + ",".join(["*a"] * 2_000_000) + "]\n")


def deep_flow(folder: Path) -> str:
    """Five million nested brackets."""
    return _document(folder, HEAD + "a: " + "[" * 5_000_000)


def deep_flow_braces(folder: Path) -> str:
    """A million nested flow mappings."""
    return _document(folder, HEAD + "a: " + "{a: " * 1_000_000)


def deep_block(folder: Path) -> str:
    """A mapping with 3000 levels of indentation."""
    return _document(folder, HEAD + "".join(" " * n + "a:\n" for n in range(3000)))


def deep_sequence(folder: Path) -> str:
    """A million dashes on one line."""
    return _document(folder, HEAD + "a:\n  " + "- " * 1_000_000 + "1\n")


def complex_keys(folder: Path) -> str:
    """`? ? ? ?`: complex keys nested in complex keys."""
    return _document(folder, HEAD + "? " * 1_000_000 + "a\n")


def many_keys(folder: Path) -> str:
    """Ten megabytes of unknown keys."""
    return _document(folder, HEAD + "".join(f"k{n:06}: 1\n" for n in range(900_000)))


def many_components(folder: Path) -> str:
    """Ten megabytes of components, all placed on one that does not exist."""
    lines = "".join(f"  c{n}: {{frame: true, at: {{in: bodi.origin}}}}\n" for n in range(200_000))
    return _document(folder, HEAD + FRAME + lines)


def many_near_names(folder: Path) -> str:
    """20 000 joints, each with a misspelled component, among 20 000 components with long names."""
    stem = "component_with_a_long_name_that_takes_long_to_compare_"
    components = "".join(f"  {stem}{n}: {{frame: true}}\n" for n in range(20_000))
    joints = "".join(f"  j{n}: {{type: fixed, parent: {stem}x{n}.origin, child: {stem}{n}y.origin}}\n" for n in range(20_000))
    return _document(folder, HEAD + "components:\n" + components + "joints:\n" + joints)


def long_names(folder: Path) -> str:
    """Names of a million characters, one of them misspelled."""
    name = "a" * 1_000_000
    return _document(folder, HEAD + f"components:\n  base: {{frame: true}}\n  {name}b: {{frame: true, at: {{in: base.origin}}}}\n"
                     f"links: {{l: {name}c}}\nposes: {{home: {{{name}d: 1 deg}}}}\n")


def unknown_long_keys(folder: Path) -> str:
    """200 unknown keys of 40 000 characters that resemble a valid one."""
    return _document(folder, HEAD + "".join("components" * 4000 + f"{n}: 1\n" for n in range(200)))


def one_line(folder: Path) -> str:
    """Ten megabytes on one line, with an error in every item."""
    return _document(folder, HEAD + "components: {" + ", ".join(f"c{n}: {{frme: true}}" for n in range(400_000)) + "}\n")


def one_text(folder: Path) -> str:
    """A description of ten megabytes."""
    return _document(folder, HEAD + "description: " + "x" * 9_900_000 + "\n" + FRAME)


def long_expression(folder: Path) -> str:
    """An expression of a million characters."""
    return _document(folder, HEAD + "parameters: {a: \"=" + "1+" * 500_000 + "1\"}\n" + FRAME)


def deep_expression(folder: Path) -> str:
    """Nested parentheses, as many as an expression may have characters."""
    return _document(folder, HEAD + "parameters: {a: \"=" + "(" * 499 + "1" + ")" * 499 + "\", b: \"=" + "-" * 900 + "1\", c: \"="
                     + "2**" * 300 + "2\"}\n" + FRAME)


def chained_parameters(folder: Path) -> str:
    """5000 parameters; each doubles the previous one, so the last is 2^5000."""
    lines = "".join(f"  p{n}: =p{n - 1} + p{n - 1}\n" for n in range(1, 5000))
    return _document(folder, HEAD + "parameters:\n  p0: 1\n" + lines + FRAME)


def parameters_in_a_circle(folder: Path) -> str:
    """20 000 parameters in one cycle."""
    lines = "".join(f"  p{n}: =p{(n + 1) % 20_000}\n" for n in range(20_000))
    return _document(folder, HEAD + "parameters:\n" + lines + FRAME)


def digits(folder: Path) -> str:
    """Integers of a million digits, and exponents beyond the range of a double."""
    return _document(folder, HEAD + f"parameters: {{a: {'9' * 1_000_000}, b: 1e999999999, c: 0x{'f' * 1_000_000}, d: {'9' * 900} mm, "
                     "e: 1e-999999999 mm}\n" + FRAME)


def number_text(folder: Path) -> str:
    """Quantities made of text that is hard for number patterns."""
    bad = ["1" * 900, "1." * 400, "1e" * 400, "+-" * 400, "1 " * 450, "mm" * 450, "1 mm^" + "2" * 900, "1 mm*" * 150, "1_" * 400]
    lines = "".join(f"  p{n}: {{value: '{text}'}}\n" for n, text in enumerate(bad * 200))
    return _document(folder, HEAD + "parameters:\n" + lines + FRAME)


def globs(folder: Path) -> str:
    """Patterns with many wildcards over long names, in poses and in exclusions."""
    star = "*a" * 400 + "*b"
    name = "a" * 900
    joints = "".join(f"  {name}{n}: {{type: continuous, parent: base.origin, child: c{n}.origin}}\n" for n in range(200))
    components = "  base: {frame: true}\n" + "".join(f"  c{n}: {{frame: true, mass: 1 kg}}\n" for n in range(200))
    poses = "".join(f"  p{n}: {{\"{star}{n}\": 1 deg}}\n" for n in range(50))
    modes = "modes:\n" + "".join(f"  m{n}: {{root: base, actuators: [\"{star}\"], contacts: {{exclude: [[\"{star}\", \"{star}\"]]}}}}\n"
                                 for n in range(20))
    return _document(folder, HEAD + "components:\n" + components + "joints:\n" + joints + "poses:\n" + poses + modes)


def globs_match_all(folder: Path) -> str:
    """A hundred pairs of patterns that match all of 2000 components: 4 10^8 pairs."""
    components = "  base: {frame: true}\n  c: {frame: true, repeat: {count: 2000, as: i}, at: {in: base.origin}}\n"
    pairs = ", ".join(['["*", "*"]'] * 100)
    return _document(folder, HEAD + "components:\n" + components + f"modes: {{m: {{root: base, contacts: {{exclude: [{pairs}]}}}}}}\n")


def mode_chain(folder: Path) -> str:
    """5000 modes; each extends the previous one."""
    modes = "".join(f"  m{n}: {{extends: m{n - 1}}}\n" for n in range(1, 5000))
    return _document(folder, HEAD + FRAME + "modes:\n  m0: {root: body, base: fixed}\n" + modes)


def mode_circle(folder: Path) -> str:
    """5000 modes in one cycle."""
    return _document(folder, HEAD + FRAME + "modes:\n" + "".join(f"  m{n}: {{extends: m{(n + 1) % 5000}}}\n" for n in range(5000)))


def modes_and_poses(folder: Path) -> str:
    """A thousand modes and a thousand poses of two hundred joints."""
    components = "  base: {frame: true, mass: 1 kg}\n" + "".join(
        f"  c{n}: {{frame: true, mass: 1 kg, inertia: {{ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}}}}\n" for n in range(200))
    joints = "".join(f"  j{n}: {{type: continuous, parent: base.origin, child: c{n}.origin}}\n" for n in range(200))
    poses = "".join(f"  p{n}: {{\"j*\": 1 deg}}\n" for n in range(1000))
    modes = "".join(f"  m{n}: {{root: c{n % 200}}}\n" for n in range(1000))
    return _document(folder, HEAD + "components:\n" + components + "joints:\n" + joints + "poses:\n" + poses + "modes:\n" + modes)


def loops(folder: Path) -> str:
    """Two hundred joints that close loops with each other."""
    inertia = "mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}"
    components = f"  base: {{frame: true, {inertia}}}\n" + "".join(f"  c{n}: {{frame: true, {inertia}}}\n" for n in range(200))
    joints = "".join(f"  j{n}: {{type: continuous, parent: {'base' if n == 0 else f'c{n - 1}'}.origin, child: c{n}.origin}}\n"
                     for n in range(200))
    closing = "".join(f"  k{n}: {{type: continuous, loop: true, parent: base.origin, child: c{n}.origin}}\n" for n in range(1, 200))
    modes = "modes:\n" + "".join(f"  m{n}: {{root: c{n}}}\n" for n in range(50))
    return _document(folder, HEAD + "components:\n" + components + "joints:\n" + joints + closing + modes)


def wide_documents(folder: Path) -> str:
    """Two thousand documents nested in one."""
    for n in range(2000):
        _document(folder, f"thingc: assembly/1\nname: d{n}\ncomponents: {{f: {{frame: true}}}}\n", f"d{n}.yaml")
    lines = "".join(f"  c{n}: {{assembly: d{n}.yaml, at: {{in: base.origin}}}}\n" for n in range(2000))
    return _document(folder, HEAD + "components:\n  base: {frame: true}\n" + lines)


def large_documents(folder: Path) -> str:
    """Thirty documents of nine megabytes each."""
    text = HEAD + "description: " + "x" * 9_000_000 + "\ncomponents: {f: {frame: true}}\n"
    for n in range(30):
        _document(folder, text, f"d{n}.yaml")
    lines = "".join(f"  c{n}: {{assembly: d{n}.yaml, at: {{in: base.origin}}}}\n" for n in range(30))
    return _document(folder, HEAD + "components:\n  base: {frame: true}\n" + lines)


def missing_files(folder: Path) -> str:
    """30 000 references to missing documents, next to a thousand files with similar names."""
    for n in range(1000):
        (folder / f"some_document_of_a_rather_long_name_{n}.yaml").touch()
    lines = "".join(f"  c{n}: {{assembly: some_document_of_a_rather_long_name_x{n}.yaml}}\n" for n in range(30_000))
    return _document(folder, HEAD + "components:\n" + lines)


def missing_parts(folder: Path) -> str:
    """30 000 references to missing parts, next to a thousand modules with similar names."""
    for n in range(1000):
        (folder / "parts" / f"some_module_of_a_rather_long_name_{n}.py").touch()
    lines = "".join(f"  c{n}: {{part: 'some_module_of_a_rather_long_name_x{n}:Part'}}\n" for n in range(30_000))
    return _document(folder, HEAD + "components:\n" + lines)


def materials_chain(folder: Path) -> str:
    """Library materials with names of 100 000 characters."""
    lines = "".join(f"  m{n}: {{base: 'bd_materials:{'a' * 100_000}{n}'}}\n" for n in range(50))
    return _document(folder, HEAD + "materials:\n" + lines + FRAME)


def mimic_chain(folder: Path) -> str:
    """2000 joints; each mimics the previous one."""
    inertia = "mass: 1 kg, inertia: {ixx: 1 kg*m^2, iyy: 1 kg*m^2, izz: 1 kg*m^2}"
    components = f"  c0: {{frame: true, {inertia}}}\n" + "".join(f"  c{n}: {{frame: true, {inertia}}}\n" for n in range(1, 2000))
    joints = "".join(
        f"  j{n}: {{type: continuous, parent: c{n - 1}.origin, child: c{n}.origin"
        + (f", mimic: {{joint: j{n - 1}, multiplier: 2}}" if n > 1 else "") + "}\n" for n in range(1, 2000))
    return _document(folder, HEAD + "components:\n" + components + "joints:\n" + joints)


def placement_circles(folder: Path) -> str:
    """20 000 components that are placed on each other in pairs."""
    pair = "  a{0}: {{frame: true, at: {{in: b{0}.origin}}}}\n  b{0}: {{frame: true, at: {{in: a{0}.origin}}}}\n"
    lines = "".join(pair.format(n) for n in range(10_000))
    return _document(folder, HEAD + FRAME + lines)


def exports_chain(folder: Path) -> str:
    """Mounts that are exported through ninety documents, by two hundred names each."""
    for level in range(90):
        inner = f"{{assembly: level{level + 1}.yaml}}" if level < 89 else "{frame: true}"
        mounts = "".join(f"  m{n}: a.{f'm{n}' if level < 89 else 'origin'}\n" for n in range(200))
        _document(folder, f"thingc: assembly/1\nname: level{level}\ncomponents:\n  a: {inner}\nmounts:\n{mounts}", f"level{level}.yaml")
    return "level0.yaml"


def unicode_surprises(folder: Path) -> str:
    """Letters that look alike, combine, change the writing direction, or grow when their case changes."""
    words = ["\u0130" * 500, "e" + "\u0301" * 500, "\u202eabc", "\U0001f468\u200d\U0001f469\u200d\U0001f467" * 100, "\ufb03" * 500,
        "ß" * 500, "\u0660\u0661 mm"]
    lines = "".join(f"  \"{word}{n}\": {{frame: true}}\n" for n, word in enumerate(words * 30))
    return _document(folder, HEAD + "components:\n" + lines + "".join(f"\"{word}\": \"{word}\"\n" for word in words))


def bad_bytes(folder: Path) -> str:
    """Nine megabytes that are invalid UTF-8 only at the end."""
    return _document(folder, (HEAD + "description: " + "x" * 9_000_000).encode() + b"\xff")


def zeros(folder: Path) -> str:
    """Nine megabytes of zero bytes."""
    return _document(folder, b"\0" * 9_000_000)


def too_large(folder: Path) -> str:
    """A file of a hundred gigabytes (sparse)."""
    name = _document(folder, HEAD)
    os.truncate(folder / name, 100_000_000_000)
    return name


def large_lock(folder: Path) -> str:
    """A lock file of a hundred gigabytes (sparse)."""
    (folder / "parts.lock.json").write_bytes(b"{")
    os.truncate(folder / "parts.lock.json", 100_000_000_000)
    return _document(folder, HEAD + "components: {a: {part: 'blocks:Block'}}\n")


def deep_lock(folder: Path) -> str:
    """A lock file with deeply nested brackets."""
    (folder / "parts.lock.json").write_text('{"thingc": "lock/1", "things": ' + "[" * 4_000_000)
    return _document(folder, HEAD + "components: {a: {part: 'blocks:Block'}}\n")


def digits_lock(folder: Path) -> str:
    """A lock file with a number of a million digits."""
    (folder / "parts.lock.json").write_text('{"thingc": "lock/1", "things": {"blocks:Block": ' + "9" * 1_000_000 + "}}")
    return _document(folder, HEAD + "components: {a: {part: 'blocks:Block'}}\n")


def large_python(folder: Path) -> str:
    """Part code of three megabytes, and an import chain of a thousand modules."""
    (folder / "parts" / "large.py").write_text("x = [" + "1, " * 1_000_000 + "]\nclass Large: pass\n")
    for n in range(1000):
        (folder / "parts" / f"chain{n}.py").write_text(f"from chain{n + 1} import Part\n")
    return _document(folder, HEAD + "components: {a: {part: 'large:Large'}, b: {part: 'chain0:Part'}, c: {part: 'blocks:Block'}}\n")


def deep_python(folder: Path) -> str:
    """Part code that exceeds the limits of Python parsers."""
    (folder / "parts" / "deep.py").write_text("class Deep:\n    x = " + "(" * 100_000 + "\n")
    (folder / "parts" / "dots.py").write_text("class Dots:\n    x = a" + ".a" * 300_000 + "\n")
    (folder / "parts" / "sums.py").write_text("class Sums:\n    x = 1" + "+1" * 300_000 + "\n")
    return _document(folder, HEAD + "components: {a: {part: 'deep:Deep'}, b: {part: 'dots:Dots'}, c: {part: 'sums:Sums'}}\n")


def settings(folder: Path) -> str:
    """A workspace file with nine megabytes of part folders."""
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = [' + '"parts", ' * 900_000 + "]\n")
    return _document(folder, HEAD + FRAME)


def deep_settings(folder: Path) -> str:
    """A workspace file with deeply nested brackets."""
    (folder / "thingc.toml").write_text('thingc = "workspace/1"\nparts = ' + "[" * 1_000_000 + "\n")
    return _document(folder, HEAD + FRAME)


# --- the same in TOML --------------------------------------------------------------------------------------------------

TOML = 'thingc = "assembly/1"\nname = "bomb"\n'


def toml_deep(folder: Path) -> str:
    """Deeply nested brackets in TOML."""
    return _document(folder, TOML + "a = " + "[" * 1_000_000, "bomb.toml")


def toml_deep_table(folder: Path) -> str:
    """A dotted key with 100 000 parts in TOML."""
    return _document(folder, TOML + "a" + ".a" * 100_000 + " = 1\n", "bomb.toml")


def toml_deep_header(folder: Path) -> str:
    """A table header with 100 000 dotted parts."""
    return _document(folder, TOML + "[a" + ".a" * 100_000 + "]\n", "bomb.toml")


def toml_keys(folder: Path) -> str:
    """Ten megabytes of unknown keys."""
    return _document(folder, TOML + "".join(f"k{n:06} = 1\n" for n in range(700_000)), "bomb.toml")


def toml_tables(folder: Path) -> str:
    """200 000 components, each in its own table."""
    return _document(folder, TOML + "".join(f"[components.c{n}]\nframe = true\n" for n in range(200_000)), "bomb.toml")


def toml_array_of_tables(folder: Path) -> str:
    """An array of tables where a table is expected."""
    return _document(folder, TOML + "[[components]]\n" * 500_000, "bomb.toml")


def toml_digits(folder: Path) -> str:
    """Numbers of a million digits."""
    text = f"[parameters]\na = {'9' * 1_000_000}\nb = 1e999999\nc = 0x{'f' * 1_000_000}\nd = 1.{'0' * 1_000_000}\n"
    return _document(folder, TOML + text, "bomb.toml")


def toml_one_text(folder: Path) -> str:
    """An unterminated string of nine megabytes."""
    return _document(folder, TOML + 'description = """' + "\\u0041" * 1_500_000, "bomb.toml")


def toml_escapes(folder: Path) -> str:
    """A long line with many syntax errors."""
    return _document(folder, TOML + "= = = [[ ]] " * 500_000, "bomb.toml")


_HELPERS = {"Callable", "Path"}
BOMBS: dict[str, Callable[[Path], str]] = {
    name: made for name, made in list(globals().items())
    if callable(made) and not name.startswith("_") and name not in _HELPERS and getattr(made, "__module__", "") == __name__
}
