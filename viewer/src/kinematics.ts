// Forward kinematics: the poses of the links of a mode. All numbers are doubles; three.js rounds only for drawing.

import { Matrix3, Matrix4, Quaternion, Vector3 } from "three";
import type { Body, Joint, Mode, Moving, Robot, Rows, Twist } from "./data";

/** q [rad or m] of every coordinate by path. */
export type Coordinates = Record<string, number>;

export function matrixOf(rows: Rows): Matrix4 {
  return new Matrix4(...(rows as [number, number, number, number, number, number, number, number, number, number, number, number]), 0, 0, 0, 1);
}

export function rowsOf(pose: Matrix4): Rows {
  return pose.clone().transpose().elements.slice(0, 12);
}

const turn = new Matrix4();
const axis = new Vector3();

/** The exponential of a twist: a rotation about the axis through the anchor, and a translation along it (Rodrigues' formula). */
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

function turns({ twist: [angular] }: Moving): boolean {
  return angular.some((x) => x !== 0);
}

/** Moves `pose` by coordinates, one after the other. With `atOnce`, rotations are the rotation vector of a ball or a free joint. */
export function move(pose: Matrix4, joints: Moving[], atOnce: boolean, q: Coordinates): Matrix4 {
  if (!atOnce) {
    for (const joint of joints) pose.multiply(exponential(joint.twist, q[joint.path], step));
    return pose;
  }
  const rotations = joints.filter(turns), slides = joints.filter((joint) => !turns(joint));
  if (joints[0] === slides[0]) move(pose, slides, false, q);
  const vector = turned(rotations, q), angle = vector.length();
  if (angle !== 0) pose.multiply(exponential([vector.divideScalar(angle).toArray(), [0, 0, 0], rotations[0].twist[2]], angle, step));
  return joints[0] === slides[0] ? pose : move(pose, slides, false, q);
}

/** The rotation vector of a ball, in the frame of its twists. */
function turned(joints: Moving[], q: Coordinates): Vector3 {
  const vector = new Vector3();
  for (const { path, twist } of joints) vector.addScaledVector(axis.fromArray(twist[0]), q[path]);
  return vector;
}

/**
 * The angular velocity, in the moving frame, of a rotation vector w that changes at the rate v: `v - b w x v + c w x (w x v)` with
 * b = (1 - cos a) / a^2, c = (a - sin a) / a^3, a = |w| (Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, 2012,
 * section 10.3.3); near 0 by their series.
 */
function rightJacobian(w: Vector3, v: Vector3): Vector3 {
  const a = w.length();
  const [b, c] = a > 1e-4 ? [(1 - Math.cos(a)) / a ** 2, (a - Math.sin(a)) / a ** 3] : [0.5 - a ** 2 / 24, 1 / 6 - a ** 2 / 120];
  const once = w.clone().cross(v);
  return v.clone().addScaledVector(once, -b).addScaledVector(w.clone().cross(once), c);
}

/** The rotation vector of a pose; its angle [rad] is at most half a turn. */
export function rotationVector(pose: Matrix4): number[] {
  const turn = new Quaternion().setFromRotationMatrix(pose);
  const sign = turn.w < 0 ? -1 : 1;
  const [x, y, z] = [sign * turn.x, sign * turn.y, sign * turn.z];
  const sine = Math.hypot(x, y, z);
  const factor = sine < 1e-12 ? 2 : (2 * Math.atan2(sine, sign * turn.w)) / sine;
  return [factor * x, factor * y, factor * z];
}

/** The kinematic tree of a mode. */
export class Tree {
  private readonly offsets: Matrix4[];
  readonly bodies: Body[];
  /** The index of the body of each link. */
  readonly bodyOf: Map<number, number>;
  /** The joint of each coordinate: between a body and its parent, or at the cut of a loop. */
  private readonly movers = new Map<string, { parent: number | null; offset: Matrix4; joints: Moving[]; at: number; atOnce: boolean }>();

