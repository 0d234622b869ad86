"""Items are grouped by a key, in their order."""

from __future__ import annotations

from thingc.base.grouping import group_by


def test_groups_preserve_the_order_of_keys_and_items() -> None:
    groups = group_by(["pear", "fig", "plum", "apple", "kiwi"], len)
    assert list(groups.items()) == [(4, ["pear", "plum", "kiwi"]), (3, ["fig"]), (5, ["apple"])]
    assert group_by([], len) == {}
