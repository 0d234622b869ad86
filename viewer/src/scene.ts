// The three.js scene of a robot. Every mesh is one InstancedMesh for all its occurrences, in the frame of the world.

import {
  AmbientLight, BoxGeometry, BufferAttribute, type BufferGeometry, Box3, CapsuleGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide, EdgesGeometry, FrontSide,
  GridHelper, Group, HemisphereLight, InstancedMesh, LineBasicMaterial, LineSegments, type Material, Matrix4, Mesh, MeshStandardMaterial, type Object3D, PerspectiveCamera,
  Plane, PlaneGeometry, Quaternion, Raycaster, Scene, SphereGeometry, SRGBColorSpace, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import type { Mode, Robot, Shape } from "./data";
import { matrixOf } from "./kinematics";
import { arrowGeometry, overlayMaterial } from "./marks";
import { CUT, Section } from "./section";

/** The smallest angle between faces [rad] that is drawn as an edge. */
const CREASE = 0.55;
/** The 16-bit number that represents the position 1 in a packed mesh. */
const MOST = 32767;
/** The size of the view relative to the box around the robot. */
const MARGIN = 1.1;
/** The colour of parts without a colour. */
export const PLAIN = "#bfc4c9";
export const CHOSEN = new Color("#ff8a1f");
const DOWN = new Vector3(0, 0, -1);
/** The position of the gravity arrow in the view, and its length [px]. */
const ARROW = { x: 20, y: 14, length: 52 };

interface Instance { occurrence: number; pose: Matrix4; color: Color | null }

/** Instances of one geometry, visual or collision. */
interface Batch { mesh: InstancedMesh; instances: Instance[]; collides: boolean }

export interface Hit { occurrence: number; point: Vector3 }

/** The occurrences that are not drawn, and those that are drawn transparent. */
export interface Visibility { hidden: ReadonlySet<number>; transparent: ReadonlySet<number> }

const ALL_VISIBLE: Visibility = { hidden: new Set(), transparent: new Set() };
/** The opacity of transparent occurrences. */
const TRANSPARENT = 0.25;

const edgesOf = new WeakMap<BufferGeometry, EdgesGeometry>();
const known = new Map<string, BufferGeometry>();

/** Decodes base64. */
export function bytesOf(base64: string): ArrayBuffer {
  const packed = atob(base64);
  const bytes = new Uint8Array(packed.length);
  for (let k = 0; k < bytes.length; k += 1) bytes[k] = packed.charCodeAt(k);
  return bytes.buffer;
}

/** Geometries by their number in the data; those of earlier builds are reused. */
export async function geometriesOf(glb: ArrayBuffer): Promise<BufferGeometry[]> {
  const loaded = await new GLTFLoader().parseAsync(glb, "");
  const nodes = loaded.parser.json.nodes as { mesh: number }[] | undefined;
  const names = loaded.parser.json.meshes as { name: string }[] | undefined;
  const found: BufferGeometry[] = [];
  for (const child of (loaded.scene?.children ?? []) as Mesh[]) { // a file without meshes has no scene
    const number = loaded.parser.associations.get(child)!.nodes!;
    const name = names![nodes![number].mesh].name;
    if (!known.has(name)) known.set(name, unpacked(child));
    found[number] = known.get(name)!;
  }
  return found;
}

/**
 * The geometry of a mesh with 16-bit positions, scaled by its node, with normals.
 *
 * `toCreasedNormals` considers vertices as equal if their coordinates differ by less than 0.01. Therefore, it gets the 16-bit numbers: in
 * metres, all vertices within 10 mm would share their faces.
 */
function unpacked(mesh: Mesh): BufferGeometry {
  const packed = mesh.geometry.getAttribute("position");
  const point = new Vector3();
  const numbers = new Float32Array(packed.count * 3);
  for (let k = 0; k < packed.count; k += 1) point.fromBufferAttribute(packed, k).multiplyScalar(MOST).round().toArray(numbers, 3 * k);
  const geometry = mesh.geometry.clone().setAttribute("position", new BufferAttribute(numbers, 3));
  mesh.updateMatrix();
  return toCreasedNormals(geometry, CREASE).applyMatrix4(mesh.matrix.multiply(new Matrix4().makeScale(1 / MOST, 1 / MOST, 1 / MOST)));
}

/** The 3D view: camera, lights, floor, gravity arrow, and the batches of a robot. */
export class Stage {
  readonly renderer: WebGLRenderer;
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(35, 1, 0.001, 100);
  readonly controls: OrbitControls;
  /** The world of the robot, rotated so that gravity points down. */
  readonly world = new Group();
  /** An arrow at a fixed place in the view that points down. */
  readonly gravity = new Mesh(arrowGeometry(), overlayMaterial());
  /** The size of the robot [m]: the radius of a sphere around it. */
  size = 0.2;
  private batches: Batch[] = [];
  private ghosts: Batch[] = [];
  private floor: GridHelper | null = null;
  private readonly plane = new Plane(new Vector3(-1, 0, 0), 0);
  private readonly section: Section;
  private cuts = false;
  private readonly raycaster = new Raycaster();
  private asked = false;
  private around: Box3 | null = null;
  private frames: Matrix4[] = [];
  private edges: LineSegments[] = [];
  /** The box around the robot when the camera was last fitted to it. */
  framed = new Box3();
  /** Called before each frame. */
  prepare: () => void = () => {};
  /** The script time of the last frame [ms]. */
  spent = 0;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.localClippingEnabled = true;
    this.renderer.info.autoReset = false;
    this.section = new Section(this.renderer, this.plane);
    this.scene.add(this.section.face);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.ask());
    const sky = new HemisphereLight("#ffffff", "#8d949c", 1.5);
    sky.position.set(0, 0, 1);
    this.gravity.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), DOWN);
    this.gravity.renderOrder = 3;
    this.scene.add(this.world, this.gravity, sky, new AmbientLight("#ffffff", 0.35));
    for (const [x, y, z, bright] of [[1, -1.2, 2, 1.9], [-2, 0.6, 0.8, 0.7]]) {
      const light = new DirectionalLight("#ffffff", bright);
      light.position.set(x, y, z);
      this.scene.add(light);
    }
  }

  /** Requests a frame. */
  ask(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      const began = performance.now();
      this.prepare();
      this.draw();
      this.spent = performance.now() - began;
    });
  }

  draw(): void {
    this.renderer.info.reset();
    this.section.face.visible = false;
    this.placeGravity();
    if (this.cuts) this.section.prepare(this.scene, this.camera, this.world.localToWorld(this.framed.getCenter(new Vector3())), this.size);
    this.renderer.render(this.scene, this.camera);
  }

  /** Keeps the gravity arrow in its place, at its size. */
  private placeGravity(): void {
    const { camera, gravity, canvas: { clientWidth: width, clientHeight: height } } = this;
    camera.updateMatrixWorld();
    gravity.position.set((2 * ARROW.x) / width - 1, 1 - (2 * ARROW.y) / height, 0.5).unproject(camera);
    const depth = -gravity.position.clone().applyMatrix4(camera.matrixWorldInverse).z;
    const length = (ARROW.length * 2 * depth * Math.tan((camera.fov * Math.PI) / 360)) / height;
    gravity.scale.set(2 * length, 2 * length, length);
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    const ratio = Math.min(window.devicePixelRatio, 2);
    if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.ask();
  }

  /** Rotates the world so that gravity points down in the view. */
  face(gravity: number[]): void {
    const pull = new Vector3(...(gravity as [number, number, number]));
    this.gravity.visible = pull.length() > 0;
    this.world.quaternion.copy(pull.length() > 0 ? new Quaternion().setFromUnitVectors(pull.normalize(), DOWN) : new Quaternion());
    this.world.updateMatrixWorld(true);
  }

  /** Replaces the meshes in the world by those of a robot in a mode. */
  furnish(robot: Robot, geometries: BufferGeometry[], visibility: Visibility, mode: Mode): void {
    for (const batch of this.batches) discard(this.world, batch);
    this.batches = batchesOf(robot, geometries, this.plane, visibility, mode.collision);
    for (const { mesh } of this.batches) this.world.add(mesh);
    this.around = null;
    this.clip(null, 0, false);
  }

  /** Adds a second, transparent robot to the world; null removes it. */
  overlay(robot: Robot | null, geometries: BufferGeometry[]): void {
    for (const batch of this.ghosts) discard(this.world, batch);
    this.ghosts = robot === null ? [] : batchesOf(robot, geometries, this.plane, ALL_VISIBLE).filter(({ collides }) => !collides);
    for (const { mesh } of this.ghosts) {
      Object.assign(mesh.material as MeshStandardMaterial, { transparent: true, opacity: 0.45, depthWrite: false });
      mesh.renderOrder = 1;
      this.world.add(mesh);
    }
  }

  /** The draw calls of the last frame; a section draws its meshes a second time. */
  get calls(): number {
    return this.renderer.info.render.calls;
  }

  show(seen: boolean, felt: boolean): void {
    for (const { mesh, collides } of this.batches) {
      mesh.visible = collides ? felt : seen;
      mesh.layers[!collides || !seen ? "enable" : "disable"](CUT);
      const both = seen && felt;
      if (collides) (mesh.material as MeshStandardMaterial).opacity = both ? 0.35 : 0.8;
    }
  }

  /** Sets pose and colour of every occurrence; with `look`, shapes keep their own colours. `frames` are the poses of the links, for the
   * bounds of a robot without geometry. */
  arrange(poses: Matrix4[], colors: Color[], frames: Matrix4[], look: boolean): void {
    this.around = null;
    this.frames = frames;
    for (const batch of this.batches) put(batch, poses, colors, look);
  }

  /** The same for the transparent robot. */
  arrangeOverlay(poses: Matrix4[], color: Color): void {
    for (const batch of this.ghosts) put(batch, poses, poses.map(() => color), false);
  }

  /** The box around the robot, in its world. */
  bounds(): Box3 {
    return (this.around ??= this.measured()).clone();
  }

  private measured(): Box3 {
    const box = new Box3(), own = new Box3(), matrix = new Matrix4();
    for (const seen of [true, false]) {
      for (const { mesh, instances, collides } of this.batches) {
        if (collides === seen) continue;
        mesh.geometry.boundingBox ?? mesh.geometry.computeBoundingBox();
        instances.forEach((_, index) => {
          mesh.getMatrixAt(index, matrix);
          box.union(own.copy(mesh.geometry.boundingBox!).applyMatrix4(matrix));
        });
      }
      if (!box.isEmpty()) return box;
    }
    for (const frame of this.frames) box.expandByPoint(new Vector3().setFromMatrixPosition(frame));
    return box.expandByScalar(Math.max(0.2 * box.getSize(new Vector3()).length(), 0.02));
  }

  /** Draws the edges of some occurrences. */
  edge(occurrences: number[], poses: Matrix4[]): void {
    for (const line of this.edges) {
      this.world.remove(line);
      (line.material as Material).dispose();
    }
    this.edges = [];
    for (const { mesh, instances, collides } of this.batches) {
      if (collides || !mesh.visible) continue;
      for (const { occurrence } of instances) {
        if (!occurrences.includes(occurrence)) continue;
        if (!edgesOf.has(mesh.geometry)) edgesOf.set(mesh.geometry, new EdgesGeometry(mesh.geometry, 25));
        const line = new LineSegments(edgesOf.get(mesh.geometry), new LineBasicMaterial({ color: CHOSEN, clippingPlanes: (mesh.material as Material).clippingPlanes }));
        line.matrixAutoUpdate = false;
        line.matrix.copy(poses[occurrence]);
        line.renderOrder = 1;
        this.edges.push(line);
        this.world.add(line);
      }
    }
  }

  /** Fits the camera to the box around the robot, seen from a direction. */
  frame(from: [number, number, number] = [0.62, -0.72, 0.42]): void {
    const box = (this.framed = this.bounds());
    this.size = box.getSize(new Vector3()).length() / 2;
    const { camera, controls: { target } } = this;
    target.copy(this.world.localToWorld(box.getCenter(new Vector3())));
    const toward = new Vector3(...from).normalize();
    const right = new Vector3().crossVectors(camera.up, toward).normalize(), up = new Vector3().crossVectors(toward, right);
    const high = Math.tan((camera.fov * Math.PI) / 360) / MARGIN, wide = high * camera.aspect;
    const away = this.corners(box).map((corner) => corner.sub(target))
      .map((corner) => corner.dot(toward) + Math.max(Math.abs(corner.dot(right)) / wide, Math.abs(corner.dot(up)) / high));
    camera.position.copy(target).addScaledVector(toward, Math.max(...away));
    this.reach();
    this.controls.update();
  }

  /** The corners in the scene of a box in the world of the robot. */
  private corners(box: Box3): Vector3[] {
    return [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
      const [x, y, z] = [corner & 1, corner & 2, corner & 4].map((far, axis) => (far ? box.max : box.min).getComponent(axis));
      return this.world.localToWorld(new Vector3(x, y, z));
    });
  }

  /** The direction from the target to the camera. */
  from(): [number, number, number] {
    return this.camera.position.clone().sub(this.controls.target).toArray();
  }

  /** Whether the whole of a box in the world of the robot is in the view. */
  shows(box: Box3): boolean {
    this.camera.updateMatrixWorld();
    return this.corners(box).every((corner) => {
      const spot = corner.project(this.camera);
      return Math.max(Math.abs(spot.x), Math.abs(spot.y)) < 1 && spot.z < 1;
    });
  }

  /** Moves the camera and its target along a vector in the world of the robot. */
  shift(way: Vector3): void {
    const moved = way.clone().applyQuaternion(this.world.quaternion);
    this.camera.position.add(moved);
    this.controls.target.add(moved);
    this.controls.update();
    this.ask();
  }

  /** Mirrors the camera to the side of the floor (also a wall or ceiling) on which the robot is. */
  comeOut(): void {
    const up = new Vector3(0, 0, this.framed.getCenter(new Vector3()).z < 0 ? -1 : 1).applyQuaternion(this.world.quaternion);
    const away = this.camera.position.clone().sub(this.controls.target), height = away.dot(up);
    if (height >= 0) return;
    this.camera.position.copy(this.controls.target).add(away.addScaledVector(up, -2 * height));
    this.controls.update();
  }

  /** Moves the camera so that the box around the robot takes the place of the box `before`. */
  follow(before: Box3): void {
    const now = (this.framed = this.bounds());
    const [from, to] = [before, now].map((box) => this.world.localToWorld(box.getCenter(new Vector3())));
    const scale = now.getSize(new Vector3()).length() / before.getSize(new Vector3()).length();
    const { camera: { position }, controls: { target } } = this;
    for (const point of [position, target]) point.sub(from).multiplyScalar(scale).add(to);
    this.controls.update();
    this.ask();
  }

  /** Adapts the near and far planes to the camera distance. */
  reach(): void {
    const away = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(away / 500, 1e-4);
    this.camera.far = away + 60 * this.size;
    this.camera.updateProjectionMatrix();
  }

  /** Draws a grid on the plane z = 0 of the world, which is the floor of the models. */
  lay(color: string, shown: boolean): void {
    const key = `${color} ${this.size}`;
    if (this.floor !== null) this.floor.visible = shown;
    if (this.floor?.name === key) return;
    if (this.floor !== null) {
      this.world.remove(this.floor);
      this.floor.dispose();
    }
    const cell = 10 ** Math.floor(Math.log10(Math.max(this.size, 1e-3)));
    const count = 2 * Math.ceil((3 * this.size) / cell);
    this.floor = new GridHelper(count * cell, count, color, color);
    this.floor.name = key;
    this.floor.rotation.x = Math.PI / 2;
    (this.floor.material as Material).transparent = true;
    (this.floor.material as Material).opacity = 0.55;
    this.floor.visible = shown;
    this.world.add(this.floor);
  }

  /** Cuts the robot at a plane normal to an axis of the world, at a fraction (0 to 1) of its extent; `flip` cuts away the other side. With
   * null, nothing is cut. */
  clip(axis: number | null, part: number, flip: boolean): void {
    const box = this.framed;
    const normal = new Vector3(), side = flip ? 1 : -1;
    if (axis !== null) normal.setComponent(axis, side);
    const at = axis === null ? 1 : box.min.getComponent(axis) + part * (box.max.getComponent(axis) - box.min.getComponent(axis));
    this.cuts = axis !== null;
    this.plane.set(normal, axis === null ? at : -side * at);
    if (axis !== null) this.plane.applyMatrix4(this.world.matrixWorld);
    for (const { mesh } of this.batches) {
      const own = mesh.material as MeshStandardMaterial;
      const side = axis === null ? FrontSide : DoubleSide;
      if (own.side === side && own.clippingPlanes!.length === (axis === null ? 0 : 1)) continue;
      own.clippingPlanes = axis === null ? [] : [this.plane];
      own.side = side;
      own.needsUpdate = true;
    }
  }

  /** Whether the camera is beyond the centre of the robot along an axis of its world. */
  beyond(axis: number): boolean {
    return this.world.worldToLocal(this.camera.position.clone()).getComponent(axis) > this.framed.getCenter(new Vector3()).getComponent(axis);
  }

  private ray(x: number, y: number): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.raycaster.setFromCamera(new Vector2(((x - left) / width) * 2 - 1, 1 - ((y - top) / height) * 2), this.camera);
  }

  /** The occurrence under a point of the window, and the point in the world of the robot. */
  hit(x: number, y: number): Hit | null {
    this.ray(x, y);
    const shown: Object3D[] = this.batches.filter(({ mesh }) => mesh.visible).map(({ mesh }) => mesh);
    for (const found of this.raycaster.intersectObjects(shown, false)) {
      if (this.cutAway(found.object as InstancedMesh, found.point)) continue;
      const batch = this.batches.find(({ mesh }) => mesh === found.object);
      if (batch !== undefined && found.instanceId !== undefined) {
        return { occurrence: batch.instances[found.instanceId].occurrence, point: this.world.worldToLocal(found.point.clone()) };
      }
    }
    return null;
  }

  private cutAway(mesh: InstancedMesh, point: Vector3): boolean {
    const planes = (mesh.material as MeshStandardMaterial).clippingPlanes ?? [];
    return planes.some((plane) => plane.distanceToPoint(point) < 0);
  }

  /** The intersection, in the world of the robot, of the ray through a point of the window with the plane through `point` facing the camera. */
  drawn(x: number, y: number, point: Vector3): Vector3 | null {
    this.ray(x, y);
    const facing = this.camera.getWorldDirection(new Vector3());
    const plane = new Plane().setFromNormalAndCoplanarPoint(facing, this.world.localToWorld(point.clone()));
    const met = this.raycaster.ray.intersectPlane(plane, new Vector3());
    return met === null ? null : this.world.worldToLocal(met);
  }

  /** The rows [px] of the view between which a box in the world of the robot, and other rows, are. */
  rows(box: Box3, others: number[]): [number, number] {
    this.camera.updateMatrixWorld();
    const rows = this.corners(box).map((corner) => ((1 - corner.project(this.camera).y) / 2) * this.canvas.clientHeight).concat(others);
    return [Math.min(...rows), Math.max(...rows)];
  }

  /** The positions in the view [px] of points of the world of the robot; null behind the camera. */
  project(points: Vector3[]): ({ x: number; y: number } | null)[] {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.camera.updateMatrixWorld();
    return points.map((point) => {
      const seen = this.world.localToWorld(point.clone()).project(this.camera);
      return seen.z > 1 ? null : { x: ((seen.x + 1) / 2) * width, y: ((1 - seen.y) / 2) * height };
    });
  }
}

