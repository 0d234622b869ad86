// The bar that shows how many parts are hidden or transparent.

import type { Viewer } from "../viewer";
import { make } from "./dom";

export function visibilityBar(own: HTMLElement, viewer: Viewer): void {
  const text = make("span");
  own.append(text, make("button", { type: "button", title: "Show all parts (a)", onclick: () => viewer.showAll() }, "Show all"));
  viewer.listen((change) => {
    if (change !== "visibility" && change !== "robot") return;
    const counts: [number, string][] = [[viewer.hidden.size, "hidden"], [viewer.transparent.size, "transparent"]];
    text.textContent = counts.filter(([count]) => count > 0).map(([count, word]) => `${count} ${word}`).join(", ");
    own.hidden = text.textContent === "";
  });
}
