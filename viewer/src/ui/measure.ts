// The distance between two mounts.

import { trimmed } from "../data";
import type { Viewer } from "../viewer";
import { make } from "./dom";

export function measurePanel(panel: HTMLElement, viewer: Viewer): void {
  const result = make("div");
  let selects: HTMLSelectElement[] = [];

  const build = (): void => {
    const keys = viewer.mountKeys();
    selects = ([0, 1] as const).map((which) => {
      const own = make("select", {
        "aria-label": which === 0 ? "From mount" : "To mount", onchange: (event) => viewer.measure(which, (event.target as HTMLSelectElement).value),
      }, make("option", { value: "" }, "Select a mount"));
      own.append(...[...keys].map(([key, words]) => make("option", { value: key }, words)));
      return own;
    });
    panel.replaceChildren(
      make("p", { class: "soft" }, "Select two mounts, or click the robot to select the nearest one. Values are in the frame of the first mount."),
      make("div", { class: "row" }, make("label", {}, "From"), selects[0]), make("div", { class: "row" }, make("label", {}, "To"), selects[1]), result,
    );
    update();
  };

  const update = (): void => {
    selects.forEach((own, which) => { own.value = viewer.measured[which]; });
    const found = viewer.distance();
    if (found === null) {
      result.replaceChildren();
      return;
    }
    const { along, angle } = found;
    const rows: [string, string][] = [
      ["Distance", `${trimmed(1000 * along.length(), 3)} mm`],
      ...(["x", "y", "z"] as const).map((axis): [string, string] => [axis, `${trimmed(1000 * along[axis], 3)} mm`]),
      ["Angle between z axes", `${trimmed((180 / Math.PI) * angle, 2)} deg`],
    ];
    result.replaceChildren(make("table", {}, make("tbody", {}, ...rows.map(([name, value]) => make("tr", {}, make("th", {}, name), make("td", { class: "number" }, value))))));
  };

  viewer.listen((change) => {
    if (change === "robot") build();
    else if (change === "measure" || change === "coordinates" || change === "mode") update();
  });
}