  constructor(readonly mode: Mode) {
    this.bodies = mode.bodies;
    this.offsets = mode.bodies.map((body) => matrixOf(body.X));
    this.bodyOf = new Map(mode.bodies.map((body, index) => [body.link, index]));
    const moves = [
      ...mode.bodies.map((body, index) => ({ parent: body.parent, offset: this.offsets[index], joints: body.joints, atOnce: body.at_once })),
      ...mode.loops.map((loop) => ({ parent: loop.parent, offset: matrixOf(loop.X_PA), joints: loop.joints, atOnce: loop.at_once })),
    ];
    for (const one of moves) one.joints.forEach(({ path }, at) => this.movers.set(path, { ...one, at }));
  }

  /** The initial pose of the root link. */
  get home(): Matrix4 {
    return this.offsets[0];
  }

  /** Computes the pose of every body into `placed`. */
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

  /** The frame of the twist of a coordinate in the world, at q, for bodies at `placed`. */
  frameOf(path: string, q: Coordinates, placed: Matrix4[]): { frame: Matrix4; twist: Twist } | null {
    const known = this.movers.get(path);
    if (known === undefined) return null;
    const { parent, offset, joints, at, atOnce } = known;
    const frame = parent === null ? offset.clone() : new Matrix4().multiplyMatrices(placed[parent], offset);
    const until = atOnce && turns(joints[at]) ? joints.map(turns).lastIndexOf(true) + 1 : at;
    move(frame, joints.slice(0, until), atOnce, q);
    return { frame, twist: joints[at].twist };
  }

  /** The velocity per unit of a coordinate, in the world: angular (not a unit vector for a ball), linear, and a point on the axis. */
  rate(path: string, q: Coordinates, placed: Matrix4[]): { angular: Vector3; linear: Vector3; anchor: Vector3 } | null {
    const found = this.frameOf(path, q, placed);
    if (found === null) return null;
    const { frame, twist: [angular, linear, anchor] } = found;
    const { joints, atOnce } = this.movers.get(path)!;
    const rotation = new Matrix3().setFromMatrix4(frame);
    const own = new Vector3(...angular);
    return {
      angular: (atOnce ? rightJacobian(turned(joints, q), own) : own).applyMatrix3(rotation),
      linear: new Vector3(...linear).applyMatrix3(rotation), anchor: new Vector3(...anchor).applyMatrix4(frame),
    };
  }

  /** The bodies from a body to the root, the body itself first. */
  above(index: number): number[] {
    const chain = [index];
    for (let parent = this.bodies[index].parent; parent !== null; parent = this.bodies[parent].parent) chain.push(parent);
    return chain;
  }
}

/** The mimics of a robot, and the ranges of its coordinates. */
export class Couplings {
  private readonly joints: Map<string, Joint>;
  private readonly leaders = new Map<string, { path: string; factor: number; shift: number }>();
  /** Coordinates that follow by a polynomial, directly or through another one: their factor depends on q. */
  private readonly bent = new Set<string>();
  private readonly ranges = new Map<string, [number, number]>();
  private readonly cones: { paths: string[]; cone: number }[];
  /** Rotations without limits and without mimics. */
  private readonly endless: string[];

  constructor(robot: Robot) {
    this.joints = new Map(robot.joints.map((joint) => [joint.path, joint]));
    for (const path of this.joints.keys()) this.leaders.set(path, this.found(path, null));
    for (const [path, { path: leader, factor, shift }] of this.leaders) {
      if (this.bent.has(path)) continue;
      const { lower, upper } = this.joints.get(path)!;
      const [low, high] = this.ranges.get(leader) ?? [-Infinity, Infinity];
      const ends = [lower ?? -Infinity, upper ?? Infinity].map((end) => (end - shift) / factor);
      if (factor !== 0) this.ranges.set(leader, [Math.max(low, Math.min(...ends)), Math.min(high, Math.max(...ends))]);
    }
    const coupled = new Set([...this.leaders].flatMap(([path, { path: leader }]) => (path === leader ? [] : [path, leader])));
    this.endless = robot.joints.flatMap(({ path, kind, turns, lower, upper }) =>
      turns && kind !== "ball" && lower === null && upper === null && !coupled.has(path) ? [path] : [],
    );
    const balls = new Map<string, string[]>();
    for (const { path, joint, kind } of robot.joints) if (kind === "ball") balls.set(joint, [...(balls.get(joint) ?? []), path]);
    this.cones = [...balls.values()].flatMap((paths) => {
      const cone = this.joints.get(paths[0])!.cone;
      return cone === null ? [] : [{ paths, cone }];
    });
  }

