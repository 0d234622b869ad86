// The efforts that hold a robot at rest, and the torque margins of its drives (defined in compiler/thingc/model/statics). For trees they are computed
// here in closed form for any configuration. With loops, holds or feet, only the compiler can compute them, so they are known for named poses only.

import { Vector3 } from "three";
import type { Configuration } from "./configuration";
import type { Joint, Mode, Robot } from "./data";
import type { Coordinates } from "./kinematics";

/** Smaller efforts [N m or N] count as zero; loads below this fraction of the largest one are rounding errors. */
const NO_LOAD = 1e-12;
const SLACK = 1e-6;

/** The torque margins (effort limit / required effort) of drives with a limit and a load, by joint path, and a note to display. */
export interface Held { margins: Record<string, number>; note: string | null }

export function held(robot: Robot, at: Configuration): Held {
  const { mode, pose } = at;
  const shared = sharing(robot, mode);
  if (shared === null) return ofTree(robot, at);
  if (shared.unknown || pose === null) return { margins: {}, note: shared.words };
  if (pose.falls) return { margins: {}, note: "The robot is not supported in this pose: it falls." };
  return { margins: pose.margins, note: pose.unheld === null ? null : unheld(pose.unheld) };
}

const unheld = (path: string): string => `The drives cannot hold this pose: ${path === "" ? "the robot" : path} moves.`;

/** The reason why the loads of a mode cannot be computed here; null if they can. `unknown`: not for named poses either. */
function sharing(robot: Robot, mode: Mode): { words: string; unknown: boolean } | null {
  const named = mode.poses.length > 0 ? " Select a pose." : "";
  if (mode.base === "free" && mode.feet.length === 0 && !mode.loops.some((loop) => loop.hold)) {
    return { words: `No torque margins: mode ${mode.name} has a free base without feet or holds.`, unknown: true };
  }
  const about = robot.joints.some(({ path, drive_axis: axis }) => axis !== null && mode.driven.includes(path));
  const what = mode.loops.some((loop) => loop.hold) ? "holds" : mode.loops.length > 0 ? "loops"
    : mode.base === "free" ? "feet" : about ? "drives of a ball joint" : robot.tendons > 0 ? "tendons" : null;
  return what === null ? null : { words: `Torque margins are known only for named poses, because ${what} share the load.${named}`, unknown: false };
}

/** For drives on one coordinate with factors f and limits l, sum (t / l)^2 with sum f t = -Q is smallest at t = -Q f l^2 / sum (f l)^2. */
function ofTree(robot: Robot, at: Configuration): Held {
  const load: Coordinates = {};
  const own = loads(robot, at);
  const { couplings } = at;
  for (const [path, value] of Object.entries(own)) {
    const { path: leader, factor } = couplings.leader(path, at.q);
    load[leader] = (load[leader] ?? 0) + factor * value;
  }
  const drives = robot.joints.filter(({ path }) => at.mode.driven.includes(path)).map((joint) => ({ joint, ...couplings.leader(joint.path, at.q) }));
  const weight = (joint: Joint, factor: number): number => (factor * (joint.effort || 1)) ** 2;
  const total: Coordinates = {};
  for (const { joint, path, factor } of drives) total[path] = (total[path] ?? 0) + weight(joint, factor);
  const margins: Record<string, number> = {};
  for (const { joint, path, factor } of drives) {
    const effort = factor === 0 ? 0 : (load[path] * (weight(joint, factor) / total[path])) / factor;
    if (joint.effort !== null && Math.abs(effort) > NO_LOAD) margins[joint.path] = joint.effort / Math.abs(effort);
  }
  const greatest = Math.max(0, ...Object.values(load).map(Math.abs));
  const loose = Object.keys(load).filter((path) => !(total[path] > 0)).sort((a, b) => Math.abs(load[b]) - Math.abs(load[a]))[0];
  return { margins, note: loose !== undefined && Math.abs(load[loose]) > SLACK * greatest ? unheld(loose) : null };
}

/**
 * The effort of gravity and of the spring on every coordinate of a tree [N m or N], positive along positive q
 * (Featherstone, Rigid Body Dynamics Algorithms, section 5.3, at rest).
 */
export function loads(robot: Robot, { tree, mode, q, base }: Configuration): Coordinates {
  const placed = tree.place(q, base, tree.fresh());
  const masses = mode.bodies.map((body) => robot.links[body.link].mass);
  const moments = mode.bodies.map((body, index) => new Vector3(...robot.links[body.link].centre).applyMatrix4(placed[index]).multiplyScalar(masses[index]));
  const sprung = new Map(robot.joints.map(({ path, stiffness, rest }) => [path, (stiffness ?? 0) * ((rest ?? 0) - q[path])]));
  const gravity = new Vector3(...mode.gravity);
  const load: Coordinates = {};
  for (let index = mode.bodies.length - 1; index >= 0; index -= 1) {
    const { parent, joints } = mode.bodies[index];
    for (const { path } of joints) {
      const { angular, linear, anchor } = tree.rate(path, q, placed)!;
      const arm = moments[index].clone().addScaledVector(anchor, -masses[index]);
      load[path] = arm.cross(gravity).dot(angular) + masses[index] * linear.dot(gravity) + sprung.get(path)!;
    }
    if (parent === null) continue;
    masses[parent] += masses[index];
    moments[parent].add(moments[index]);
  }
  return load;
}
