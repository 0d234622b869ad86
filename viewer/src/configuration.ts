// A robot in one mode at one configuration: coordinates and base, and the ways to change them that keep loops closed.

import { Matrix4, Quaternion, Vector3 } from "three";
import { BaseMotion } from "./base";
import type { Mode, NamedPose, Robot } from "./data";
import { type Coordinates, Couplings, matrixOf, rotationVector, Tree } from "./kinematics";
import { Solver } from "./solver";

/** How far a coordinate goes at most [rad, and part of the robot's size] before loops are closed again. */
const STEP = 0.08;
/** Configurations are those of a pose to here [rad or m]. */
const SAME = 1e-9;

export class Configuration {
  readonly tree: Tree;
  readonly couplings: Couplings;
  readonly moves: BaseMotion;
  q: Coordinates;
  base: Matrix4;
  /** The pose that it is, as long as nothing has been moved. */
  pose: NamedPose | null = null;
  private readonly solver: Solver;

  /** Where the mode starts, else its first pose, else at 0; `size` [m] is that of the robot. */
  constructor(private readonly robot: Robot, readonly mode: Mode, private readonly size: number) {
    this.tree = new Tree(mode);
    this.couplings = new Couplings(robot);
    this.moves = new BaseMotion(mode, this.tree.home);
    this.solver = new Solver(robot, this.tree, this.couplings, size);
    this.base = this.tree.home.clone();
    this.q = this.couplings.settle(Object.fromEntries(robot.joints.map((joint) => [joint.path, 0])));
    const start = mode.poses.find((pose) => pose.name === mode.start) ?? (this.closes ? mode.poses[0] : undefined);
    if (start !== undefined) this.take(start);
    else if (this.closes) this.close(new Set());
  }

  /** Whether there are loops, or holds, to keep closed. */
  get closes(): boolean {
    return this.solver.closes;
  }

  /** Whether they are. */
  get closed(): boolean {
    return !this.closes || this.solver.closed({ q: this.q, base: this.base, open: this.solver.openness(this.q, this.base) });
  }

  take(pose: NamedPose): void {
    this.q = { ...pose.q };
    this.base = pose.base === null ? this.tree.home.clone() : matrixOf(pose.base);
    this.pose = pose;
  }

  /** Moves a coordinate, and what has to go with it, towards a value. Whether it got there: it stops where loops would not close. */
  set(path: string, value: number): boolean {
    const { path: leader } = this.couplings.leader(path);
    const [low, high] = this.couplings.range(leader);
    const reached = this.approach({ [leader]: Math.min(high, Math.max(low, this.couplings.led(path, value))) });
    if (this.closes) this.couplings.unwound(this.q);
    return reached;
  }

  /** Moves the base by one of its coordinates. Whether it got there: it stops where what the mode holds would not stay. */
  setBase(at: number, value: number): boolean {
    const to = this.moves.read(this.base);
    to[at] = value;
    return this.stand(this.moves.placed(to));
  }

  /** Puts the base elsewhere, in steps so small that loops stay in the branch that they are in; what does not hang on the world goes along. */
  private stand(base: Matrix4): boolean {
    this.pose = null;
    const from = this.base, held = this.mode.loops.some((loop) => loop.hold);
    const away = new Vector3().setFromMatrixPosition(from).distanceTo(new Vector3().setFromMatrixPosition(base)) / this.size;
    const count = held ? Math.max(1, Math.ceil(Math.max(away, angleBetween(from, base)) / STEP)) : 1;
    for (let k = 1; k <= count; k += 1) {
      const before = { q: this.q, base: this.base };
      this.base = k === count ? base : this.moves.nearest(mixed(from, base, k / count));
      if (held && !this.close(new Set())) {
        ({ q: this.q, base: this.base } = before);
        return false;
      }
    }
    return true;
  }

  /** Leads some coordinates to values, in steps so small that loops stay in the branch that they are in. */
  private approach(targets: Coordinates): boolean {
    this.pose = null;
    const fixed = new Set(Object.keys(targets));
    const from = { ...this.q };
    const turns = (path: string): boolean => this.robot.joints.find((joint) => joint.path === path)!.turns;
    const away = Object.entries(targets).map(([path, value]) => Math.abs(value - from[path]) / (turns(path) ? 1 : this.size));
    const count = this.closes ? Math.max(1, Math.ceil(Math.max(...away) / STEP)) : 1;
    for (let k = 1; k <= count; k += 1) {
      const before = this.q;
      this.q = { ...this.q };
      for (const [path, value] of Object.entries(targets)) this.q[path] = from[path] + ((value - from[path]) * k) / count;
      this.couplings.settle(this.q);
      if (this.closes && !this.close(fixed)) {
        this.q = before;
        return false;
      }
    }
    return true;
  }

