"""`make bench-weld`: compare a robot whose foot is welded to the world with a robot whose foot is the root.

The command prints the page `docs/studies/weld_vs_root.md`, and writes the page and its figure.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
from formulations import ROOT, Study
from measured import measure
from study_figure import draw
from study_page import page


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="folder of `studies` (page) and `pictures` (figure)")
    parser.add_argument("--store", help="cache of built parts (default: the user's cache)")
    options = parser.parse_args()
    mujoco.set_mju_user_warning(lambda text: None)  # unstable welds are counted, not logged to a file
    found = measure(Study(options.store))
    text = page(found)
    print(text, end="")
    (options.docs / "pictures").mkdir(parents=True, exist_ok=True)
    (options.docs / "studies").mkdir(exist_ok=True)
    (options.docs / "studies" / "weld_vs_root.md").write_text(text)
    draw(found, options.docs / "pictures" / "weld_vs_root.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
