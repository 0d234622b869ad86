// The motion player: moves the robot along a motion of the document, or between two poses of the mode, with loops closed on the way.

import type { Motion } from "../data";
import { matrixOf } from "../kinematics";
import type { Posture, Viewer } from "../viewer";
import { make, select } from "./dom";

const BETWEEN = "between two poses";
const CURRENT = "current pose";
const DURATIONS = ["1 s", "2 s", "5 s", "10 s"];

/** An end of the motion; the name is null for the current pose. */
interface End extends Posture { name: string | null }

/** The controls of the player; empty if the mode has no poses and the robot has no motions. */
export function motionPlayer(viewer: Viewer): { nodes: HTMLElement[]; update: () => void } {
  const poses = viewer.mode.poses.map(({ name }) => name);
  const motions = viewer.robot.motions ?? [];
  if (poses.length + motions.length === 0) return { nodes: [], update: () => {} };
  let motion: Motion | null = motions[0] ?? null;
  const chosen: [string, string] = poses.length > 1 ? [poses[0], poses[1]] : [CURRENT, poses[0] ?? CURRENT];
  let seconds = parseFloat(DURATIONS[1]);
  let ends: [End, End] | null = null;
  let part = 0, direction = 1, last = 0;
  let playing = false, moving = false;

  const endOf = (name: string): End => {
    const { q, base, tree } = viewer.configuration;
    const pose = viewer.mode.poses.find((one) => one.name === name);
    if (pose === undefined) return { name: null, q: { ...q }, base: base.clone() };
    return { name, q: pose.q, base: pose.base === null ? tree.home.clone() : matrixOf(pose.base) };
  };

  /** Moves the robot to the time of a motion of the document; between two poses, the joints move with minimum jerk. */
  const follow = ({ times, q, smooth }: Motion): void => {
    const time = times[0] + part * (times[times.length - 1] - times[0]);
    const later = times.findIndex((one) => one > time);
    const row = later < 0 ? times.length - 2 : later - 1;
    const s = (time - times[row]) / (times[row + 1] - times[row]);
    const { base } = viewer.configuration;
    const at = (index: number): Posture => ({ q: Object.fromEntries(Object.entries(q).map(([path, values]) => [path, values[index]])), base });
    viewer.interpolate(at(row), at(row + 1), smooth ? s : s ** 3 * (10 - 15 * s + 6 * s ** 2));
  };

  /** Moves the robot to a fraction of the motion; named poses are reached exactly. */
  const moveTo = (value: number): void => {
    ends ??= [endOf(chosen[0]), endOf(chosen[1])];
    part = Math.min(1, Math.max(0, value));
    const named = part === 0 ? ends[0].name : part === 1 ? ends[1].name : null;
    moving = true;
    if (motion !== null) follow(motion);
    else if (named !== null) viewer.setPose(named, false);
    else viewer.interpolate(ends[0], ends[1], part);
    moving = false;
    show();
  };

  const step = (now: number): void => {
    if (!playing || !play.isConnected) return;
    const duration = motion === null ? seconds : motion.times[motion.times.length - 1] - motion.times[0];
    moveTo(part + (direction * (now - last)) / 1000 / duration);
    last = now;
    if (part === (direction > 0 ? 1 : 0)) {
      if (repeat.checked) direction = -direction;
      else playing = false;
    }
    show();
    if (playing) requestAnimationFrame(step);
  };

  const toggle = (): void => {
    playing = !playing;
    if (playing) {
      if (!repeat.checked && part === 1) part = 0;
      if (part === 0) [ends, direction] = [null, 1];
      if (!repeat.checked) direction = 1;
      last = performance.now();
      requestAnimationFrame(step);
    }
    show();
  };

  /** Stops; the next motion begins at the first pose. */
  const reset = (): void => {
    [playing, part, ends] = [false, 0, null];
    show();
  };

  const choose = (which: 0 | 1) => (name: string): void => {
    chosen[which] = name;
    reset();
  };
  const play = make("button", { type: "button", id: "play", title: "Play or pause the motion (space)", onclick: toggle }, "Play");
  const repeat = make("input", { type: "checkbox" });
  const progress = make("input", {
    type: "range", min: 0, max: 1, step: 0.005, "aria-label": "Position in the motion",
    oninput: (event) => {
      playing = false;
      moveTo(Number((event.target as HTMLInputElement).value));
    },
  });
  const show = (): void => {
    play.textContent = playing ? "Pause" : "Play";
    progress.value = String(part);
  };
  show();
  const names = [CURRENT, ...poses];
  const between = make(
    "div", {}, select("From pose", names, chosen[0], choose(0)), select("To pose", names, chosen[1], choose(1)),
    select("Duration", DURATIONS, DURATIONS[1], (text) => { seconds = parseFloat(text); }),
  );
  between.hidden = motion !== null;
  const motionOf = (name: string): void => {
    motion = motions.find((one) => one.name === name) ?? null;
    between.hidden = motion !== null;
    reset();
  };
  const listed = [...motions.map(({ name }) => name), ...(poses.length > 0 ? [BETWEEN] : [])];
  const nodes = [
    make("h2", {}, "Motion"), ...(motions.length > 0 ? [select("Motion", listed, listed[0], motionOf)] : []), between,
    make("div", { class: "row" }, play, make("label", {}, repeat, " back and forth")),
    progress,
  ];
  return { nodes, update: () => { if (!moving && part + Number(playing) > 0) reset(); } };
}
