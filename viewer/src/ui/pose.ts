// The joints panel: a button for each pose of the mode, and a slider for each of its coordinates.

import type { BaseCoordinate } from "../base";
import { type Joint, scaleOf, shownCoordinate, trimmed, unitOf } from "../data";
import type { Viewer } from "../viewer";
import { copy } from "./copying";
import { choices, make } from "./dom";
import { motionPlayer } from "./motion";

/** The range of a slider of a joint without limits [rad]; for slides, twice the size of the robot. */
const TURN = Math.PI;

export function posePanel(panel: HTMLElement, viewer: Viewer): void {
  let updates: (() => void)[] = [];

  const build = (): void => {
    const poses = make("div", { class: "chips poses", role: "radiogroup", "aria-label": "pose" });
    updates = [
      choices(poses, viewer.mode.poses.map((pose) => pose.name), () => viewer.pose?.name ?? null, (name) => viewer.setPose(name)),
    ];
    const motion = motionPlayer(viewer);
    updates.push(motion.update);
    const sliders = (title: string, all: Sliding[]): HTMLElement[] => {
      const made = all.map((one) => slider(one, viewer));
      updates.push(...made.map(({ update }) => update));
      return made.length > 0 ? [make("h2", {}, title), ...made.map(({ node }) => node)] : [];
    };
    const { base, driven, unclosed } = viewer.mode;
    const [drives, others] = [true, false].map((own) => viewer.joints.filter((joint) => driven.includes(joint.path) === own).map((joint) => ofJoint(joint, viewer)));
    const joints = [
      ...sliders("Driven joints", drives), ...sliders(drives.length > 0 ? "Other joints" : "Joints", others),
    ];
    const root = sliders(`Base (${base})`, viewer.configuration.moves.coordinates.map((one) => ofBase(one, viewer)));
    const copyPose = make("button", {
      type: "button", title: "Copy the coordinates in the format of `poses` in a document",
      onclick: () => copy(viewer, yaml(viewer), "Pose copied"),
    }, "Copy as pose");
    panel.replaceChildren(
      ...(viewer.mode.poses.length > 0 ? [make("h2", {}, "Poses"), poses] : []),
      ...(unclosed.length > 0 ? [make("p", { class: "soft" }, `Poses that do not close the loops: ${unclosed.join(", ")}`)] : []),
      ...(joints.length > 0 ? [make("p", { class: "soft" }, "To pose the robot, drag a link with Shift, or touch and hold it, then drag.")] : []),
      ...joints, ...root, ...(joints.length > 0 ? [copyPose, ...motion.nodes] : []),
      ...(joints.length + root.length > 0 ? [] : [make("p", { class: "soft" }, "This mode has no moving joints.")]),
    );
    for (const update of updates) update();
  };

  viewer.listen((change) => {
    if (change === "mode" || change === "robot") build();
    else if (change === "coordinates") for (const update of updates) update();
  });
}

/** The coordinate of a slider, of a joint or of the base. `words` is shown below its middle, `about` is its tooltip. */
interface Sliding {
  path: string; turns: boolean; range: [number, number]; words: string; about: string;
  value: () => number;
  set: (value: number) => void;
}

function ofJoint(joint: Joint, viewer: Viewer): Sliding {
  const { path, turns, cone, mimic } = joint;
  const axis = path === joint.joint ? "" : `${turns ? "about" : "along"} ${joint.axis}`; // always z for a joint with one coordinate
  const follows = viewer.follows(path) ? `follows ${mimic!.joint}${mimic!.higher.length > 0 ? "" : ` x ${Number(mimic!.multiplier.toFixed(3))}`}` : "";
  return {
    path, turns, range: viewer.range(path), words: follows || [axis, cone === null ? "" : `cone ${shownCoordinate(joint, cone)}`].filter(Boolean).join(", "),
    about: about(joint), value: () => viewer.q[path], set: (value) => viewer.setCoordinate(path, value),
  };
}

