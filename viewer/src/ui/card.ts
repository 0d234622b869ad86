// The card with the properties of the selection.

import { shownMass, trimmed } from "../data";
import type { Viewer } from "../viewer";
import { make, pairs } from "./dom";
import { place } from "./place";

const ACTIONS = [
  ["Hide", "Hide the selected parts (h)", "hide"], ["Isolate", "Hide all other parts (s)", "isolate"],
  ["Transparent", "Make the selected parts transparent or opaque (t)", "toggleTransparent"],
] as const;

export function card(own: HTMLElement, viewer: Viewer): void {
  const build = (): void => {
    const chosen = [...viewer.choice];
    own.hidden = chosen.length === 0;
    if (chosen.length === 0) return;
    const { occurrences, definitions, links } = viewer.robot;
    const close = make("button", { class: "close", type: "button", "aria-label": "Clear the selection (Esc)", onclick: () => viewer.choose([]) }, "×");
    const first = occurrences[chosen[0]], definition = definitions[first.definition];
    const mass = chosen.reduce((sum, index) => sum + occurrences[index].mass, 0);
    const actions = make("div", { class: "chips" }, ...ACTIONS.map(([label, title, act]) => make("button", { type: "button", title, onclick: () => viewer[act]() }, label)));
    if (chosen.length > 1) {
      const same = chosen.every((index) => occurrences[index].definition === first.definition);
      own.replaceChildren(close, make("h2", {}, `${chosen.length} components`), pairs([
        ["definition", same ? definition.label : null], ["total mass", shownMass(mass)],
        ["part file", same ? place(definition) : null], ["components", chosen.slice(0, 12).map((index) => occurrences[index].path).join(", ") + (chosen.length > 12 ? ", ..." : "")],
      ]), actions);
      return;
    }
    const source = first.estimate === null ? first.source : `${first.source} (${first.estimate})`;
    const joint = viewer.mode.bodies[viewer.bodyOf(first.link)].joints.map((one) => one.path).join(", ");
    own.replaceChildren(close, make("h2", {}, first.path), pairs([
      ["definition", definition.label], ["mirrors", definition.mirrors],
      ...definition.parameters.map(([name, value]): [string, string] => [name, value]),
      ["material", first.material], ["mass", first.mass === 0 ? "none" : `${shownMass(first.mass)}, ${source}`],
      ["centre of mass", first.mass === 0 ? null : `${first.centre.map((x) => trimmed(1000 * x, 1)).join(", ")} mm`],
      ["link", links[first.link].name], ["joint", joint], ["collision", first.collides], ["make", first.make],
      ["mounts", first.mounts.map((mount) => (mount.interface === null ? mount.name : `${mount.name} (${mount.interface})`)).join(", ")],
      ["document", place(first)], ["part file", place(definition)],
    ]), actions);
  };
  viewer.listen((change) => {
    if (change === "choice" || change === "robot" || change === "mode") build();
  });
}
