"""Which variant is meant by an id or a name: where there is a batch, the one in its table."""

from __future__ import annotations

from thingc.base.diagnostics import Code, shown_path
from thingc.batch.build_records import BuildRecords
from thingc.batch.folder import BatchFault, in_words, read_batch, whole
from thingc.batch.journal import Line
from thingc.batch.planning import Plan, Variant


def find_variant(plan: Plan, wanted: str, folder: str) -> tuple[Variant, str | None] | None:
    """The variant of this id or name, and the rule that it does not keep; None where there is none.

    An id is of what differs from the assembly's document, and names are counted: when a document has changed since the batch was built,
    as it does with every variant that is adopted, either may be that of another variant. So what the batch in `folder` has under it is
    looked for by its settings. Raises `BatchFault` where no variant has these any more.
    """
    line = _told(plan, wanted, folder)
    if line is None:
        variant = next((one for one in plan if wanted in (one.id, one.name)), None)
        return None if variant is None else (variant, variant.failed)
    for variant in plan:
        if (dict(variant.values), plan.chosen(variant)) == (line["parameters"], line["choices"]):
            return variant, variant.failed or line.get("rule")
    raise BatchFault(
        Code.BATCH_CHANGED,
        f"no variant of `{plan.relative}` has the settings any more that `{wanted}` has in `{shown_path(folder)}`",
        "the documents have changed since that batch was built: build it anew, and take an id from its table",
    )


def _told(plan: Plan, wanted: str, folder: str) -> Line | None:
    """The last line of the batch in `folder` that is about this id or name, if that is a batch of this document."""
    described = read_batch(folder)
    if described is None or described.get("document") != plan.relative:
        return None
    try:
        whole(folder, described)
        done = BuildRecords(folder)
        index = done.find(wanted)
        return None if index is None else done.line(index)
    except OSError as fault:
        raise in_words(folder, fault) from fault
