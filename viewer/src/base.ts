// How a mode lets its root link move: in the plane of `at`, about its origin, or anywhere. As in documents: shifts along the axes of `at`,
// and the turn about its origin as a rotation vector, like that of a ball.

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Mode } from "./data";
import { matrixOf, rotationVector } from "./kinematics";

/** One way in which a base moves; `at` is its number among three shifts and three turns. */
export interface BaseCoordinate { path: string; turns: boolean; at: number }

const PATHS = ["base x", "base y", "base z", "base about x", "base about y", "base about z"];
const MOVING: Record<Mode["base"], number[]> = { fixed: [], held: [], planar: [0, 1, 5], ball: [3, 4, 5], free: [0, 1, 2, 3, 4, 5] };
/** How far [rad] it turns: beyond half a turn a rotation vector is one of the other side. */
const MOST = Math.PI - 1e-9;

export class BaseMotion {
  /** What can be set: nothing of a base that floats and goes along with what the mode holds. */
  readonly coordinates: BaseCoordinate[];
  private readonly moving: number[];
  private readonly at: Matrix4;
  private readonly back: Matrix4;

  /** `home` is where the mode puts its root link. */
  constructor(mode: Mode, private readonly home: Matrix4) {
    this.moving = MOVING[mode.base];
    this.at = matrixOf(mode.at);
    this.back = this.at.clone().invert();
    const carried = mode.base === "free" && mode.loops.some((loop) => loop.hold);
    this.coordinates = carried ? [] : this.moving.map((at) => ({ path: PATHS[at], turns: at > 2, at }));
  }

  /** Three shifts [m] and three parts of the turn [rad] by which a root link stands elsewhere than where the mode puts it. */
  read(base: Matrix4): number[] {
    const moved = this.back.clone().multiply(base).multiply(this.home.clone().invert()).multiply(this.at);
    const all = [moved.elements[12], moved.elements[13], moved.elements[14], ...rotationVector(moved)];
    return all.map((value, at) => (this.moving.includes(at) ? value : 0));
  }

  /** Where the root link stands by those six numbers. */
  placed(values: number[]): Matrix4 {
    if (values.every((value) => value === 0)) return this.home.clone();
    const turn = new Vector3(...values.slice(3)), angle = turn.length();
    const moved = angle > 0 ? new Matrix4().makeRotationAxis(turn.divideScalar(angle), Math.min(angle, MOST)) : new Matrix4();
    moved.setPosition(values[0], values[1], values[2]);
    return this.at.clone().multiply(moved).multiply(this.back).multiply(this.home);
  }

  /** The pose that the base can have next to one that somebody wants. */
  nearest(base: Matrix4): Matrix4 {
    return this.placed(this.read(base));
  }

  /** The base when a point of it is drawn from one place in the world to another, as far as it lets itself: shifted, or else turned. */
  drawn(base: Matrix4, from: Vector3, to: Vector3): Matrix4 {
    const [start, end] = [from, to].map((point) => point.clone().applyMatrix4(this.back));
    const moved = new Matrix4();
    if (this.moving.includes(0)) {
      const along = end.sub(start).toArray().map((value, at) => (this.moving.includes(at) ? value : 0));
      moved.setPosition(along[0], along[1], along[2]);
    } else moved.makeRotationFromQuaternion(new Quaternion().setFromUnitVectors(start.normalize(), end.normalize()));
    return this.nearest(this.at.clone().multiply(moved).multiply(this.back).multiply(base));
  }
}
