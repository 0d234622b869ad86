// The entry point of the page: reads the embedded robot and connects panels, gestures and keys to the viewer.

import { RINGS } from "./annotate";
import { counted, referenceOf, type Robot, shownMass, VERSION } from "./data";
import { listen, live, wait } from "./live";
import { restored, written } from "./permalink";
import { bytesOf, geometriesOf } from "./scene";
import { bomPanel } from "./ui/bom";
import { card } from "./ui/card";
import { copy, download } from "./ui/copying";
import { $, choices, fading, make } from "./ui/dom";
import { gestures, KEYS, keys } from "./ui/gestures";
import { measurePanel } from "./ui/measure";
import { editor } from "./ui/place";
import { posePanel } from "./ui/pose";
import { showPanel } from "./ui/show";
import { treePanel } from "./ui/tree";
import { visibilityBar } from "./ui/visibility";
import { Viewer } from "./viewer";

const PANELS: [string, string, (panel: HTMLElement, viewer: Viewer) => void][] = [
  ["pose", "Joints", posePanel], ["tree", "Parts", treePanel], ["bom", "BOM", bomPanel], ["show", "Display", showPanel], ["measure", "Measure", measurePanel],
];

async function start(): Promise<void> {
  editor.link = document.querySelector<HTMLMetaElement>('meta[name="thingc-editor"]')?.content ?? null;
  const own = given("thingc-robot", "thingc-geometry");
  if (own === null) return wait();
  const canvas = $("canvas") as HTMLCanvasElement;
  const viewer = new Viewer(canvas);

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
  visibilityBar($("visibility"), viewer);
  header(viewer);
  gestures(canvas, viewer, () => shown === "measure");
  const help = helpDialog();
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
  trackAddress(viewer);
  if (live()) listen(viewer, (sent) => { if (sent !== null) viewer.load(sent.robot, sent.geometries); }, (sent) => viewer.against(sent));
  // the public API for tests, notebooks and other pages
  Object.assign(globalThis, { thingc: { viewer, ready: true } });
}

/** A robot and its meshes from two elements of the page; null if the page has no robot. */
function given(data: string, meshes: string): { robot: Robot; glb: ArrayBuffer } | null {
  const text = document.getElementById(data)?.textContent;
  const robot = JSON.parse(text ?? "null") as Robot | null;
  if (robot === null) return null;
  if (robot.version !== VERSION) throw new Error(`Unsupported robot data: this page reads version ${VERSION}, found version ${robot.version}`);
  return { robot, glb: bytesOf($(meshes).textContent!.trim()) };
}

function header(viewer: Viewer): void {
  let update = (): void => {};
  const scrollToMode = fading($("modes"));
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
      scrollToMode();
      const { name, root, base, file, line } = viewer.mode;
      $("modes").title = `mode ${name}: root ${root.path}, base ${base}${file === null ? "" : `\n${file}:${line}`}`;
      $("root").textContent = `root: ${referenceOf(root)}`;
      $("gravity").hidden = !viewer.stage.gravity.visible;
    }
    if (change === "options") {
      document.documentElement.dataset.theme = viewer.options.theme;
      $("panels").hidden = !viewer.options.panels;
    }
    if (change === "message") showMessage(viewer.message);
  });
  document.documentElement.dataset.theme = viewer.options.theme;
}

function showMessage(text: string): void {
  $("message").hidden = text === "";
  $("message").textContent = text;
}

/** Standard views: label, title, and direction from the robot to the camera. */
const VIEWS: [string, string, [number, number, number]?][] = [
  ["Iso", "Isometric view"], ["Front", "Front view", [1, 0, 0]], ["Side", "Side view", [0, -1, 0]], ["Top", "Top view", [0, -1e-4, 1]],
];

function actions(viewer: Viewer, help: () => void): void {
  const button = (words: string, title: string, act: () => void): HTMLButtonElement => make("button", { type: "button", title, "aria-label": title, onclick: act }, words);
  $("actions").append(
    button("Fit", "Fit the view to the robot (r)", () => viewer.reset()),
    ...(location.protocol === "about:" ? [] : [button("Link", "Copy a link to this view", () => { // a frame in a notebook has no address
      updateAddress(viewer);
      void copy(viewer, location.href.replace(/#.*/, "") + written(viewer), "Link copied");
    })]),
    button("Image", "Save the view as a PNG image", () => saveImage(viewer)),
    button("◐", "Switch between light and dark theme", () => viewer.setOptions({ theme: viewer.options.theme === "dark" ? "light" : "dark" })),
    button("☰", "Show or hide the panels", () => viewer.setOptions({ panels: !viewer.options.panels })),
    button("?", "Mouse and keyboard shortcuts (?)", help),
  );
}

function views(viewer: Viewer): void {
  $("views").append(...VIEWS.map(([label, title, from]) => make("button", { type: "button", title, onclick: () => viewer.reset(from) }, label)));
}

/** Saves the 3D view as a PNG image with a transparent background. */
function saveImage(viewer: Viewer): void {
  viewer.stage.draw();
  viewer.stage.canvas.toBlob((blob) => {
    if (blob !== null) download(`${viewer.robot.name}_${viewer.mode.name}.png`, blob);
  });
}

/** Fills the help dialog; the returned function opens it. */
function helpDialog(): () => void {
  const dialog = $("help") as HTMLDialogElement;
  const table = make("table", {}, make("tbody", {}, ...KEYS.map(([key, words]) => make("tr", {}, make("td", {}, make("kbd", {}, key)), make("td", {}, words)))));
  dialog.append(
    make("button", { class: "close", type: "button", "aria-label": "Close", onclick: () => dialog.close() }, "×"),
    make("h2", {}, "Mouse and touch"),
    make("p", {}, "Drag to rotate, drag with the right button to pan, scroll to zoom. Click a part to select it; use Ctrl+click to select several. To pose the robot, drag a link with Shift, or touch and hold it, then drag."),
    make("h2", {}, "Symbols"), make("ul", { class: "rings" }, ...RINGS.map(([color, shape, words]) => {
      const sample = make("i", { class: shape });
      sample.style.color = color;
      return make("li", {}, sample, words);
    })), make("h2", {}, "Keyboard"), table,
  );
  return () => dialog.showModal();
}

/** Writes the state of the view to the address. */
function updateAddress(viewer: Viewer): void {
  try {
    history.replaceState(null, "", written(viewer));
  } catch {
    // some browsers do not permit this in a frame
  }
}

/** Updates the address 300 ms after the last change. */
function trackAddress(viewer: Viewer): void {
  let timer = 0;
  const schedule = (): void => {
    clearTimeout(timer);
    timer = window.setTimeout(() => updateAddress(viewer), 300);
  };
  viewer.listen((change) => { if (change !== "message" && change !== "hover") schedule(); });
  viewer.stage.controls.addEventListener("end", schedule);
}

start().catch((error: unknown) => {
  const text = error instanceof Error ? error.message : String(error);
  showMessage(/webgl/i.test(text) ? "This page requires WebGL, which this browser does not support or has disabled." : text);
  throw error;
});
