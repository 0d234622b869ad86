// The motion of the root link that a mode permits: in the plane of `at`, about its origin, or free. As in documents, the coordinates are
// translations along the axes of `at`, and a rotation vector about its origin.

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Mode } from "./data";
import { matrixOf, rotationVector } from "./kinematics";

/** A coordinate of a base; `at` is its index among three translations and three rotations. */
export interface BaseCoordinate { path: string; turns: boolean; at: number }

const PATHS = ["base x", "base y", "base z", "base about x", "base about y", "base about z"];
const MOVING: Record<Mode["base"], number[]> = { fixed: [], held: [], planar: [0, 1, 5], ball: [3, 4, 5], free: [0, 1, 2, 3, 4, 5] };
/** The largest angle [rad] of a rotation vector: beyond half a turn, the rotation is equal to one about the opposite axis. */
const MOST = Math.PI - 1e-9;

export class BaseMotion {
  /** The coordinates that can be set: none for a free base that follows held links. */
  readonly coordinates: BaseCoordinate[];
  private readonly moving: number[];
  private readonly at: Matrix4;
  private readonly back: Matrix4;

  /** `home` is the initial pose of the root link. */
  constructor(mode: Mode, private readonly home: Matrix4) {
    this.moving = MOVING[mode.base];
    this.at = matrixOf(mode.at);
    this.back = this.at.clone().invert();
    const carried = mode.base === "free" && mode.loops.some((loop) => loop.hold);
    this.coordinates = carried ? [] : this.moving.map((at) => ({ path: PATHS[at], turns: at > 2, at }));
  }

  /** The displacement of the root link from its initial pose: three translations [m] and a rotation vector [rad]. */
  read(base: Matrix4): number[] {
    const moved = this.back.clone().multiply(base).multiply(this.home.clone().invert()).multiply(this.at);
    const all = [moved.elements[12], moved.elements[13], moved.elements[14], ...rotationVector(moved)];
    return all.map((value, at) => (this.moving.includes(at) ? value : 0));
  }

  /** The pose of the root link for these six numbers. */
  placed(values: number[]): Matrix4 {
    if (values.every((value) => value === 0)) return this.home.clone();
    const turn = new Vector3(...values.slice(3)), angle = turn.length();
    const moved = angle > 0 ? new Matrix4().makeRotationAxis(turn.divideScalar(angle), Math.min(angle, MOST)) : new Matrix4();
    moved.setPosition(values[0], values[1], values[2]);
    return this.at.clone().multiply(moved).multiply(this.back).multiply(this.home);
  }

  /** The nearest pose that the base can have. */
  nearest(base: Matrix4): Matrix4 {
    return this.placed(this.read(base));
  }

  /** The base pose after a point of it is dragged: the base translates if it can, otherwise it rotates. */
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