  private close(fixed: ReadonlySet<string>, rounds = 40): boolean {
    const answer = this.solver.solve(this.q, this.base, fixed, null, rounds);
    if (!this.solver.closed(answer)) return false;
    this.q = answer.q;
    this.base = answer.base;
    return true;
  }

  /** On the way from one configuration to another, a part (0 to 1) of it behind: drives lead, and loops follow. */
  between(from: { q: Coordinates; base: Matrix4 }, to: { q: Coordinates; base: Matrix4 }, part: number): void {
    const at = (path: string): number => from.q[path] + part * (to.q[path] - from.q[path]);
    const base = this.moves.nearest(mixed(from.base, to.base, part));
    if (!this.closes) {
      this.q = Object.fromEntries(Object.keys(to.q).map((path) => [path, at(path)]));
      this.base = base;
      this.pose = null;
      return;
    }
    const moved = new Set(this.mode.bodies.flatMap((body) => body.joints.map((joint) => joint.path)));
    const drives = [...new Set(this.mode.driven.map((path) => this.couplings.leader(path).path))].filter((path) => moved.has(path));
    const before = { q: this.q, base: this.base };
    if (!this.mode.loops.some((loop) => loop.hold)) this.base = base;
    if (drives.length > 0 && this.approach(Object.fromEntries(drives.map((path) => [path, at(path)])))) return;
    // drives that loops leave no freedom: as near to all coordinates as they close
    ({ q: this.q, base: this.base } = { q: Object.fromEntries(Object.keys(to.q).map((path) => [path, at(path)])), base });
    if (!this.close(new Set(), 8)) ({ q: this.q, base: this.base } = before);
  }

  /** Draws a point of a link (in its frame) towards a target in the world, as near as joints and loops let it. */
  pull(body: number, grip: Vector3, target: Vector3): void {
    this.pose = null;
    if (body === 0) {
      this.stand(this.moves.drawn(this.base, grip.clone().applyMatrix4(this.base), target));
      return;
    }
    const before = { q: this.q, base: this.base };
    const answer = this.solver.solve(this.q, this.base, new Set(), { body, point: grip, target }, 12);
    [this.q, this.base] = [answer.q, answer.base];
    if (this.closes && !this.close(new Set())) ({ q: this.q, base: this.base } = before);
  }

  /** Coordinates by path, and a base, as somebody has noted them; what is not there, or no number, is left out. */
  restore(values: Coordinates, base: Matrix4 | null): void {
    for (const [path, value] of Object.entries(values)) if (Object.hasOwn(this.q, path) && Number.isFinite(value)) this.q[path] = value;
    this.couplings.settle(this.q);
    if (base !== null) this.base = this.moves.nearest(base);
    this.pose = null;
    if (!this.closed) this.close(new Set());
    const there = (pose: NamedPose): boolean =>
      Object.entries(pose.q).every(([path, value]) => Math.abs(value - this.q[path]) < SAME)
      && (pose.base === null ? this.tree.home : matrixOf(pose.base)).elements.every((value, k) => Math.abs(value - this.base.elements[k]) < SAME);
    const same = this.mode.poses.find(there);
    if (same !== undefined) this.take(same);
  }

  /** Whether the base is where the mode puts it. */
  get atHome(): boolean {
    return this.base.equals(this.tree.home);
  }

  /** Why a link cannot be drawn elsewhere, in words; null where it can. */
  kept(link: number): string | null {
    const name = this.robot.links[link].name;
    const body = this.tree.bodyOf.get(link)!;
    const { base, loops, name: mode } = this.mode;
    if (loops.some((loop) => loop.hold && loop.child === body)) return `${name} is held in mode ${mode}: it stays where it is`;
    if (body === 0 && this.moves.coordinates.length > 0) return null;
    if (body === 0 && base === "free") return `${name} moves with what mode ${mode} holds: draw another link`;
    if (body === 0) return `the robot stands on ${name} in mode ${mode} (base ${base}): choose another mode to move it`;
    const moves = this.tree.above(body).some((index) => this.tree.bodies[index].joints.length > 0);
    return moves || this.closes ? null : `no joint moves ${name} in mode ${mode}`;
  }
}

function angleBetween(from: Matrix4, to: Matrix4): number {
  return Math.hypot(...rotationVector(from.clone().invert().multiply(to)));
}

function mixed(from: Matrix4, to: Matrix4, part: number): Matrix4 {
  const [p, r, s, p2, r2] = [new Vector3(), new Quaternion(), new Vector3(), new Vector3(), new Quaternion()];
  from.decompose(p, r, s);
  to.decompose(p2, r2, s);
  return new Matrix4().compose(p.lerp(p2, part), r.slerp(r2, part), new Vector3(1, 1, 1));
}
