// The bill of materials with totals and CSV export. Selecting a row selects all its pieces.

import { type BomRow, counted, shownMass } from "../data";
import type { Viewer } from "../viewer";
import { download } from "./copying";
import { breakable, make } from "./dom";

/** The columns of `bom.csv`, with the keys of their values. */
const COLUMNS: [string, keyof BomRow][] = [
  ["number", "number"], ["name", "name"], ["definition", "definition"], ["quantity", "quantity"], ["make", "make"], ["material", "material"], ["mass", "mass"],
  ["mass_source", "source"], ["supplier", "supplier"], ["cost", "cost"], ["total", "total"], ["link", "link"], ["picture", "picture"],
];

export function bomPanel(panel: HTMLElement, viewer: Viewer): void {
  let rows: { row: HTMLTableRowElement; pieces: number[] }[] = [];

  const build = (): void => {
    const { bom, name } = viewer.robot;
    rows = bom.map((one) => {
      const { pieces } = one;
      const choose = (): void => viewer.choose(pieces);
      const row = make(
        "tr", { tabindex: 0, onclick: choose, onkeydown: (event) => { if (["Enter", " "].includes((event as KeyboardEvent).key)) { event.preventDefault(); choose(); } } },
        make("td", {}, one.number),
        make("td", { title: one.definition }, ...picture(one), ...breakable(one.name), make("small", {}, details(one)), ...shop(one)),
        make("td", { class: "number" }, String(one.quantity)),
        make("td", { class: "number", title: one.source }, shownMass(one.mass)),
      );
      return { row, pieces };
    });
    if (rows.length === 0) {
      panel.replaceChildren(make("p", { class: "soft" }, "No parts to print, machine or buy"));
      return;
    }
    const head = make("tr", {}, ...["No.", "Part", "Qty", "Unit mass"].map((word, k) => make("th", { class: k >= 2 ? "number" : "" }, word)));
    const body = make("tbody", {}, ...rows.map(({ row }) => row));
    const save = make("button", { type: "button", title: "Save the bill of materials as CSV", onclick: () => download(`${name}_bom.csv`, csv(bom)) }, "Export CSV");
    panel.replaceChildren(make("table", { role: "grid", "aria-label": "Bill of materials" }, make("thead", {}, head), body, totals(bom)), ...costs(bom), save);
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

/** How a part is made or bought, and what it costs. */
function details({ make: made, material, supplier, cost, total, quantity }: BomRow): string {
  const price = cost !== null && total !== null && quantity > 1 ? `${cost} each, ${total}` : cost;
  return [made, material, supplier, price].filter((word) => word !== null).join(", ");
}

/** The picture of a part, if any. */
function picture({ image, name }: BomRow): Node[] {
  return image === null ? [] : [make("img", { src: image, alt: name })];
}

/** A link to the web page of a part, if any. The text of a part class can be any text. */
function shop({ link }: BomRow): Node[] {
  if (link === null || !/^https?:/.test(link)) return [];
  return [make("a", { href: link, target: "_blank", rel: "noopener noreferrer", onclick: (event) => event.stopPropagation() }, new URL(link).hostname)];
}

/** The number of pieces and their mass. */
function totals(bom: BomRow[]): HTMLElement {
  const quantity = bom.reduce((sum, one) => sum + one.quantity, 0), mass = bom.reduce((sum, one) => sum + one.quantity * one.mass, 0);
  return make("tfoot", {}, make("tr", {},
    make("th", { colspan: 2, scope: "row" }, "Total"), make("td", { class: "number" }, String(quantity)), make("td", { class: "number" }, shownMass(mass)),
  ));
}

/** The total cost for each currency, and the number of pieces without a cost; empty if no row has a cost. */
function costs(bom: BomRow[]): HTMLElement[] {
  const sums = new Map<string, number>();
  for (const { total } of bom) {
    const [amount, currency] = (total ?? "").split(" ");
    if (currency !== undefined) sums.set(currency, (sums.get(currency) ?? 0) + Number(amount));
  }
  if (sums.size === 0) return [];
  const missing = bom.reduce((sum, { total, quantity }) => sum + (total === null ? quantity : 0), 0);
  const total = [...sums].map(([currency, sum]) => `${sum.toFixed(2)} ${currency}`).join(" + ");
  return [make("p", {}, `Total cost: ${total}`, make("small", { class: "soft" }, missing > 0 ? ` (${counted(missing, "piece")} without a cost)` : ""))];
}

/** The same rows as in `bom.csv`. Text that a spreadsheet would evaluate gets a leading apostrophe. */
function csv(bom: BomRow[]): Blob {
  const cell = (value: unknown): string => {
    const text = String(value ?? "");
    const safe = /^[=+\-@]/.test(text) && !Number.isFinite(Number(text)) ? `'${text}` : text;
    return /[",\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  const lines = bom.map((one) => COLUMNS.map(([, key]) => cell(one[key])).join(","));
  return new Blob([[COLUMNS.map(([name]) => name).join(","), ...lines, ""].join("\n")], { type: "text/csv" });
}