/** One batch per shape and transparency, with all occurrences at the origin. */
function batchesOf(
  robot: Robot, geometries: BufferGeometry[], section: Plane, { hidden, transparent }: Visibility, replaced: Mode["collision"] = {},
): Batch[] {
  const wanted = new Map<string, { geometry: BufferGeometry; collides: boolean; alpha: number; instances: Instance[] }>();
  const add = (key: string, geometry: () => BufferGeometry, collides: boolean, alpha: number, instance: Instance): void => {
    const batch = wanted.get(key);
    if (batch === undefined) wanted.set(key, { geometry: geometry(), collides, alpha, instances: [instance] });
    else batch.instances.push(instance);
  };
  robot.occurrences.forEach((occurrence, index) => {
    if (hidden.has(index)) return;
    for (const shape of occurrence.visual) {
      const opacity = shape.color !== null && shape.color.length === 9 ? parseInt(shape.color.slice(7), 16) / 255 : 1;
      const alpha = transparent.has(index) ? TRANSPARENT * opacity : opacity;
      const own = shape.color === occurrence.color ? null : new Color((shape.color ?? PLAIN).slice(0, 7));
      const [key, geometry, pose] = primitive(shape, geometries);
      add(`seen ${key} ${alpha}`, geometry, false, alpha, { occurrence: index, pose, color: own });
    }
    for (const shape of replaced[index] ?? occurrence.collision) {
      const [key, geometry, pose] = primitive(shape, geometries);
      add(`felt ${key}`, geometry, true, 0.45, { occurrence: index, pose, color: null });
    }
  });
  return [...wanted.values()].map(({ geometry, collides, alpha, instances }) => {
    const mesh = new InstancedMesh(geometry, material(alpha, collides, [section]), instances.length);
    mesh.frustumCulled = false;
    mesh.renderOrder = collides ? 1 : 0;
    instances.forEach((_, index) => mesh.setColorAt(index, CHOSEN));
    return { mesh, instances, collides };
  });
}

