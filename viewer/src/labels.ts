// The labels over the 3D view, as elements of the page.

import { type Matrix4, Vector3 } from "three";
import { type Name, ROOT_RING } from "./annotate";
import type { Stage } from "./scene";
import { $ } from "./ui/dom";

/** The distance between the robot and the label of its root [px]. */
const GAP = 6;

const between = (low: number, value: number, high: number): number => Math.max(low, Math.min(value, high));

/** Moves labels to their points. All positions are computed before the first is written, so that the page is laid out once. */
export function placeLabels(stage: Stage, names: Name[]): void {
  const labels = $("labels");
  const spots = stage.project(names.map(({ at }) => at));
  while (labels.children.length > names.length) labels.lastChild!.remove();
  while (labels.children.length < names.length) labels.append(document.createElement("span"));
  names.forEach(({ words, chosen }, index) => {
    const label = labels.children[index] as HTMLElement;
    const spot = spots[index];
    if (label.textContent !== words) label.textContent = words;
    label.className = chosen ? "chosen" : "";
    label.hidden = spot === null;
    if (spot !== null) label.style.transform = `translate(${spot.x.toFixed(1)}px, ${spot.y.toFixed(1)}px) translate(-50%, -130%)`;
  });
}

/** Moves the label of the root above or below the robot and its ring, whichever is nearer and free, and draws a line from the ring to it. */
export function placeRootLabel(stage: Stage, root: Matrix4): void {
  const label = $("root"), line = $("root-line");
  const { clientWidth: width, clientHeight: height } = stage.canvas;
  const radius = ROOT_RING * stage.size;
  const rim = [[0, 0], [radius, 0], [-radius, 0], [0, radius], [0, -radius]].map(([x, y]) => new Vector3(x, y, 0).applyMatrix4(root));
  const spots = stage.project(rim).filter((spot) => spot !== null);
  const { x, y } = spots[0] ?? { x: -1, y: -1 };
  label.hidden = line.hidden = spots.length < rim.length || x < 0 || x > width || y < 0 || y > height;
  if (label.hidden) return;
  const [top, bottom] = stage.rows(stage.bounds(), spots.map((spot) => spot.y));
  const left = between(0, x - label.offsetWidth / 2, width - label.offsetWidth);
  const below = bottom + GAP + label.offsetHeight;
  const taken = [$("views"), $("legend")].some((one) =>
    one.offsetParent !== null && left < one.offsetLeft + one.offsetWidth && left + label.offsetWidth > one.offsetLeft && below > one.offsetTop);
  const above = taken || y < (top + bottom) / 2;
  const upper = between(0, above ? top - GAP - label.offsetHeight : bottom + GAP, height - label.offsetHeight);
  const [from, to] = above ? [upper + label.offsetHeight, y] : [y, upper];
  label.style.transform = `translate(${left.toFixed(1)}px, ${upper.toFixed(1)}px)`;
  line.style.transform = `translate(${x.toFixed(1)}px, ${from.toFixed(1)}px)`;
  line.style.height = `${Math.max(0, to - from).toFixed(1)}px`;
}
