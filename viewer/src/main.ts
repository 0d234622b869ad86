// The page: reads what it was given, and wires panels, gestures and keys to the viewer.

import { RINGS } from "./annotate";
import { counted, type Robot, shownMass, VERSION } from "./data";
import { listen, live, wait } from "./live";
import { restored, written } from "./permalink";
import { bytesOf, geometriesOf } from "./scene";
import { bomPanel } from "./ui/bom";
import { card } from "./ui/card";
import { copied } from "./ui/copying";
import { $, choices, fading, make } from "./ui/dom";
import { gestures, KEYS, keys } from "./ui/gestures";
import { measurePanel } from "./ui/measure";
import { editor } from "./ui/place";
import { posePanel } from "./ui/pose";
import { showPanel } from "./ui/show";
import { treePanel } from "./ui/tree";
import { Viewer } from "./viewer";

const PANELS: [string, string, (panel: HTMLElement, viewer: Viewer) => void][] = [
  ["pose", "Move", posePanel], ["tree", "Parts", treePanel], ["bom", "Bill", bomPanel], ["show", "Show", showPanel], ["measure", "Measure", measurePanel],
];

async function start(): Promise<void> {
  editor.link = document.querySelector<HTMLMetaElement>('meta[name="thingc-editor"]')?.content ?? null;
  const own = given("thingc-robot", "thingc-geometry");
  if (own === null) return wait();
  const canvas = $("canvas") as HTMLCanvasElement;
  const viewer = new Viewer(canvas, $("labels"));

  let shown = "pose";
  const tabs = $("tabs");
  const open = (name: string): void => {
    shown = name;
    for (const [panel] of PANELS) $(`panel-${panel}`).hidden = panel !== name;
    for (const tab of tabs.children as HTMLCollectionOf<HTMLElement>) {
      tab.setAttribute("aria-selected", String(tab.id === `tab-${name}`));
      tab.tabIndex = tab.id === `tab-${name}` ? 0 : -1;
    }
  };
  tabs.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (by === undefined) return;
    const names = PANELS.map(([name]) => name);
    open(names[(names.indexOf(shown) + by + names.length) % names.length]);
    $(`tab-${shown}`).focus();
  });
  for (const [name, words, panel] of PANELS) {
    tabs.append(make("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => open(name) }, words));
    $(`panel-${name}`).setAttribute("aria-labelledby", `tab-${name}`);
    panel($(`panel-${name}`), viewer);
  }
  card($("card"), viewer);
  header(viewer);
  gestures(canvas, viewer, () => shown === "measure");
  const help = helped();
  keys(viewer, { find: () => { open("tree"); $("search").focus(); }, help });
  actions(viewer, help);
  views(viewer);
  open("pose");

  viewer.stage.resize();
  viewer.load(own.robot, await geometriesOf(own.glb));
  new ResizeObserver(() => viewer.resize()).observe($("view"));
  const other = given("thingc-against-robot", "thingc-against-geometry");
  if (other !== null) viewer.against({ robot: other.robot, geometries: await geometriesOf(other.glb) });
  restored(viewer, location.hash);
  requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("drawn")));
  window.addEventListener("hashchange", () => restored(viewer, location.hash));
  remember(viewer);
  if (live()) listen(viewer, (sent) => { if (sent !== null) viewer.load(sent.robot, sent.geometries); }, (sent) => viewer.against(sent));
  // for whoever steers the page from outside: tests, notebooks, other pages
  Object.assign(globalThis, { thingc: { viewer, ready: true } });
}

/** A robot and its meshes, as two elements of the page have them; null where it has none. */
function given(data: string, meshes: string): { robot: Robot; glb: ArrayBuffer } | null {
  const text = document.getElementById(data)?.textContent;
  const robot = JSON.parse(text ?? "null") as Robot | null;
  if (robot === null) return null;
  if (robot.version !== VERSION) throw new Error(`this page reads version ${VERSION} of a robot, and was given ${robot.version}`);
  return { robot, glb: bytesOf($(meshes).textContent!.trim()) };
}