/** Half the drawn size of an infinite plane [m]. */
const ENDLESS = 5;

const placed = new Matrix4();

/** Sets the poses and colours of instances; with `look`, instances with a colour of their own keep it. */
function put({ mesh, instances }: Batch, poses: Matrix4[], colors: Color[], look: boolean): void {
  instances.forEach(({ occurrence, pose, color }, index) => {
    mesh.setMatrixAt(index, placed.multiplyMatrices(poses[occurrence], pose));
    mesh.setColorAt(index, (look ? color : null) ?? colors[occurrence]);
  });
  mesh.instanceMatrix.needsUpdate = true;
  mesh.instanceColor!.needsUpdate = true;
  mesh.boundingSphere = null; // recomputed for ray casts
  mesh.boundingBox = null;
}

function discard(world: Group, { mesh }: Batch): void {
  world.remove(mesh);
  mesh.dispose();
  (mesh.material as Material).dispose();
}

function material(alpha: number, collides: boolean, planes: Plane[]): MeshStandardMaterial {
  return new MeshStandardMaterial({
    roughness: 0.62, metalness: 0.05, transparent: collides || alpha < 1, opacity: alpha, depthWrite: !collides && alpha === 1,
    clippingPlanes: planes, flatShading: false, forceSinglePass: true,
  });
}

