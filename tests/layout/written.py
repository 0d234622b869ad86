"""Random documents in every layout that YAML allows, with a comment in any possible place."""

from __future__ import annotations

from hypothesis import strategies as st

NAMES = ("plate", "lever", "arm_2", "zeta", "alpha", "knee")
SCALARS = (
    "120 mm", "120mm", "-3.5deg", "0 0 4mm", "[0, 4mm, 0]", "boxes:Plate", '"quoted: # text"', "'it''s'", "=reach / 2 + 8 mm", "true",
    "0", "1e-3", '"=min(a, 80 mm)"', "plate.top", "a b#c", "12.50 EUR",
)
SPACES = st.sampled_from(("", " ", "  ", "     "))


class Writer:
    """Writes one document; every comment has its own number."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.count = 0
        self.anchors: list[str] = []
        self.lines: list[str] = []

    def some(self, *choices: object) -> object:
        return self.draw(st.sampled_from(choices))

    def often(self) -> bool:
        return bool(self.draw(st.booleans()))

    def rarely(self) -> bool:
        return self.draw(st.integers(0, 5)) == 0

    def comment(self) -> str:
        self.count += 1
        return f"#{self.some(' ', '')}c{self.count}."

    def tail(self) -> str:
        """Return the possible end of a line: spaces, a comment."""
        if self.rarely():
            return f"{self.some(' ', '   ', '          ')}{self.comment()}{self.some('', '  ')}"
        return str(self.some("", "", "", "  "))

    def above(self, indent: int) -> None:
        """Write empty lines and comments above a key."""
        while self.rarely():
            column = int(str(self.some(indent, indent, indent + 3)))
            self.lines.append(str(self.some("", "  ")) if self.often() else " " * column + self.comment())

    def scalar(self) -> str:
        if self.anchors and self.rarely():
            return f"*{self.some(*self.anchors)}"
        return str(self.some(*SCALARS))

    def flow(self, keys: tuple[str, ...], depth: int) -> str:
        """Return a flow mapping or sequence, sometimes over several lines."""
        wide = self.rarely()

        def gap(mark: str) -> str:
            if not wide:
                return f"{self.draw(SPACES)}{mark}{self.draw(SPACES)}" if mark else self.draw(SPACES)
            note = f"  {self.comment()}" if self.rarely() else ""
            return f"{mark}{note}\n{' ' * 12}"

        parts = []
        for key in keys:
            value = self.flow(self.keys(NAMES), depth + 1) if depth < 2 and self.rarely() else self.scalar()
            parts.append(f"{key}:{self.some(' ', '  ')}{value} ")
        return "{" + gap("") + gap(",").join(parts) + gap("") + "}"

    def keys(self, among: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(self.draw(st.lists(st.sampled_from(among), unique=True, max_size=5)))

    def long(self, indent: int) -> str:
        """Return a scalar over several lines."""
        inner = " " * (indent + 4)
        return str(self.some(
            f"|\n{inner}two\n{inner}  lines   \n\n{inner}here", f">-\n{inner}folded\n\n{inner}text", f'"over\n{inner}two lines"',
            f"plain\n{inner}text over lines",
        ))

    def entry(self, key: str, indent: int, below: tuple[str, ...] | None, depth: int) -> None:
        """Write `key:` with a value: a block, a flow collection, or a scalar. `below` are the possible keys of its mapping."""
        self.above(indent)
        head = " " * indent + key + ":"
        names = self.keys(below if below is not None else NAMES)
        if depth < 3 and names and self.often():
            anchor = ""
            if self.rarely():
                anchor = f" &a{self.count}_{len(self.lines)}"
            self.lines.append(head + anchor + self.tail())
            self.mapping(names, indent + int(str(self.some(1, 2, 2, 4))), depth + 1)
            if anchor:
                self.anchors.append(anchor[2:])
            if self.rarely():
                self.lines.append(" " * (indent + 5) + self.comment())
        elif self.rarely():
            self.lines.append(head + self.tail())
            dashes = " " * (indent + int(str(self.some(0, 2, 4))))
            for _ in range(2):
                self.lines.append(f"{dashes}-{self.some(' ', '   ')}{self.some(self.scalar(), self.flow((), 1))}{self.tail()}")
        elif self.rarely():
            self.lines.extend(f"{head} {self.long(indent)}".split("\n"))
        else:
            value = self.flow(names, 0) if self.often() else self.scalar()
            self.lines.extend(f"{head}{self.some(' ', ' ', '   ')}{value}{self.tail()}".split("\n"))

    def mapping(self, keys: tuple[str, ...], indent: int, depth: int) -> None:
        for key in keys:
            self.entry(key, indent, (*COMPONENT, *NAMES), depth)

    def document(self) -> str:
        keys = ["name", *self.keys(("description", "components", "joints", "modes", "raw", "materials", "zzz", "parameters"))]
        keys.insert(int(str(self.some(0, 0, 1))), "thingc")
        if self.rarely():
            self.lines += [self.comment(), ""]
        for key in keys:
            if key == "thingc":
                self.above(0)
                self.lines.append("thingc: assembly/1" + self.tail())
            else:
                self.entry(key, 0, NAMES if key in ("components", "joints", "modes") else None, 0)
        text = "\n".join(self.lines) + str(self.some("\n", "", "\n\n  \n"))
        return text.replace("\n", "\r\n") if self.rarely() else text


COMPONENT = ("part", "params", "attach", "at", "repeat", "collision", "mass", "parent", "type", "limit", "xyz", "gap", "root", "extends")


@st.composite
def documents(draw: st.DrawFn) -> str:
    """Return the text of a YAML document that is (mostly) well-formed and has no meaningful content."""
    return Writer(draw).document()
