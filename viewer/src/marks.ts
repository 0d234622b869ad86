// Marks drawn over a robot: frames, axes, mounts, centres of mass, ellipsoids, rings. One draw call for each shape of mark.

import {
  BufferGeometry, Color, ConeGeometry, CylinderGeometry, DoubleSide, InstancedMesh, type Material, Matrix4, MeshBasicMaterial, MeshStandardMaterial,
  Quaternion, RingGeometry, SphereGeometry, Vector3,
} from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import type { Stage } from "./scene";

const UP = new Vector3(0, 0, 1);

/** An arrow of length 1 from the origin along z. */
export function arrowGeometry(): BufferGeometry {
  const shaft = new CylinderGeometry(0.022, 0.022, 0.8, 10).translate(0, 0.4, 0);
  const head = new ConeGeometry(0.065, 0.2, 16).translate(0, 0.9, 0);
  return mergeGeometries([shaft, head]).rotateX(Math.PI / 2);
}

/** The material of marks that are drawn over the robot. */
export function overlayMaterial(): MeshBasicMaterial {
  return new MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.95, toneMapped: false, side: DoubleSide });
}

/** Any number of marks of one shape. */
class Many {
  private mesh: InstancedMesh;
  private count = 0;

  constructor(private readonly stage: Stage, private readonly geometry: BufferGeometry, private readonly material: Material) {
    this.mesh = this.made(64);
  }

  private made(capacity: number): InstancedMesh {
    const mesh = new InstancedMesh(this.geometry, this.material, capacity);
    mesh.frustumCulled = false;
    mesh.renderOrder = 2;
    this.stage.world.add(mesh);
    return mesh;
  }

  begin(): void {
    this.count = 0;
  }

  add(matrix: Matrix4, color: Color): void {
    if (this.count === this.mesh.instanceMatrix.count) {
      const fuller = this.made(2 * this.count), kept = new Matrix4(), tint = new Color();
      for (let k = 0; k < this.count; k += 1) {
        this.mesh.getMatrixAt(k, kept);
        fuller.setMatrixAt(k, kept);
        this.mesh.getColorAt(k, tint);
        fuller.setColorAt(k, tint);
      }
      this.stage.world.remove(this.mesh);
      this.mesh.dispose();
      this.mesh = fuller;
    }
    this.mesh.setMatrixAt(this.count, matrix);
    this.mesh.setColorAt(this.count, color);
    this.count += 1;
  }

  end(): void {
    this.mesh.count = this.count;
    this.mesh.visible = this.count > 0;
    this.mesh.instanceMatrix.needsUpdate = true;
    if (this.mesh.instanceColor) this.mesh.instanceColor.needsUpdate = true;
  }
}

export const AXES = [new Color("#e5484d"), new Color("#30a46c"), new Color("#3e63dd")];

/** The marks of a frame: call `begin`, add marks, call `end`. */
export class Marks {
  private readonly arrows: Many;
  private readonly balls: Many;
  private readonly ellipsoids: Many;
  private readonly rings: Many;
  private readonly lines: Many;

  constructor(stage: Stage) {
    const over = overlayMaterial();
    this.arrows = new Many(stage, arrowGeometry(), over);
    this.lines = new Many(stage, new CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0).rotateX(Math.PI / 2), over);
    this.balls = new Many(stage, new SphereGeometry(1, 20, 14), over);
    this.rings = new Many(stage, new RingGeometry(0.82, 1, 48), over);
    this.ellipsoids = new Many(
      stage, new SphereGeometry(1, 28, 18), new MeshStandardMaterial({ transparent: true, opacity: 0.32, depthWrite: false, roughness: 0.9 }),
    );
  }

  private get all(): Many[] {
    return [this.arrows, this.balls, this.ellipsoids, this.rings, this.lines];
  }

  begin(): void {
    for (const many of this.all) many.begin();
  }

  end(): void {
    for (const many of this.all) many.end();
  }

  /** From a point along a direction. */
  arrow(from: Vector3, along: Vector3, length: number, color: Color): void {
    const turn = new Quaternion().setFromUnitVectors(UP, along.clone().normalize());
    this.arrows.add(new Matrix4().compose(from, turn, new Vector3(length, length, length)), color);
  }

  /** A line between two points, with a radius. */
  line(from: Vector3, to: Vector3, radius: number, color: Color): void {
    const along = to.clone().sub(from), length = along.length();
    if (length === 0) return;
    const turn = new Quaternion().setFromUnitVectors(UP, along.divideScalar(length));
    this.lines.add(new Matrix4().compose(from, turn, new Vector3(radius, radius, length)), color);
  }

  /** The axes of a frame, x red, y green, z blue. */
  frame(pose: Matrix4, length: number): void {
    const origin = new Vector3().setFromMatrixPosition(pose);
    AXES.forEach((color, k) => this.arrow(origin, new Vector3().setFromMatrixColumn(pose, k), length, color));
  }

  ball(at: Vector3, radius: number, color: Color): void {
    this.balls.add(new Matrix4().makeScale(radius, radius, radius).setPosition(at), color);
  }

  ellipsoid(pose: Matrix4, radii: Vector3, color: Color): void {
    this.ellipsoids.add(pose.clone().scale(radii), color);
  }

  /** A ring around the z axis of a frame. */
  ring(pose: Matrix4, radius: number, color: Color): void {
    this.rings.add(pose.clone().scale(new Vector3(radius, radius, radius)), color);
  }
}
