// A configuration of a robot in one mode (coordinates and base pose), and changes of it that keep loops closed.

import { Matrix4, Quaternion, Vector3 } from "three";
import { BaseMotion } from "./base";
import type { Mode, NamedPose, Robot } from "./data";
import { type Coordinates, Couplings, matrixOf, rotationVector, Tree } from "./kinematics";
import { Solver } from "./solver";

/** The largest step of a coordinate [rad, or fraction of the robot's size] before loops are closed again. */
const STEP = 0.08;
/** The tolerance within which a configuration equals a pose [rad or m]. */
const SAME = 1e-9;

export class Configuration {
  readonly tree: Tree;
  readonly couplings: Couplings;
  readonly moves: BaseMotion;
  q: Coordinates;
  base: Matrix4;
  /** The named pose, until a coordinate changes. */
  pose: NamedPose | null = null;
  private readonly solver: Solver;

  /** Begins in the initial pose of the mode, else its first pose, else at 0; `size` [m] is the size of the robot. */
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

  /** Whether the mode has loops or holds. */
  get closes(): boolean {
    return this.solver.closes;
  }

  /** Whether all loops and holds are closed. */
  get closed(): boolean {
    return !this.closes || this.solver.closed({ q: this.q, base: this.base, open: this.solver.openness(this.q, this.base) });
  }

  take(pose: NamedPose): void {
    this.q = { ...pose.q };
    this.base = pose.base === null ? this.tree.home.clone() : matrixOf(pose.base);
    this.pose = pose;
  }

  /** Moves a coordinate, and those coupled to it, towards a value. Returns false if it stops because loops cannot be closed. */
  set(path: string, value: number): boolean {
    const { path: leader } = this.couplings.leader(path);
    const [low, high] = this.couplings.range(leader);
    const reached = this.approach({ [leader]: Math.min(high, Math.max(low, this.couplings.led(path, value))) });
    if (this.closes) this.couplings.unwound(this.q);
    return reached;
  }

  /** Moves the base along one of its coordinates. Returns false if it stops because holds cannot be closed. */
  setBase(at: number, value: number): boolean {
    const to = this.moves.read(this.base);
    to[at] = value;
    return this.stand(this.moves.placed(to));
  }

  /** Moves the base, in steps so small that loops stay in their branch of solutions. */
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

  /** Moves coordinates to values, in steps so small that loops stay in their branch of solutions. */
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

  /** Interpolates between two configurations at `part` (0 to 1). With loops, driven coordinates are interpolated and the others follow. */
  between(from: { q: Coordinates; base: Matrix4 }, to: { q: Coordinates; base: Matrix4 }, part: number): void {
    const at = (path: string): number => from.q[path] + part * (to.q[path] - from.q[path]);
    const base = this.moves.nearest(mixed(from.base, to.base, part));
    if (!this.closes) {
      this.q = this.couplings.settle(Object.fromEntries(Object.keys(to.q).map((path) => [path, at(path)])));
      this.base = base;
      this.pose = null;
      return;
    }
    const moved = new Set(this.mode.bodies.flatMap((body) => body.joints.map((joint) => joint.path)));
    const drives = [...new Set(this.mode.driven.map((path) => this.couplings.leader(path).path))].filter((path) => moved.has(path));
    const before = { q: this.q, base: this.base };
    if (!this.mode.loops.some((loop) => loop.hold)) this.base = base;
    if (drives.length > 0 && this.approach(Object.fromEntries(drives.map((path) => [path, at(path)])))) return;
    // if the loops leave the drives no freedom: the closed configuration nearest to the interpolated one
    ({ q: this.q, base: this.base } = { q: Object.fromEntries(Object.keys(to.q).map((path) => [path, at(path)])), base });
    if (!this.close(new Set(), 8)) ({ q: this.q, base: this.base } = before);
  }

  /** Moves a point of a link (in its frame) as near to a target in the world as joints and loops permit. */
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

  /** Sets coordinates by path, and the base. Unknown paths and values that are not finite are ignored. */
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

  /** Whether the base is at its initial pose. */
  get atHome(): boolean {
    return this.base.equals(this.tree.home);
  }

  /** The reason why a link cannot be dragged; null if it can. */
  whyFixed(link: number): string | null {
    const name = this.robot.links[link].name;
    const body = this.tree.bodyOf.get(link)!;
    const { base, loops, name: mode } = this.mode;
    if (loops.some((loop) => loop.hold && loop.child === body)) return `${name} is held in mode ${mode} and cannot move`;
    if (body === 0 && this.moves.coordinates.length > 0) return null;
    if (body === 0 && base === "free") return `${name} follows the held links of mode ${mode}: drag another link`;
    if (body === 0) return `${name} is the root of mode ${mode} (base ${base}) and cannot move: select another mode`;
    const moves = this.tree.above(body).some((index) => this.tree.bodies[index].joints.length > 0);
    return moves || this.closes ? null : `No joint moves ${name} in mode ${mode}`;
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
