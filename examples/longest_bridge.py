"""Search for the largest distance between the soles of MInchW: `make bridge-search`, or `python examples/longest_bridge.py`.

The search varies the lengths of leg and body with the batch document `assemblies/minchw/bridge_search.yaml`. The result is the longest
bridge in which every drive has a torque margin of at least 1.3. With `--driver random`, the search builds a random sample. With
`--driver optuna`, Optuna selects the variants.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import thingc.batch
from bridge_drivers import DRIVERS, Driver
from bridge_report import Tried, draw, page, rebuilt
from thingc import Options

ROOT = Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "assemblies" / "minchw" / "bridge_search.yaml"


def search(driver: Driver, output: str | None, store: str | None, jobs: int) -> list[Tried]:
    """Build every document that the driver returns, and report the results to the driver. Return the results of all variants."""
    found: list[Tried] = []
    while (document := driver.ask()) is not None:
        summary = thingc.batch.run(str(document), output=output, jobs=jobs, options=Options(store=store), on_progress=_progress)
        print(file=sys.stderr)
        rows = [tried(row, summary.folder) for row in thingc.batch.load(summary.folder).rows]
        driver.tell(rows)
        found += rows
    return found


def tried(row: Any, folder: str) -> Tried:
    """Convert the row of a variant in the results table to a `Tried` object. A variant that was refused or failed ends the search, because
    it has no results.
    """
    if "torque_margin" not in row:
        raise SystemExit(f"variant {row['name']} is {row['status']}: {row.get('message', '')}")
    return Tried(
        name=row["name"], leg=row["parameters.leg_length"], body=row["parameters.body_length"], bridge=row["reach"],
        margin=row["torque_margin"], mass=row["mass"], feasible=row["status"] == "built", command=row["command"],
        folder=str(Path(folder, row["path"])) if "path" in row else None,
    )


def _progress(now: thingc.batch.Progress) -> None:
    print(f"\r{now.done} of {now.count}", end="", file=sys.stderr, flush=True)


def main() -> int:
    """Run the search and print the results. If `--docs` is given, also write the page and its plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--driver", choices=DRIVERS, default="random", help="how to select variants (default: random)")
    parser.add_argument("--count", type=int, help="number of variants (default: that of the document)")
    parser.add_argument("--docs", type=Path, help="folder of the page and, in `pictures`, of the figure (default: print only)")
    parser.add_argument("-o", "--output", help="folder of the batches (default: the workspace's build folder)")
    parser.add_argument("--store", help="folder of cached parts (default: the user's cache)")
    parser.add_argument("--jobs", type=int, default=0, help="number of variants to build in parallel (default: one per core)")
    given = parser.parse_args()
    options = Options(store=given.store)
    try:
        driver = DRIVERS[given.driver](DOCUMENT, given.count, options)
        found = search(driver, given.output, given.store, given.jobs)
    except thingc.batch.BatchFault as fault:
        print(fault.diagnostic.message, fault.diagnostic.help or "", sep="\n", file=sys.stderr)
        return 1
    except thingc.batch.Interrupted as stopped:
        print(f"\n{stopped}", file=sys.stderr)
        return 130
    best = max((one for one in found if one.feasible), key=lambda one: one.bridge, default=None)
    text = page(found, best, None if best is None else rebuilt(best), given.driver)
    print(text, end="")
    if given.docs is not None:
        (given.docs / "pictures").mkdir(parents=True, exist_ok=True)
        shown = given.docs / "variants_search.md"
        before, marker, _ = (shown.read_text() if shown.exists() else "").partition("<!-- the longest bridge -->\n")
        shown.write_text(before + marker + text)
        draw(found, best, given.docs / "pictures" / "bridge_search.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
