// The bill of materials: selecting a row selects all its pieces.

import { shownMass } from "../data";
import type { Viewer } from "../viewer";
import { breakable, make } from "./dom";

export function bomPanel(panel: HTMLElement, viewer: Viewer): void {
  let rows: { row: HTMLTableRowElement; pieces: number[] }[] = [];

  const build = (): void => {
    const { robot } = viewer;
    rows = robot.bom.map((one) => {
      const { pieces } = one;
      const choose = (): void => viewer.choose(pieces);
      const row = make(
        "tr", { tabindex: 0, onclick: choose, onkeydown: (event) => { if (["Enter", " "].includes((event as KeyboardEvent).key)) { event.preventDefault(); choose(); } } },
        make("td", {}, one.number),
        make("td", { title: one.definition }, ...breakable(one.name), make("small", {}, [one.make, one.material, one.supplier, one.cost].filter((word) => word !== null).join(", "))),
        make("td", { class: "number" }, String(one.quantity)),
        make("td", { class: "number", title: one.source }, shownMass(one.mass)),
      );
      return { row, pieces };
    });
    const head = make("tr", {}, ...["No.", "Part", "Qty", "Unit mass"].map((word, k) => make("th", { class: k >= 2 ? "number" : "" }, word)));
    panel.replaceChildren(make("table", { role: "grid", "aria-label": "Bill of materials" }, make("thead", {}, head), make("tbody", {}, ...rows.map(({ row }) => row))));
    if (rows.length === 0) panel.replaceChildren(make("p", { class: "soft" }, "No parts to print, machine or buy"));
    update();
  };

  const update = (): void => {
    for (const { row, pieces } of rows) {
      const chosen = pieces.length > 0 && pieces.length === viewer.choice.size && pieces.every((index) => viewer.choice.has(index));
      row.setAttribute("aria-selected", String(chosen));
    }
  };

  viewer.listen((change) => {
    if (change === "robot") build();
    else if (change === "choice") update();
  });
}
