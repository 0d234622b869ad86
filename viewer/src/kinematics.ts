// Where the links of a mode are at given coordinates. Doubles throughout: three.js rounds only what it draws.

import { Matrix4, Vector3 } from "three";
import type { Body, Joint, Mode, Moving, Robot, Rows, Twist } from "./data";

/** q [rad or m] of every coordinate by path. */
export type Coordinates = Record<string, number>;

export function matrixOf(rows: Rows): Matrix4 {
  return new Matrix4(...(rows as [number, number, number, number, number, number, number, number, number, number, number, number]), 0, 0, 0, 1);
}

const turn = new Matrix4();
const axis = new Vector3();

/** The pose at q of what was at the frame at q = 0: a turn about the axis through the anchor, and a slide along it (Rodrigues' formula). */
export function exponential([angular, linear, anchor]: Twist, q: number, target: Matrix4): Matrix4 {
  if (angular[0] === 0 && angular[1] === 0 && angular[2] === 0) {
    return target.makeTranslation(linear[0] * q, linear[1] * q, linear[2] * q);
  }
  turn.makeRotationAxis(axis.fromArray(angular), q);
  const moved = axis.fromArray(anchor).applyMatrix4(turn);
  target.copy(turn);
  return target.setPosition(
    anchor[0] - moved.x + linear[0] * q, anchor[1] - moved.y + linear[1] * q, anchor[2] - moved.z + linear[2] * q,
  );
}

const step = new Matrix4();

/** Moves `pose` by coordinates, one after the other, or those of a ball at once: their rotation vector. */
export function move(pose: Matrix4, joints: Moving[], atOnce: boolean, q: Coordinates): Matrix4 {
  if (!atOnce) {
    for (const joint of joints) pose.multiply(exponential(joint.twist, q[joint.path], step));
    return pose;
  }
  const vector = new Vector3();
  for (const { path, twist } of joints) vector.addScaledVector(axis.fromArray(twist[0]), q[path]);
  const angle = vector.length();
  if (angle === 0) return pose;
  return pose.multiply(exponential([vector.divideScalar(angle).toArray(), [0, 0, 0], joints[0].twist[2]], angle, step));
}

/** A mode's tree: where its bodies are in the world. */
export class Tree {
  private readonly offsets: Matrix4[];
  readonly bodies: Body[];
  /** Where each link's body is among the bodies. */
  readonly bodyOf: Map<number, number>;

  constructor(readonly mode: Mode) {
    this.bodies = mode.bodies;
    this.offsets = mode.bodies.map((body) => matrixOf(body.X));
    this.bodyOf = new Map(mode.bodies.map((body, index) => [body.link, index]));
  }

  /** Where the mode puts its root link. */
  get home(): Matrix4 {
    return this.offsets[0];
  }

  /** Fills `placed`, a matrix per body. */
  place(q: Coordinates, base: Matrix4, placed: Matrix4[]): Matrix4[] {
    this.bodies.forEach((body, index) => {
      if (body.parent === null) placed[index].copy(base);
      else move(placed[index].multiplyMatrices(placed[body.parent], this.offsets[index]), body.joints, body.at_once, q);
    });
    return placed;
  }

  fresh(): Matrix4[] {
    return this.bodies.map(() => new Matrix4());
  }

  /** The frame in the world in which the twist of a coordinate is given, at q; the links at `placed`. */
  frameOf(path: string, q: Coordinates, placed: Matrix4[]): { frame: Matrix4; twist: Twist } | null {
    for (const [index, body] of this.bodies.entries()) {
      const at = body.joints.findIndex((joint) => joint.path === path);
      if (at < 0 || body.parent === null) continue;
      const frame = new Matrix4().multiplyMatrices(placed[body.parent], this.offsets[index]);
      if (body.at_once) move(frame, body.joints, true, q);
      else move(frame, body.joints.slice(0, at), false, q);
      return { frame, twist: body.joints[at].twist };
    }
    return null;
  }

  /** The bodies between a body and the root, itself first. */
  above(index: number): number[] {
    const chain = [index];
    for (let parent = this.bodies[index].parent; parent !== null; parent = this.bodies[parent].parent) chain.push(parent);
    return chain;
  }
}

/** Which coordinates follow others, and how. */
export class Followers {
  private readonly joints: Map<string, Joint>;

  constructor(robot: Robot) {
    this.joints = new Map(robot.joints.map((joint) => [joint.path, joint]));
  }

  follows(path: string): boolean {
    const mimic = this.joints.get(path)?.mimic;
    return mimic != null && this.joints.has(mimic.joint);
  }

  /** The coordinate that `path` follows in the end (itself where it follows none), q = factor * q(leader) + shift. */
  leader(path: string): { path: string; factor: number; shift: number } {
    let here = path, factor = 1, shift = 0;
    const met = new Set<string>();
    while (this.follows(here) && !met.has(here)) {
      met.add(here);
      const mimic = this.joints.get(here)!.mimic!;
      shift += factor * mimic.offset;
      factor *= mimic.multiplier;
      here = mimic.joint;
    }
    return { path: here, factor, shift };
  }

  /** Puts every follower where its leader has it. */
  settle(q: Coordinates): Coordinates {
    for (const path of this.joints.keys()) {
      if (!this.follows(path)) continue;
      const { path: leader, factor, shift } = this.leader(path);
      if (leader !== path) q[path] = factor * (q[leader] ?? 0) + shift;
    }
    return q;
  }
}
