// The kinematic tree of the mode: links and joints, beginning with the root.

import { counted, shownCoordinate, shownMass } from "../data";
import type { Viewer } from "../viewer";
import { make } from "./dom";
import type { Entry } from "./tree";

/** The tree of links and joints, then loops and holds; `update` shows the current coordinates. */
export function linkTree(viewer: Viewer, entry: Entry): { node: HTMLElement; update: () => void } {
  const { robot, mode } = viewer;
  const coordinates = new Map(robot.joints.map((joint) => [joint.path, joint]));
  const children = mode.bodies.map((_, body) => mode.bodies.flatMap(({ parent }, child) => (parent === body ? [child] : [])));
  const updates: (() => void)[] = [];

  const partsOf = (bodies: number[]): number[] => robot.occurrences.flatMap(({ link }, index) => (bodies.includes(viewer.bodyOf(link)) ? [index] : []));
  const behind = (body: number): number[] => [body, ...children[body].flatMap(behind)];

  /** The row of a joint with its kind and coordinates; it selects `parts`, and highlights the axis under the pointer or with the focus. */
  const jointRow = (paths: string[], parts: number[]): HTMLElement => {
    const { joint, kind } = coordinates.get(paths[0])!;
    const row = entry(joint, "", parts, `${joint} ${kind}`);
    row.className = "joint-row";
    for (const [event, path] of [["pointerenter", paths[0]], ["focus", paths[0]], ["pointerleave", null], ["blur", null]] as const) {
      row.addEventListener(event, () => viewer.hover(path));
    }
    updates.push(() => {
      const values = paths.map((path) => shownCoordinate(coordinates.get(path)!, viewer.q[path]));
      row.querySelector("small")!.textContent = [kind, ...values].join(", ");
    });
    return row;
  };

  /** One row for each joint: the coordinates of a ball or a universal joint are in one row. */
  const jointRows = (moving: { path: string }[], parts: number[]): HTMLElement[] => {
    const joints = new Map<string, string[]>();
    for (const { path } of moving) joints.set(coordinates.get(path)!.joint, [...(joints.get(coordinates.get(path)!.joint) ?? []), path]);
    return [...joints.values()].map((paths) => make("div", {}, jointRow(paths, parts)));
  };

  const branch = (body: number): HTMLElement => {
    const { link, joints } = mode.bodies[body];
    const { name, mass } = robot.links[link], parts = partsOf([body]);
    const row = entry(name, `${counted(parts.length, "part")}, ${shownMass(mass)}`, parts, name);
    return make("li", {}, ...jointRows(joints, partsOf(behind(body))), row, make("ul", {}, ...children[body].map(branch)));
  };

  const loops = mode.loops.map(({ path, hold, parent, child, joints }) => {
    const parts = partsOf(parent === null ? [child] : [parent, child]);
    if (!hold && joints.length > 0) return make("li", {}, ...jointRows(joints, parts));
    return make("li", {}, entry(path, hold ? "hold" : "loop", parts, path));
  });
  const node = make("div", {}, make("ul", { class: "tree" }, branch(0)), ...(loops.length > 0 ? [make("h2", {}, "Loops and holds"), make("ul", { class: "tree" }, ...loops)] : []));
  const update = (): void => { for (const one of updates) one(); };
  update();
  return { node, update };
}