function ofBase({ path, turns, at }: BaseCoordinate, viewer: Viewer): Sliding {
  const { base, root } = viewer.mode, { moves } = viewer.configuration;
  const joint = base === "planar" ? `\njoint root_${moves.coordinates.findIndex((one) => one.at === at)} in exported models` : "";
  return {
    path, turns, range: [-Infinity, Infinity], words: "", about: `${path}: displacement of ${root.path} from its initial pose in the mode (base ${base})${joint}`,
    value: () => moves.read(viewer.configuration.base)[at], set: (value) => viewer.setBase(at, value),
  };
}

function slider(one: Sliding, viewer: Viewer): { node: HTMLElement; update: () => void } {
  const scale = scaleOf(one);
  const [lower, upper] = one.range;
  const reach = one.turns ? TURN : 2 * viewer.stage.size;
  const ends = [Number.isFinite(lower) ? lower : Math.min(-reach, upper - reach), Number.isFinite(upper) ? upper : Math.max(reach, lower + reach)];
  const move = (text: string): void => {
    const value = Number(text) / scale;
    if (text !== "" && Number.isFinite(value)) one.set(Math.min(upper, Math.max(lower, value)));
  };
  const [min, max] = ends.map((end) => trimmed(end * scale, 3));
  const range = make("input", {
    type: "range", min, max, step: one.turns ? 0.1 : 0.01, "aria-label": `${one.path} slider, ${unitOf(one)}`,
    oninput: (event) => move((event.target as HTMLInputElement).value),
  });
  const number = make("input", {
    type: "number", step: one.turns ? 1 : 0.1, "aria-label": `${one.path} value, ${unitOf(one)}`,
    onchange: (event) => { move((event.target as HTMLInputElement).value); show(); },
  });
  const end = (value: number, word: string): string => (Number.isFinite(value) ? shownCoordinate(one, value) : `no ${word} limit`);
  const node = make(
    "div", {
      class: "joint", title: one.about, onpointerenter: () => viewer.hover(one.path), onpointerleave: () => viewer.hover(null),
      ondblclick: (event) => { if (event.target === range) one.set(Math.min(upper, Math.max(lower, 0))); },
    },
    make("span", { class: "name" }, one.path), number, make("span", { class: "unit" }, unitOf(one)), range,
    make("div", { class: "ends" }, make("span", {}, end(lower, "lower")), make("span", { title: one.words }, one.words), make("span", {}, end(upper, "upper"))),
  );
  const show = (): void => { number.value = trimmed(one.value() * scale, one.turns ? 1 : 2); };
  const update = (): void => {
    const value = one.value() * scale;
    range.min = String(Math.min(Number(min), value)); // a pose of a joint without limits can be outside the default range
    range.max = String(Math.max(Number(max), value));
    range.value = String(value);
    if (document.activeElement !== number) show();
  };
  return { node, update };
}

/** The tooltip of a coordinate: kind, drive, limits and source location. */
function about(joint: Joint): string {
  const unit = joint.turns ? "N m" : "N", speed = joint.turns ? "rad/s" : "m/s";
  return [
    `${joint.path}: ${joint.kind}${joint.drive === null ? "" : `, ${joint.drive} drive`}`, ...(joint.effort === null ? [] : [`effort ${trimmed(joint.effort, 3)} ${unit}`]),
    ...(joint.velocity === null ? [] : [`velocity ${trimmed(joint.velocity, 3)} ${speed}`]), ...(joint.file === null ? [] : [`${joint.file}:${joint.line}`]),
  ].join("\n");
}

/** The coordinates in the format of `poses` in a document. */
function yaml(viewer: Viewer): string {
  const values = viewer.joints.filter((joint) => !viewer.follows(joint.path)).map((joint) => {
    const number = joint.path === joint.joint ? null : /_(\d+)$/.exec(joint.path)!;
    const key = joint.joint.replaceAll("/", ".");
    const plain = number === null ? key : `"${key}[${number[1]}]"`;
    return `${plain}: ${Number((viewer.q[joint.path] * scaleOf(joint)).toFixed(3))} ${unitOf(joint)}`;
  });
  return `{${values.join(", ")}}`;
}
