// The state of the view in the fragment of the address, so that a link restores it.

import { Vector3 } from "three";
import { COLOURINGS } from "./colors";
import { matrixOf, rowsOf } from "./kinematics";
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
  if (viewer.pose === null && !viewer.configuration.atHome) told.set("base", rowsOf(viewer.configuration.base).map((x) => x.toPrecision(10)).join(","));
  const { camera, controls } = stage;
  told.set("camera", [...camera.position.toArray(), ...controls.target.toArray()].map(short).join(","));
  if (options.shown !== "visual") told.set("show", options.shown);
  told.set("marks", MARKS.filter((mark) => options.marks.has(mark)).join(","));
  if (options.colouring !== "part") told.set("colour", options.colouring);
  if (options.explode > 0) told.set("explode", short(options.explode));
  if (options.section.axis !== null) told.set("section", `${options.section.flip ? "-" : ""}${options.section.axis}:${short(options.section.part)}`);
  told.set("theme", options.theme);
  if (!options.panels) told.set("panels", "none");
  for (const [key, chosen] of [["chosen", viewer.choice], ["hidden", viewer.hidden], ["transparent", viewer.transparent]] as const) {
    if (chosen.size > 0) told.set(key, [...chosen].map((index) => viewer.robot.occurrences[index].path).join(","));
  }
  if (viewer.measured.some((key) => key !== "")) {
    const keys = viewer.mountKeys();
    told.set("measure", viewer.measured.map((key) => keys.get(key) ?? "").join(","));
  }
  return `#${told.toString()}`;
}

/** Restores the state from a fragment. Parts of it that this robot does not have are ignored. Returns false for an empty fragment. */
export function restored(viewer: Viewer, fragment: string): boolean {
  const told = new URLSearchParams(fragment.replace(/^#/, ""));
  const { stage } = viewer;
  if (told.size === 0) return false;
  const numbers = (text: string | null): number[] => (text ?? "").split(",").filter((word) => word !== "").map(Number).filter(Number.isFinite);
  if (told.has("mode")) viewer.setMode(told.get("mode")!);
  if (told.has("pose")) viewer.setPose(told.get("pose")!, false);
  else if (told.has("q")) {
    const pairs = told.get("q")!.split(",").map((pair) => /^(.*):([^:]+)$/.exec(pair)).filter((found) => found !== null);
    const base = numbers(told.get("base"));
    viewer.restore(Object.fromEntries(pairs.map(([, path, value]) => [path, Number(value)])), base.length === 12 ? matrixOf(base) : null);
  }
  const occurrences = (key: string): number[] => {
    const paths = new Set((told.get(key) ?? "").split(","));
    return viewer.robot.occurrences.flatMap(({ path }, index) => (paths.has(path) ? [index] : []));
  };
  viewer.setVisibility(occurrences("hidden"), occurrences("transparent"));
  const [side, part] = (told.get("section") ?? "").split(":");
  const axis = side.replace(/^-/, "");
  viewer.explodeBy(Math.min(1, Math.max(0, numbers(told.get("explode"))[0] ?? 0)));
  viewer.setOptions({
    shown: one(SHOWN, told.get("show")) ?? "visual", colouring: one(COLOURINGS, told.get("colour")) ?? "part",
    theme: one(["light", "dark"] as const, told.get("theme")) ?? viewer.options.theme,
    panels: told.get("panels") !== "none",
    section: {
      axis: one(["x", "y", "z"] as const, axis), part: Math.min(1, Math.max(0, numbers(part ?? null)[0] ?? 0.5)), flip: side.startsWith("-"),
    },
    ...(told.has("marks") ? { marks: new Set(told.get("marks")!.split(",").map((word) => one(MARKS, word)).filter((mark) => mark !== null)) } : {}),
  });
  viewer.choose(occurrences("chosen"));
  const ends = (told.get("measure") ?? "").split(",");
  const keys = [...viewer.mountKeys()];
  ([0, 1] as const).forEach((which) => viewer.measure(which, keys.find(([, words]) => words === ends[which])?.[0] ?? ""));
  const seen = numbers(told.get("camera"));
  const [from, to] = [new Vector3(...seen.slice(0, 3)), new Vector3(...seen.slice(3))];
  const away = from.distanceTo(to);
  if (seen.length === 6 && away > 1e-3 * stage.size && away < 1e4 * stage.size) {
    stage.camera.position.copy(from);
    stage.controls.target.copy(to);
    stage.controls.update();
  }
  return true;
}
