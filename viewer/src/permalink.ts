// The whole state in the fragment of the address, so that a link shows what its sender saw.

import { Vector3 } from "three";
import { COLOURINGS } from "./colors";
import { MARKS, SHOWN, type Viewer } from "./viewer";

const DIGITS = 6;
const short = (value: number): string => String(Number(value.toPrecision(DIGITS)));
const one = <T extends string>(words: readonly T[], word: string | null): T | null => words.find((known) => known === word) ?? null;

export function written(viewer: Viewer): string {
  const { options, stage } = viewer;
  const told = new URLSearchParams();
  told.set("mode", viewer.mode.name);
  if (viewer.pose !== null) told.set("pose", viewer.pose.name);
  else told.set("q", viewer.joints.filter((joint) => !viewer.follows(joint.path)).map((joint) => `${joint.path}:${viewer.q[joint.path].toPrecision(10)}`).join(","));
  const { camera, controls } = stage;
  told.set("camera", [...camera.position.toArray(), ...controls.target.toArray()].map(short).join(","));
  if (options.shown !== "visual") told.set("show", options.shown);
  told.set("marks", MARKS.filter((mark) => options.marks.has(mark)).join(","));
  if (options.colouring !== "part") told.set("colour", options.colouring);
  if (options.explode > 0) told.set("explode", short(options.explode));
  if (options.section.axis !== null) told.set("section", `${options.section.axis}:${short(options.section.part)}`);
  told.set("theme", options.theme);
  if (!options.panels) told.set("panels", "none");
  if (viewer.choice.size > 0) told.set("chosen", [...viewer.choice].map((index) => viewer.robot.occurrences[index].path).join(","));
  if (viewer.measured.some((key) => key !== "")) {
    const keys = viewer.mountKeys();
    told.set("measure", viewer.measured.map((key) => keys.get(key) ?? "").join(","));
  }
  return `#${told.toString()}`;
}

/** Restores what a fragment says, as far as it is there in this robot. Whether it said anything. */
export function restored(viewer: Viewer, fragment: string): boolean {
  const told = new URLSearchParams(fragment.replace(/^#/, ""));
  if (told.size === 0) return false;
  const numbers = (text: string | null): number[] => (text ?? "").split(",").map(Number).filter(Number.isFinite);
  if (told.has("mode")) viewer.setMode(told.get("mode")!);
  if (told.has("pose")) viewer.setPose(told.get("pose")!, false);
  else if (told.has("q")) {
    const pairs = told.get("q")!.split(",").map((pair) => [pair.slice(0, pair.lastIndexOf(":")), Number(pair.slice(pair.lastIndexOf(":") + 1))] as const);
    viewer.restore(Object.fromEntries(pairs));
  }
  const [axis, part] = (told.get("section") ?? "").split(":");
  viewer.setOptions({
    shown: one(SHOWN, told.get("show")) ?? "visual", colouring: one(COLOURINGS, told.get("colour")) ?? "part",
    explode: Math.min(1, Math.max(0, numbers(told.get("explode"))[0] ?? 0)), theme: one(["light", "dark"] as const, told.get("theme")) ?? viewer.options.theme,
    panels: told.get("panels") !== "none",
    section: { axis: one(["x", "y", "z"] as const, axis), part: Math.min(1, Math.max(0, numbers(part ?? null)[0] ?? 0.5)) },
    ...(told.has("marks") ? { marks: new Set(told.get("marks")!.split(",").map((word) => one(MARKS, word)).filter((mark) => mark !== null)) } : {}),
  });
  const paths = new Set((told.get("chosen") ?? "").split(","));
  viewer.choose(viewer.robot.occurrences.flatMap((occurrence, index) => (paths.has(occurrence.path) ? [index] : [])));
  const ends = (told.get("measure") ?? "").split(",");
  const keys = [...viewer.mountKeys()];
  ([0, 1] as const).forEach((which) => viewer.measure(which, keys.find(([, words]) => words === ends[which])?.[0] ?? ""));
  const seen = numbers(told.get("camera"));
  if (seen.length === 6) {
    viewer.stage.camera.position.copy(new Vector3(...(seen.slice(0, 3) as [number, number, number])));
    viewer.stage.controls.target.set(seen[3], seen[4], seen[5]);
    viewer.stage.controls.update();
  }
  return true;
}
