// The panel of poses and joints: a button for each pose of the mode, a slider for each of its coordinates.

import { type Joint, scaleOf, shownCoordinate, trimmed, unitOf } from "../data";
import type { Viewer } from "../viewer";
import { copied } from "./copying";
import { choices, make } from "./dom";

/** How far a slider goes where a joint has no limit: [rad], and [m] as a part of the robot's size. */
const TURN = Math.PI;

export function posePanel(panel: HTMLElement, viewer: Viewer): void {
  let updates: (() => void)[] = [];

  const build = (): void => {
    const poses = make("div", { class: "chips poses", role: "radiogroup", "aria-label": "pose" });
    updates = [
      choices(poses, viewer.mode.poses.map((pose) => pose.name), () => viewer.pose?.name ?? null, (name) => viewer.setPose(name)),
    ];
    const joints = viewer.joints.map((joint) => {
      const { node, update } = slider(joint, viewer);
      updates.push(update);
      return node;
    });
    const copy = make("button", {
      type: "button", title: "these coordinates, as the `poses` of a document have them",
      onclick: () => copied(viewer, yaml(viewer), "the pose is copied"),
    }, "Copy as a pose");
    const unclosed = viewer.mode.unclosed;
    panel.replaceChildren(
      ...(viewer.mode.poses.length > 0 ? [make("h2", {}, "Poses"), poses] : []),
      ...(unclosed.length > 0 ? [make("p", { class: "soft" }, `its loops do not close in: ${unclosed.join(", ")}`)] : []),
      ...(joints.length > 0 ? [make("h2", {}, "Joints"), ...joints, copy] : [make("p", { class: "soft" }, "nothing moves in this mode")]),
    );
    for (const update of updates) update();
  };

  viewer.listen((change) => {
    if (change === "mode" || change === "robot") build();
    else if (change === "coordinates") for (const update of updates) update();
  });
}

function slider(joint: Joint, viewer: Viewer): { node: HTMLElement; update: () => void } {
  const scale = scaleOf(joint);
  const [lower, upper] = viewer.range(joint.path);
  const reach = joint.turns ? TURN : 2 * viewer.stage.size;
  const ends = [Number.isFinite(lower) ? lower : Math.min(-reach, upper - reach), Number.isFinite(upper) ? upper : Math.max(reach, lower + reach)];
  const move = (text: string): void => {
    const value = Number(text) / scale;
    if (text !== "" && Number.isFinite(value)) viewer.setCoordinate(joint.path, Math.min(upper, Math.max(lower, value)));
  };
  const [min, max] = ends.map((end) => trimmed(end * scale, 3));
  const range = make("input", {
    type: "range", min, max, step: joint.turns ? 0.1 : 0.01, "aria-label": `${joint.path} slider, ${unitOf(joint)}`,
    oninput: (event) => move((event.target as HTMLInputElement).value),
  });
  const number = make("input", {
    type: "number", step: joint.turns ? 1 : 0.1, "aria-label": `${joint.path} value, ${unitOf(joint)}`,
    onchange: (event) => { move((event.target as HTMLInputElement).value); show(); },
  });
  const follows = viewer.follows(joint.path) ? `follows ${joint.mimic!.joint} x ${trimmed(joint.mimic!.multiplier, 3)}` : "";
  const end = (value: number, word: string): string => (Number.isFinite(value) ? shownCoordinate(joint, value) : `no ${word} limit`);
  const cone = joint.cone === null ? "" : `cone ${shownCoordinate(joint, joint.cone)}`;
  const node = make(
    "div", {
      class: "joint", title: about(joint), onpointerenter: () => viewer.hover(joint.path), onpointerleave: () => viewer.hover(null),
      ondblclick: (event) => { if (event.target === range) viewer.setCoordinate(joint.path, Math.min(upper, Math.max(lower, 0))); },
    },
    make("span", { class: "name" }, joint.path), number, make("span", { class: "unit" }, unitOf(joint)), range,
    make("div", { class: "ends" }, make("span", {}, end(lower, "lower")), make("span", { title: follows }, follows || cone), make("span", {}, end(upper, "upper"))),
  );
  const show = (): void => { number.value = trimmed(viewer.q[joint.path] * scale, joint.turns ? 1 : 2); };
  const update = (): void => {
    const value = viewer.q[joint.path] * scale;
    range.min = String(Math.min(Number(min), value)); // a pose may be further round than a slider without limits
    range.max = String(Math.max(Number(max), value));
    range.value = String(value);
    if (document.activeElement !== number) show();
  };
  return { node, update };
}

/** What else is known of a coordinate. */
function about(joint: Joint): string {
  const unit = joint.turns ? "N m" : "N", speed = joint.turns ? "rad/s" : "m/s";
  return [
    `${joint.path}: ${joint.kind}${joint.drive === null ? "" : `, ${joint.drive} drive`}`, ...(joint.effort === null ? [] : [`effort ${trimmed(joint.effort, 3)} ${unit}`]),
    ...(joint.velocity === null ? [] : [`velocity ${trimmed(joint.velocity, 3)} ${speed}`]), ...(joint.file === null ? [] : [`${joint.file}:${joint.line}`]),
  ].join("\n");
}

/** The coordinates as a document has those of a pose. */
function yaml(viewer: Viewer): string {
  const values = viewer.joints.filter((joint) => !viewer.follows(joint.path)).map((joint) => {
    const number = joint.path === joint.joint ? null : /_(\d+)$/.exec(joint.path)!;
    const key = joint.joint.replaceAll("/", ".");
    const plain = number === null ? key : `"${key}[${number[1]}]"`;
    return `${plain}: ${Number((viewer.q[joint.path] * scaleOf(joint)).toFixed(3))} ${unitOf(joint)}`;
  });
  return `{${values.join(", ")}}`;
}
