"""Resolve entries of the bill of materials: of components, of nested assemblies, and of the catalogue of bought parts."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from typing import Any

from thingc.base.diagnostics import Code
from thingc.documents.spec.assembly import AssemblySpec
from thingc.documents.spec.catalog import CatalogRow, CatalogSpec
from thingc.model.resolve.document_scope import ResolveRun
from thingc.model.resolve.scope import DefaultLayers, Scope
from thingc.model.resolve.types import BomEntry


def bom_entry(scope: Scope, layers: DefaultLayers) -> BomEntry:
    """Return the entry of a component in the bill of materials. Missing keys come from the defaults in `layers`."""
    lines = layers.sub("bom")
    texts = {key: lines.pick(key).value for key in ("number", "supplier", "make", "link")}
    picture = lines.pick("picture").value
    return entry_of(
        lines.pick("cost").value, **texts, one=bool(lines.pick("as_")),
        picture=None if picture is None else path_in_workspace(scope.document.relative, picture),
    )


def entry_of(cost: str | Mapping[str, str] | None, **values: Any) -> BomEntry:
    """Return an entry with a price per piece, or with prices by the smallest quantities for which they apply."""
    if cost is None or isinstance(cost, str):
        return BomEntry(**values, cost=cost)
    return BomEntry(**values, prices=tuple(sorted((int(least), price) for least, price in cost.items())))


def catalog(context: ResolveRun, scope: Scope, spec: AssemblySpec) -> dict[str, BomEntry]:
    """Return the entries of the catalogue of a document, by order number.

    Rows of the same number are prices of one part by quantity. Report two rows with the same quantity, or with other different values.
    """
    document = context.documents.find_referenced(scope.document, spec.catalog) if spec.catalog is not None else None
    table = context.specs.get(document.relative) if document is not None else None
    if document is None or not isinstance(table, CatalogSpec):
        return {}
    rows: dict[str, list[CatalogRow]] = {}
    for index, row in enumerate(table.rows):
        alike = rows.setdefault(row.number, [])
        differ = [key for key in ("supplier", "link", "picture") if alike and getattr(row, key) not in (None, getattr(alike[0], key))]
        if any(row.quantity == one.quantity for one in alike) or differ:
            key, other = (differ[0], f"another `{differ[0]}`") if differ else ("quantity", f"the same quantity {row.quantity}")
            context.report.add(
                Code.NAME_CLASH, f"another row of `{row.number}` has {other}", document.span(("rows", index, key)),
                help=f"set `{key}` only in the first row" if differ else "remove one of the rows, or set another quantity",
            )
        alike.append(row)
    return {number: entry_of(
        {row.quantity: row.cost for row in (first, *others) if row.cost is not None}, supplier=first.supplier, link=first.link,
        picture=None if first.picture is None else path_in_workspace(document.relative, first.picture),
    ) for number, (first, *others) in rows.items()}


def path_in_workspace(document: str, text: str) -> str:
    """Convert the path of a file, which is relative to a document, to a path in the workspace. `document` is the path of the document."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(document), text))
