// The parts panel: the assembly graph as a tree of components, or the kinematic tree. The selection is the same as in the 3D view.

import { counted, shownMass } from "../data";
import { toggled, type Viewer } from "../viewer";
import { choices, make } from "./dom";
import { linkTree } from "./links";

interface Branch { name: string; leaves: number[]; below: Map<string, Branch> }

/** A button that selects the occurrences `leaves`. */
interface Row { button: HTMLButtonElement; leaves: number[] }

/** Makes a button that selects `leaves`; `searched` is its tooltip, and the text that the search compares. */
export type Entry = (label: string, aside: string, leaves: number[], searched: string) => HTMLButtonElement;

const VIEWS = ["Components", "Links and joints"] as const;

export function treePanel(panel: HTMLElement, viewer: Viewer): void {
  let view: string = VIEWS[0];
  let componentRows: Row[] = [], linkRows: Row[] = [];
  let updateLinks = (): void => {};
  const components = make("div"), links = make("div", { hidden: true });
  const views = make("div", { class: "chips row", role: "radiogroup", "aria-label": "Tree" });
  const updateViews = choices(views, VIEWS, () => view, (chosen) => {
    view = chosen;
    show();
  });
  const search = make("input", { type: "search", placeholder: "Search", "aria-label": "Search", id: "search", oninput: () => filter() });
  const none = make("p", { class: "soft", hidden: true }, "No results");
  panel.replaceChildren(views, search, none, components, links);

  const entryFor = (rows: Row[]): Entry => (label, aside, leaves, searched) => {
    const button = make("button", {
      type: "button", title: searched,
      onclick: (event) => {
        event.preventDefault();
        const more = (event as MouseEvent).ctrlKey || (event as MouseEvent).metaKey;
        viewer.choose(more ? toggled(viewer.choice, leaves) : leaves);
      },
    }, label, make("small", {}, aside));
    rows.push({ button, leaves });
    return button;
  };

  const buildComponents = (): void => {
    componentRows = [];
    const entry = entryFor(componentRows);
    components.replaceChildren(componentTree(viewer, entry), definitions(viewer, entry));
  };

  const buildLinks = (): void => {
    linkRows = [];
    const { node, update } = linkTree(viewer, entryFor(linkRows));
    links.replaceChildren(node);
    updateLinks = update;
  };

  const show = (): void => {
    updateViews();
    components.hidden = view !== VIEWS[0];
    links.hidden = !components.hidden;
    filter();
  };

  /** Shows only rows that match the search, with what is above and below them. */
  const filter = (): void => {
    const wanted = search.value.toLowerCase(), rows = components.hidden ? linkRows : componentRows;
    for (const { button } of rows) button.closest("li")!.hidden = wanted !== "";
    for (const { button } of rows) {
      if (wanted === "" || !button.title.toLowerCase().includes(wanted)) continue;
      for (let item = button.closest("li"); item !== null; item = item.parentElement!.closest("li")) item.hidden = false;
      for (const inner of button.closest("li")!.querySelectorAll("li")) inner.hidden = false;
    }
    none.hidden = rows.some(({ button }) => !button.closest("li")!.hidden);
  };

  const update = (): void => {
    for (const { button, leaves } of [...componentRows, ...linkRows]) {
      const chosen = leaves.length > 0 && viewer.choice.size === leaves.length && leaves.every((index) => viewer.choice.has(index));
      button.setAttribute("aria-pressed", String(chosen));
      button.classList.toggle("hidden", leaves.length > 0 && leaves.every((index) => viewer.hidden.has(index)));
    }
    const rows = components.hidden ? linkRows : componentRows;
    const first = rows.find(({ button }) => button.getAttribute("aria-pressed") === "true");
    if (first !== undefined && !panel.hidden) first.button.scrollIntoView({ block: "nearest" });
  };

  viewer.listen((change) => {
    if (change === "robot") buildComponents();
    if (change === "robot" || change === "mode") buildLinks();
    if (change === "robot" || change === "mode") show();
    if (change === "robot" || change === "mode" || change === "choice" || change === "visibility") update();
    if (change === "coordinates") updateLinks();
  });
}

function componentTree(viewer: Viewer, entry: Entry): HTMLElement {
  const { occurrences, definitions } = viewer.robot;
  const grown = (branch: Branch): HTMLElement => {
    const list = make("ul");
    for (const child of branch.below.values()) {
      if (child.below.size === 0 && child.leaves.length === 1) {
        const one = occurrences[child.leaves[0]];
        const definition = definitions[one.definition];
        list.append(make("li", {}, entry(child.name, definition.label, child.leaves, `${one.path} ${definition.label}`)));
        continue;
      }
      const mass = child.leaves.reduce((sum, index) => sum + occurrences[index].mass, 0);
      const below = grown(child);
      const fold = make("button", { class: "fold", type: "button", "aria-expanded": "true", "aria-label": `Expand or collapse ${child.name}` }, "▾");
      fold.addEventListener("click", () => {
        below.hidden = !below.hidden;
        fold.setAttribute("aria-expanded", String(!below.hidden));
        fold.textContent = below.hidden ? "▸" : "▾";
      });
      list.append(make("li", {}, fold, entry(child.name, `${counted(child.leaves.length, "part")}, ${shownMass(mass)}`, child.leaves, child.name), below));
    }
    return list;
  };
  const top: Branch = { name: "", leaves: [], below: new Map() };
  occurrences.forEach((one, index) => {
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
  return tree;
}

/** Every definition with its occurrences. */
function definitions(viewer: Viewer, entry: Entry): HTMLElement {
  const list = make("ul", { class: "tree" });
  viewer.robot.definitions.forEach((definition, number) => {
    const leaves = viewer.robot.occurrences.flatMap((one, index) => (one.definition === number ? [index] : []));
    list.append(make("li", {}, entry(definition.label, `x ${leaves.length}`, leaves, definition.text)));
  });
  return make("div", {}, make("h2", {}, "Definitions"), list);
}