  private found(path: string, q: Coordinates | null): { path: string; factor: number; shift: number } {
    let here = path, factor = 1, shift = 0;
    for (const met = new Set<string>(); !met.has(here); ) {
      met.add(here);
      const mimic = this.joints.get(here)!.mimic;
      if (mimic === null || !this.joints.has(mimic.joint)) break;
      if (mimic.higher.length > 0) this.bent.add(path);
      const x = q?.[mimic.joint] ?? 0;
      const slope = mimic.higher.reduce((sum, c, k) => sum + (k + 2) * c * x ** (k + 1), mimic.multiplier);
      const value = mimic.higher.reduce((sum, c, k) => sum + c * x ** (k + 2), mimic.multiplier * x + mimic.offset);
      shift += factor * (mimic.higher.length > 0 ? value - slope * x : mimic.offset);
      factor *= slope;
      here = mimic.joint;
    }
    return { path: here, factor, shift };
  }

  /** The last leader of `path` (itself if it follows none): q = factor * q(leader) + shift; polynomials are linearized at `q`. */
  leader(path: string, q: Coordinates | null = null): { path: string; factor: number; shift: number } {
    return q !== null && this.bent.has(path) ? this.found(path, q) : this.leaders.get(path)!;
  }

  /** The value of `path` for a value of its last leader. */
  private at(path: string, value: number): number {
    const chain: string[] = [];
    const { path: leader } = this.leader(path);
    for (let here = path; here !== leader; here = this.joints.get(here)!.mimic!.joint) chain.unshift(here);
    const q: Coordinates = { [leader]: value };
    for (const here of chain) {
      const { joint, multiplier, offset, higher } = this.joints.get(here)!.mimic!;
      q[here] = higher.reduce((sum, c, k) => sum + c * q[joint] ** (k + 2), multiplier * q[joint] + offset);
    }
    return q[path];
  }

  /** Samples of the last leader of `path` over its range (clipped to half a turn or 3.14 m either way), with the value of `path`. */
  private sampled(path: string): [number, number][] {
    const [low, high] = this.range(this.leader(path).path).map((end) => Math.max(-Math.PI, Math.min(Math.PI, end)));
    return Array.from({ length: 201 }, (_, k) => low + ((high - low) * k) / 200).map((x) => [x, this.at(path, x)]);
  }

  follows(path: string): boolean {
    return this.leader(path).path !== path;
  }

  /** The range in which a coordinate and all coupled ones stay within their limits. */
  range(path: string): [number, number] {
    if (this.bent.has(path)) {
      const reached = this.sampled(path).map(([, value]) => value);
      return [Math.min(...reached), Math.max(...reached)];
    }
    const { path: leader, factor, shift } = this.leader(path);
    const ends = (this.ranges.get(leader) ?? [-Infinity, Infinity]).map((end) => factor * end + shift);
    return factor === 0 ? [shift, shift] : [Math.min(...ends), Math.max(...ends)];
  }

  /** The value of the last leader for a value of `path`. */
  led(path: string, value: number): number {
    if (this.bent.has(path)) return this.sampled(path).reduce((best, one) => (Math.abs(one[1] - value) < Math.abs(best[1] - value) ? one : best))[0];
    const { factor, shift } = this.leader(path);
    return factor === 0 ? 0 : (value - shift) / factor;
  }

  /** Clamps leaders to their ranges and balls to their cones, then computes the followers. */
  settle(q: Coordinates): Coordinates {
    for (const [path, [low, high]] of this.ranges) if (path in q) q[path] = Math.min(high, Math.max(low, q[path]));
    for (const { paths, cone } of this.cones) {
      const angle = Math.hypot(...paths.map((path) => q[path]));
      if (angle > cone) for (const path of paths) q[path] *= cone / angle;
    }
    for (const [path, { path: leader, factor, shift }] of this.leaders) if (path !== leader) {
      q[path] = this.bent.has(path) ? this.at(path, q[leader] ?? 0) : factor * (q[leader] ?? 0) + shift;
    }
    return q;
  }

  /** Reduces rotations without limits and without mimics to half a turn either way. */
  unwound(q: Coordinates): Coordinates {
    for (const path of this.endless) q[path] -= 2 * Math.PI * Math.round(q[path] / (2 * Math.PI));
    return q;
  }
}