function header(viewer: Viewer): void {
  let update = (): void => {};
  const brought = fading($("modes"));
  viewer.listen((change) => {
    if (change === "robot") {
      const { robot } = viewer;
      document.title = $("title").textContent = $("title").title = robot.name;
      const moving = new Set(robot.joints.map((joint) => joint.joint)).size;
      $("subtitle").textContent = `${shownMass(robot.mass)}, ${counted(robot.links.length, "link")}, ${counted(moving, "joint")}`;
      update = choices($("modes"), robot.modes.map((mode) => mode.name), () => viewer.mode.name, (name) => viewer.setMode(name));
    }
    if (change === "mode") {
      update();
      brought();
      const { name, root, base, file, line } = viewer.mode;
      $("modes").title = `mode ${name}: root ${root.path}, base ${base}${file === null ? "" : `\n${file}:${line}`}`;
    }
    if (change === "options") {
      document.documentElement.dataset.theme = viewer.options.theme;
      $("panels").hidden = !viewer.options.panels;
    }
    if (change === "said") {
      $("said").hidden = viewer.said === "";
      $("said").textContent = viewer.said;
    }
  });
  document.documentElement.dataset.theme = viewer.options.theme;
}

/** Whence the robot is looked at. */
const VIEWS: [string, [number, number, number]?][] = [["Iso"], ["Front", [1, 0, 0]], ["Side", [0, -1, 0]], ["Top", [0, -1e-4, 1]]];

function actions(viewer: Viewer, help: () => void): void {
  const button = (words: string, title: string, act: () => void): HTMLButtonElement => make("button", { type: "button", title, "aria-label": title, onclick: act }, words);
  $("actions").append(
    button("Fit", "the whole robot in the picture (r)", () => viewer.reset()),
    ...(location.protocol === "about:" ? [] : [button("Link", "copy a link to exactly this view", () => { // a frame in a notebook has no address
      noted(viewer);
      void copied(viewer, location.href.replace(/#.*/, "") + written(viewer), "the link is copied");
    })]),
    button("Picture", "save this picture as PNG", () => saved(viewer)),
    button("◐", "dark or light", () => viewer.setOptions({ theme: viewer.options.theme === "dark" ? "light" : "dark" })),
    button("☰", "panels beside the picture, or none", () => viewer.setOptions({ panels: !viewer.options.panels })),
    button("?", "keys and gestures (?)", help),
  );
}

function views(viewer: Viewer): void {
  $("views").append(...VIEWS.map(([words, from]) => make("button", { type: "button", title: `look from here: ${words}`, onclick: () => viewer.reset(from) }, words)));
}

/** Hands the picture to the person, without its background. */
function saved(viewer: Viewer): void {
  viewer.stage.draw();
  viewer.stage.canvas.toBlob((blob) => {
    if (blob === null) return;
    const url = URL.createObjectURL(blob);
    make("a", { href: url, download: `${viewer.robot.name}_${viewer.mode.name}.png` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  });
}

function helped(): () => void {
  const dialog = $("help") as HTMLDialogElement;
  const table = make("table", {}, make("tbody", {}, ...KEYS.map(([key, words]) => make("tr", {}, make("td", {}, make("kbd", {}, key)), make("td", {}, words)))));
  dialog.append(
    make("button", { class: "close", type: "button", "aria-label": "close this help", onclick: () => dialog.close() }, "×"),
    make("h2", {}, "Gestures"),
    make("p", {}, "Drag to turn, drag with the right button to shift, scroll to zoom. Click a part to see what it is. Drag a link with Shift, or after a long press, to pose the robot."),
    make("h2", {}, "Marks"), make("ul", { class: "rings" }, ...RINGS.map(([color, shape, words]) => {
      const sample = make("i", { class: shape });
      sample.style.color = color;
      return make("li", {}, sample, words);
    })), make("h2", {}, "Keys"), table,
  );
  return () => dialog.showModal();
}

/** What is shown, in the address. */
function noted(viewer: Viewer): void {
  try {
    history.replaceState(null, "", written(viewer));
  } catch {
    // a browser may forbid it in a page within another
  }
}

/** The address follows what is shown, when it has been still for a while. */
function remember(viewer: Viewer): void {
  let waiting = 0;
  const note = (): void => {
    clearTimeout(waiting);
    waiting = window.setTimeout(() => noted(viewer), 300);
  };
  viewer.listen((change) => { if (change !== "said" && change !== "hover") note(); });
  viewer.stage.controls.addEventListener("end", note);
}

start().catch((fault: unknown) => {
  const words = fault instanceof Error ? fault.message : String(fault);
  $("said").hidden = false;
  $("said").textContent = /webgl/i.test(words) ? "This browser cannot draw in three dimensions (WebGL is off)." : words;
  throw fault;
});
