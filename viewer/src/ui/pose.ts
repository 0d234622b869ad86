// The panel of poses and joints: a button for each pose of the mode, a slider for each of its coordinates.

import { type Joint, scaleOf, shownCoordinate, trimmed, unitOf } from "../data";
import type { Viewer } from "../viewer";
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
    const unclosed = viewer.mode.unclosed;
    panel.replaceChildren(
      ...(viewer.mode.poses.length > 0 ? [make("h2", {}, "Poses"), poses] : []),
      ...(unclosed.length > 0 ? [make("p", { class: "soft" }, `its loops do not close in: ${unclosed.join(", ")}`)] : []),
      ...(joints.length > 0 ? [make("h2", {}, "Joints"), ...joints] : [make("p", { class: "soft" }, "nothing moves in this mode")]),
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
  const reach = joint.turns ? TURN : 2 * viewer.stage.size;
  const lower = joint.lower ?? -reach, upper = joint.upper ?? reach;
  const step = joint.turns ? 0.1 : 0.01;
  const bounds = { min: trimmed(lower * scale, 3), max: trimmed(upper * scale, 3) };
  const move = (text: string): void => {
    const value = Number(text) / scale;
    if (text !== "" && Number.isFinite(value)) viewer.setCoordinate(joint.path, Math.min(upper, Math.max(lower, value)));
  };
  const range = make("input", {
    type: "range", ...bounds, step, "aria-label": `${joint.path} in ${unitOf(joint)}`,
    oninput: (event) => move((event.target as HTMLInputElement).value),
  });
  const number = make("input", {
    type: "number", ...bounds, step: joint.turns ? 1 : 0.1, "aria-label": `${joint.path}, ${unitOf(joint)}`,
    onchange: (event) => move((event.target as HTMLInputElement).value),
  });
  const { mimic } = joint;
  const follows = viewer.follows(joint.path) ? `follows ${mimic!.joint} x ${trimmed(mimic!.multiplier, 3)}` : "";
  const end = (value: number | null, word: string): string => (value === null ? `no ${word} limit` : shownCoordinate(joint, value));
  const node = make(
    "div", { class: "joint" },
    make("span", { class: "name", title: `${joint.path}: ${joint.kind}${joint.drive === null ? "" : `, ${joint.drive} drive`}` }, joint.path),
    number, make("span", { class: "unit" }, unitOf(joint)), range,
    make("div", { class: "ends" },
      make("span", {}, end(joint.lower, "lower")), make("span", { title: follows }, follows), make("span", {}, end(joint.upper, "upper"))),
  );
  const update = (): void => {
    const value = viewer.q[joint.path] * scale;
    range.value = String(value);
    if (document.activeElement !== number) number.value = trimmed(value, joint.turns ? 1 : 2);
  };
  return { node, update };
}
