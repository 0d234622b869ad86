"""Where a cursor stands in a document that need not parse at this moment, and what is written of that document as far as can be told.

Half a key, half a value, an open bracket or quote, an empty line at some depth: of each the path of keys that leads there, whether a
key or a value stands there, what is typed of it already, and which characters a completion replaces.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from thingc.base.frozen_struct import FrozenStruct
from thingc.base.source import Path
from thingc.tools.lsp.scan import Scan
from thingc.tools.lsp.toml_scan import TomlScan
from thingc.tools.lsp.yaml_scan import YamlScan


class Cursor(FrozenStruct):
    """A place in a text, in characters from its beginning.

    `role`: a `key` of the mapping at `path`, or the `value` there (`either`: it may be the first key of a mapping as well as a value
    on a line of its own, `path` is the same). `typed` stands before the cursor, from `start` on; a completion replaces `start` to
    before `end`, which lie on one line. `quote` is what was opened before it, `flow`: inside brackets, `header`: in the header of a
    TOML table; `separated`: a key has its `:` or `=` already; `toml`: the language.

    `keys` and `scalars` are those of the whole text: the keys of every mapping without the one at the cursor, and the text of
    every value that is one.
    """

    role: Literal["key", "value"]
    path: Path
    typed: str
    start: int
    end: int
    either: bool
    quote: str
    flow: bool
    header: bool
    separated: bool
    toml: bool
    keys: Mapping[Path, tuple[str, ...]]
    scalars: Mapping[Path, str]


def cursor_at(text: str, offset: int, *, toml: bool) -> Cursor | None:
    """The cursor before the character `offset` of a text; None in comments and texts of several lines, where nothing is completed."""
    scan: Scan = (TomlScan if toml else YamlScan)(text, offset)
    scan.run()
    place = scan.place
    if place is None or scan.muted:
        return None
    end = min(place.end, scan.line_end(offset))
    line = max(text.rfind("\n", 0, offset), text.rfind("\r", 0, offset)) + 1
    start = max(place.start, line)
    own = scan.keys.get(place.path, {})
    after = scan.spaces(end + len(place.quote) if text.startswith(place.quote, end) else end)
    return Cursor(
        role=place.role, path=place.path, typed=text[start:offset], start=start, end=end, either=place.either, quote=place.quote,
        flow=place.flow, header=place.header, separated=place.role == "key" and text.startswith(scan.SEPARATOR, after), toml=toml,
        keys={
            path: tuple(name for name, at in names.items() if not (names is own and place.role == "key" and at == place.start))
            for path, names in scan.keys.items()
        },
        scalars=scan.scalars,
    )
