// The assembly graph as a tree of components; what is chosen there is chosen in the picture, and the other way round.

import { counted, shownMass } from "../data";
import { toggled, type Viewer } from "../viewer";
import { make } from "./dom";

interface Branch { name: string; leaves: number[]; below: Map<string, Branch> }

export function treePanel(panel: HTMLElement, viewer: Viewer): void {
  let buttons: { button: HTMLButtonElement; leaves: number[] }[] = [];

  const entry = (words: string, aside: string, leaves: number[], searched: string): HTMLButtonElement => {
    const button = make("button", {
      type: "button", title: searched,
      onclick: (event) => {
        event.preventDefault();
        const more = (event as MouseEvent).ctrlKey || (event as MouseEvent).metaKey;
        viewer.choose(more ? toggled(viewer.choice, leaves) : leaves);
      },
    }, words, make("small", {}, aside));
    buttons.push({ button, leaves });
    return button;
  };

  const grown = (branch: Branch): HTMLElement => {
    const list = make("ul");
    for (const child of branch.below.values()) {
      if (child.below.size === 0 && child.leaves.length === 1) {
        const one = viewer.robot.occurrences[child.leaves[0]];
        const definition = viewer.robot.definitions[one.definition];
        list.append(make("li", {}, entry(child.name, definition.label, child.leaves, `${one.path} ${definition.label}`)));
        continue;
      }
      const mass = child.leaves.reduce((sum, index) => sum + viewer.robot.occurrences[index].mass, 0);
      const below = grown(child);
      const fold = make("button", { class: "fold", type: "button", "aria-expanded": "true", "aria-label": `what is in ${child.name}` }, "▾");
      fold.addEventListener("click", () => {
        below.hidden = !below.hidden;
        fold.setAttribute("aria-expanded", String(!below.hidden));
        fold.textContent = below.hidden ? "▸" : "▾";
      });
      list.append(make("li", {}, fold, entry(child.name, `${counted(child.leaves.length, "part")}, ${shownMass(mass)}`, child.leaves, child.name), below));
    }
    return list;
  };

  const build = (): void => {
    buttons = [];
    const top: Branch = { name: "", leaves: [], below: new Map() };
    viewer.robot.occurrences.forEach((one, index) => {
      let here = top;
      for (const word of one.path.split("/")) {
        const next: Branch = here.below.get(word) ?? { name: word, leaves: [], below: new Map() };
        here.below.set(word, next);
        next.leaves.push(index);
        here = next;
      }
    });
    const tree = grown(top);
    tree.className = "tree";
    const search = make("input", { type: "search", placeholder: "find a component or part", "aria-label": "find a component or part", id: "search" });
    search.addEventListener("input", () => {
      const wanted = search.value.toLowerCase();
      for (const { button } of buttons) button.closest("li")!.hidden = wanted !== "";
      for (const { button } of buttons) {
        if (wanted === "" || !button.title.toLowerCase().includes(wanted)) continue;
        for (let item = button.closest("li"); item !== null; item = item.parentElement!.closest("li")) item.hidden = false;
        for (const inner of button.closest("li")!.querySelectorAll("li")) inner.hidden = false;
      }
    });
    const none = make("p", { class: "soft", hidden: true }, "nothing is called so");
    search.addEventListener("input", () => { none.hidden = buttons.some(({ button }) => !button.closest("li")!.hidden); });
    panel.replaceChildren(search, none, tree, definitions(viewer, entry));
    update();
  };

  const update = (): void => {
    for (const { button, leaves } of buttons) {
      const chosen = viewer.choice.size === leaves.length && leaves.every((index) => viewer.choice.has(index));
      button.setAttribute("aria-pressed", String(chosen));
    }
    const first = buttons.find(({ button }) => button.getAttribute("aria-pressed") === "true");
    if (first !== undefined && !panel.hidden) first.button.scrollIntoView({ block: "nearest" });
  };

  viewer.listen((change) => {
    if (change === "robot") build();
    else if (change === "choice") update();
  });
}

/** The other end of the graph: every definition, and all that is made from it. */
function definitions(viewer: Viewer, entry: (words: string, aside: string, leaves: number[], searched: string) => HTMLElement): HTMLElement {
  const list = make("ul", { class: "tree" });
  viewer.robot.definitions.forEach((definition, number) => {
    const leaves = viewer.robot.occurrences.flatMap((one, index) => (one.definition === number ? [index] : []));
    list.append(make("li", {}, entry(definition.label, `x ${leaves.length}`, leaves, definition.text)));
  });
  return make("div", {}, make("h2", {}, "Definitions"), list);
}
