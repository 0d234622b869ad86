// The display panel: geometry, overlays, colours, exploded view, section.

import { COLOURINGS, type Coloured, type Colouring } from "../colors";
import { MARKS, SHOWN, type Viewer } from "../viewer";
import { $, choices, make, select } from "./dom";

export function showPanel(panel: HTMLElement, viewer: Viewer): void {
  const shown = make("div", { class: "chips", role: "radiogroup", "aria-label": "Geometry" });
  const updates = [
    choices(shown, SHOWN, () => viewer.options.shown, (word) => viewer.setOptions({ shown: word as (typeof SHOWN)[number] })),
  ];
  const marks = make("div", { class: "checks" });
  for (const mark of MARKS) {
    const box = make("input", { type: "checkbox", onchange: () => viewer.toggle(mark) });
    marks.append(make("label", {}, box, mark));
    updates.push(() => { box.checked = viewer.options.marks.has(mark); });
  }
  const colour = select("Colour by", COLOURINGS, viewer.options.colouring, (word) => viewer.setOptions({ colouring: word as Colouring }));
  updates.push(() => { colour.querySelector("select")!.value = viewer.options.colouring; });

  const explode = make("input", {
    type: "range", min: 0, max: 1, step: 0.01, "aria-label": "Explode",
    oninput: (event) => viewer.explodeBy(Number((event.target as HTMLInputElement).value)),
  });
  updates.push(() => { explode.value = String(viewer.options.explode); });

  const axis = make("div", { class: "chips", role: "radiogroup", "aria-label": "Section plane" });
  const axes = ["none", "x", "y", "z"] as const;
  updates.push(choices(axis, axes, () => viewer.options.section.axis ?? "none", (word) => {
    viewer.cut(word === "none" ? null : (word as "x" | "y" | "z"));
  }));
  const flip = make("button", {
    type: "button", title: "Cut away the other side of the plane",
    onclick: () => viewer.setOptions({ section: { ...viewer.options.section, flip: !viewer.options.section.flip } }),
  }, "Flip");
  const part = make("input", {
    type: "range", min: 0, max: 1, step: 0.005, "aria-label": "Section position",
    oninput: (event) => viewer.setOptions({ section: { ...viewer.options.section, part: Number((event.target as HTMLInputElement).value) } }),
  });
  updates.push(() => {
    part.value = String(viewer.options.section.part);
    part.disabled = flip.disabled = viewer.options.section.axis === null;
  });
  panel.replaceChildren(
    make("h2", {}, "Geometry"), shown, make("h2", {}, "Overlays"), marks, make("h2", {}, "Colours"), colour,
    make("h2", {}, "Explode"), explode, make("h2", {}, "Section"), make("div", { class: "row" }, axis, flip), part,
  );
  let shownColours: Coloured | null = null;
  const update = (): void => {
    for (const one of updates) one();
  };
  viewer.listen((change) => {
    if (change === "options" || change === "robot") update();
    if (viewer.robot !== undefined && viewer.coloured !== shownColours) {
      shownColours = viewer.coloured;
      legend(viewer);
    }
  });
  update();
}

/** The legend of the colours. */
function legend(viewer: Viewer): void {
  const { title, legend: entries, note } = viewer.coloured;
  const own = $("legend");
  own.hidden = entries.length === 0 && note === null;
  own.replaceChildren(
    ...(entries.length > 0 ? [make("p", {}, make("strong", {}, title))] : []),
    ...entries.map(({ color, words }) => {
      const sample = make("i");
      sample.style.background = color;
      return make("p", {}, sample, words);
    }),
    ...(note === null ? [] : [make("p", {}, note)]),
  );
}