/** The key, geometry and pose of a shape; sizes are those of MuJoCo: half lengths, cylinders along z. */
function primitive(shape: Shape, geometries: BufferGeometry[]): [string, () => BufferGeometry, Matrix4] {
  if (shape.shape === "mesh") {
    return [`mesh ${shape.mesh}`, () => geometries[shape.mesh], shape.pose === null ? new Matrix4() : matrixOf(shape.pose)];
  }
  const pose = matrixOf(shape.pose);
  const [a, b, c] = shape.size;
  switch (shape.shape) {
    case "box":
      return ["box", () => new BoxGeometry(2, 2, 2), pose.scale(new Vector3(a, b, c))];
    case "sphere":
      return ["sphere", () => new SphereGeometry(1, 24, 16), pose.scale(new Vector3(a, a, a))];
    case "ellipsoid":
      return ["sphere", () => new SphereGeometry(1, 24, 16), pose.scale(new Vector3(a, b, c))];
    case "plane":
      return ["plane", () => new PlaneGeometry(2, 2), pose.scale(new Vector3(a || ENDLESS, b || ENDLESS, 1))];
    case "cylinder":
      return ["cylinder", () => new CylinderGeometry(1, 1, 2, 32).rotateX(Math.PI / 2), pose.scale(new Vector3(a, a, b))];
    case "capsule":
      return [`capsule ${a} ${b}`, () => new CapsuleGeometry(a, 2 * b, 8, 24).rotateX(Math.PI / 2), pose];
  }
}
