"""Write `book/NAME.html` and `.pdf`: how to assemble the robot, in one page with pictures. The bill of materials comes first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from importlib import resources

from thingc.base.numeric import degrees, dist
from thingc.base.pose import MATE, rpy_of
from thingc.base.safe_text import html_text
from thingc.documents.workspace import Workspace
from thingc.model.assembly.types import Assembly, Mate, Occurrence
from thingc.targets import Artifacts, EmitRequest, Loss
from thingc.targets.bom.emit import BomRow, is_listed, plain_name, with_pieces
from thingc.targets.html.viewer_data import image_url
from thingc.targets.render.picture import NoGraphics, ready
from thingc.tools.workshop.assembly_steps import AssemblyStep, Piece, Section, sections
from thingc.tools.workshop.book_pictures import Pictures
from thingc.tools.workshop.pdf import with_pdf

STYLE = resources.files(__package__).joinpath("book.css").read_text(encoding="utf-8")
ZERO = "0, 0, 0"


def emit(request: EmitRequest) -> Artifacts:
    """Write the page. If this machine cannot render pictures, they are an export loss."""
    assembly = request.assembly
    losses: list[Loss] = []
    pictures: Pictures | None = None
    try:
        ready()
        pictures = Pictures(assembly, request.store)
    except NoGraphics as fault:
        losses.append(Loss("book", None, assembly.name, f"pictures ({fault})", "omitted", assembly.definition.origin))
    book = _Book(assembly, pictures, request.workspace)
    lines = [*book.head()]
    for section in sections(assembly, request.store, request.report):
        lines += book.section(section)
    page = "\n".join([*lines, "</body></html>", ""]).encode()
    return with_pdf(Artifacts(files={f"book/{assembly.name}.html": page}, losses=tuple(losses)), "book", page, assembly)


class _Book:
    def __init__(self, assembly: Assembly, pictures: Pictures | None, workspace: Workspace) -> None:
        self._assembly, self._pictures, self._workspace = assembly, pictures, workspace
        self._rows = with_pieces(assembly)
        self._row_of = {one.index: row for row, pieces in self._rows for one in pieces}
        self._titles: dict[str, str] = {}
        self._chapters: dict[str, int] = {}

    def head(self) -> Iterator[str]:
        """Yield the beginning of the page: its title and the bill of materials."""
        name = html_text(self._assembly.name)
        yield f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{name}: assembly</title>'
        yield f"<style>{STYLE}</style></head><body>"
        pieces = sum(row.quantity for row, _ in self._rows)
        yield f"<h1>{name}</h1><p>{pieces} part{'s' * (pieces != 1)}, {1e3 * self._assembly.properties.mass:.4g} g</p><h2>Parts</h2>"
        prices = any(row.cost for row, _ in self._rows)
        headings = ("", "No.", "Part", "Quantity", "Source", "Material", *(("Price", "Total") if prices else ()))
        yield f"<table><tr>{''.join(f'<th>{head}</th>' for head in headings)}</tr>"
        for row, occurrences in self._rows:
            is_web_link = row.link is not None and row.link.startswith(("https://", "http://"))
            name = html_text(_label(row, occurrences[0]))
            link = f'<a href="{html_text(row.link or "")}">{name}</a>' if is_web_link else name
            cost = (row.cost or "", row.total or "") if prices else ()
            number, *rest = (f"<td>{html_text(cell)}</td>" for cell in (row.number, str(row.quantity), row.make, row.material or "", *cost))
            yield f"<tr><td>{self._picture(row, occurrences[0])}</td>{number}<td>{link}</td>{''.join(rest)}</tr>"
        yield "</table>"
        for currency, total in _totals(row for row, _ in self._rows).items():
            yield f"<p>Total of the parts with a price: {total} {html_text(currency)}</p>"

    def _picture(self, row: BomRow, first: Occurrence) -> str:
        url = image_url(self._workspace, row.picture)
        if url is None and self._pictures is not None:
            url = self._pictures.part(first)
        return _image(url, row.name)

    def section(self, section: Section) -> Iterator[str]:
        """Yield the steps of one assembly."""
        number = self._chapters[section.chapter] = len(self._chapters) + 1
        self._titles[section.chapter] = section.title
        times = f" (build {section.count})" if section.count > 1 else ""
        yield f"<h2>{number}. {html_text(section.title)}{times}</h2>"
        done: list[Piece] = []
        for index, step in enumerate(section.steps, 1):
            finished = [one for piece in done for one in piece.occurrences]
            url = None if self._pictures is None else self._pictures.step(finished, step, (done or step.pieces)[0].first)
            done += step.pieces
            yield f'<div class="step">{_image(url, f"step {number}.{index}")}<div><div class="number">{number}.{index}</div><ul>'
            yield f"<li><b>{len(step.pieces)} &times; {self._name(step.pieces[0])}</b></li>"
            yield from (f"<li>{line}</li>" for line in self._mates(step, section.path, first=index == 1))
            yield from (f"<li>{line}</li>" for line in self._closing_joints(step, done, section.path))
            yield "</ul>"
            if step.blocked:
                others = ", ".join(f"<code>{html_text(name)}</code>" for name in step.blocked) or "its neighbours"
                yield f'<p class="note">Insertion along the axes of the mount is blocked: fit together with {others}.</p>'
            yield "</div></div>"

    def _name(self, piece: Piece) -> str:
        if piece.chapter is not None:
            return f"{html_text(self._titles[piece.chapter])}, from chapter {self._chapters[piece.chapter]}"
        row = self._row_of[piece.first.index]
        ambiguous = any(other.name == row.name and other.definition != row.definition for other, _ in self._rows)
        return f"{html_text(_label(row, piece.first) if ambiguous else row.name)} (No. {html_text(row.number)})"

    def _mates(self, step: AssemblyStep, path: str, *, first: bool) -> Iterator[str]:
        """Yield a text about the mounts that meet, and a text for each joint.

        In the first step, no part is in place, so only mates with frames that are not parts are described.
        """
        mates = [piece.mate for piece in step.pieces if piece.mate is not None]
        mates = [mate for mate in mates if not first or not is_listed(self._assembly.occurrences[mate.parent])]
        if mates:
            yield "; ".join(self._describe_mate(mate, path) for mate in mates)
        for mate in mates:
            yield from _joint(mate, path)

    def _describe_mate(self, mate: Mate, path: str) -> str:
        """Describe how two mounts meet: `a.seat on b.rim`, or with the offset from the mount of the parent."""
        child, parent = self._mount(mate.child, mate.child_mount, path), self._mount(mate.parent, mate.parent_mount, path)
        parts = self._assembly.occurrences
        seat = mate.X_JC @ parts[mate.child].mounts[mate.child_mount].pose
        offset = parts[mate.parent].mounts[mate.parent_mount].pose.inverse() @ mate.X_PJ @ seat
        if all(dist(row, other) < 1e-6 for row, other in zip(seat.rotation, MATE.rotation, strict=True)):
            offset @= MATE  # the mounts face each other
        xyz, rpy = _numbers(1e3 * value for value in offset.translation), _numbers(map(degrees, rpy_of(offset.rotation)))
        words = f"{child} on {parent}" if xyz == ZERO else f"{child} at {xyz} mm from {parent}"
        return words if rpy == ZERO or mate.joints else f"{words}, rotated by {rpy} deg (roll, pitch, yaw)"

    def _closing_joints(self, step: AssemblyStep, done: Sequence[Piece], path: str) -> Iterator[str]:
        """Yield the joints that close loops between the new pieces and all others."""
        new, present = ({one.index for piece in pieces for one in piece.occurrences} for pieces in (step.pieces, done))
        for mate in self._assembly.mates:
            ends = {mate.parent, mate.child}
            inside = any(ends <= {one.index for one in piece.occurrences} for piece in done)
            if mate.loop is not None and ends & new and ends <= present and not inside:
                yield (f"{self._mount(mate.child, mate.child_mount, path)} on {self._mount(mate.parent, mate.parent_mount, path)} "
                       f"closes the loop <code>{html_text(_local(mate.loop, path))}</code>")

    def _mount(self, occurrence: int, mount: str, path: str) -> str:
        return f"<code>{html_text(_local(self._assembly.occurrences[occurrence].path, path))}.{html_text(mount)}</code>"


def _joint(mate: Mate, path: str) -> Iterator[str]:
    if mate.joints and mate.name is not None:
        yield f"joint <code>{html_text(_local(mate.name, path))}</code> ({mate.joints[0].kind.name}) must move freely"


def _label(row: BomRow, first: Occurrence) -> str:
    """Return the name of a row, for a part with the parameters that differ from their defaults: `Screw (length=14 mm)`."""
    made = next((one for one in (first.definition, first.definition.plain) if one is not None and one.text == row.definition), None)
    return row.name if made is None or made.kind != "part" else f"{plain_name(first)} {made.label.removeprefix(made.reference)}".rstrip()


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{round(value, 3) + 0.0:.9g}" for value in values)


def _local(path: str, group: str) -> str:
    """Return a path relative to a nested assembly."""
    return path.removeprefix(f"{group}/").removeprefix(f"{group}.") if group else path


def _totals(rows: Iterable[BomRow]) -> dict[str, Decimal]:
    """Return the sum of the prices in each currency."""
    totals: dict[str, Decimal] = {}
    for row in rows:
        if row.total is not None:
            amount, _, currency = row.total.partition(" ")
            totals[currency] = totals.get(currency, Decimal(0)) + Decimal(amount)
    return totals


def _image(url: str | None, title: str) -> str:
    return f'<img src="{url}" alt="{html_text(title)}">' if url is not None else ""
