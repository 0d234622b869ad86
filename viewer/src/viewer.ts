// The state of the page. All changes go through the methods of `Viewer`, which notify the listeners.

import { type BufferGeometry, Color, Matrix4, Vector3 } from "three";
import { annotate, type Name } from "./annotate";
import { placeLabels, placeRootLabel } from "./labels";
import { type Colouring, type Coloured, colouring } from "./colors";
import { Configuration } from "./configuration";
import type { Joint, Mode, MountAt, NamedPose, Robot } from "./data";
import { type Coordinates, matrixOf } from "./kinematics";
import { Marks } from "./marks";
import { CHOSEN, type Hit, Stage } from "./scene";
import { type Held, held, loads } from "./statics";

export const SHOWN = ["visual", "collision", "both"] as const;
export const MARKS = ["frames", "joint axes", "mounts", "centres of mass", "inertia", "names", "floor"] as const;
export type Mark = (typeof MARKS)[number];

/** The selected occurrences, by number. */
export type Choice = ReadonlySet<number>;

/** Coordinates and the pose of the base. */
export interface Posture { q: Coordinates; base: Matrix4 }

/** Display options. A permalink restores them, with the mode and the coordinates. */
export interface Options {
  shown: (typeof SHOWN)[number];
  marks: Set<Mark>;
  colouring: Colouring;
  explode: number;
  /** The section cuts away the side beyond the plane; with `flip`, the other side. */
  section: { axis: "x" | "y" | "z" | null; part: number; flip: boolean };
  theme: "light" | "dark";
  /** Whether the panels are visible. */
  panels: boolean;
}

/** The kinds of changes that listeners are notified of. */
export type Change = "robot" | "mode" | "coordinates" | "choice" | "visibility" | "options" | "message" | "measure" | "hover";

/** The duration of the motion to a pose [ms]. */
const MOTION = 450;
/** The display time of a message [ms]. */
const HINT = 6000;
/** The colour of the transparent second robot. */
const OTHER = new Color("#2f7fd6");
/** The largest number of selected occurrences whose edges are drawn. */
const EDGED = 24;

/** The preferred theme of the browser. */
export const preferred = (): Options["theme"] => (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");

export class Viewer {
  robot!: Robot;
  configuration!: Configuration;
  choice: Choice = new Set();
  hidden: Choice = new Set();
  transparent: Choice = new Set();
  options: Options = {
    shown: "visual", marks: new Set<Mark>(["floor"]), colouring: "part", explode: 0, section: { axis: null, part: 0.5, flip: false },
    theme: preferred(), panels: true,
  };
  /** The two mounts of the measurement, `occurrence:mount`. */
  measured: [string, string] = ["", ""];
  /** The coordinate under the pointer in a panel, of a joint or of the base. */
  hovered: string | null = null;
  message = "";
  readonly stage: Stage;
  /** The poses of bodies in the world, and of occurrences in the view, which differ if the robot is exploded. */
  bodies: Matrix4[] = [];
  drawn: Matrix4[] = [];
  private readonly marks: Marks;
  private readonly listeners: ((change: Change) => void)[] = [];
  private geometries: BufferGeometry[] = [];
  private within: Matrix4[] = [];
  private motion = 0;
  private messageTimer = 0;
  private stale = true;
  private other: { robot: Robot; within: Matrix4[] } | null = null;
  private known: { robot: Robot; by: Colouring; coloured: Coloured } | null = null;
  private names: Name[] = [];

  constructor(canvas: HTMLCanvasElement) {
    this.stage = new Stage(canvas);
    this.marks = new Marks(this.stage);
    this.stage.prepare = () => this.prepare();
  }

  /** Calls `listener` after every change. */
  listen(listener: (change: Change) => void): void {
    this.listeners.push(listener);
  }

  private notify(change: Change): void {
    this.stale = true;
    if (this.known?.by === "torque margin" && (change === "coordinates" || change === "mode")) this.known = null;
    for (const listener of this.listeners) listener(change);
    this.stage.ask();
  }

  /** Shows a message for six seconds; an empty one hides it. */
  showMessage(text: string): void {
    this.message = text;
    clearTimeout(this.messageTimer);
    if (text !== "") this.messageTimer = window.setTimeout(() => this.showMessage(""), HINT);
    this.notify("message");
  }

  // --- the robot ---------------------------------------------------------------------------------------------------

  /** Shows a robot. Mode, coordinates, camera and selection of the previous robot are preserved as far as the new one has them. */
  load(robot: Robot, geometries: BufferGeometry[]): void {
    const before = this.robot === undefined ? null : { robot: this.robot, at: this.configuration };
    const whole = before !== null && this.seen();
    for (const name of ["choice", "hidden", "transparent"] as const) {
      const paths = new Set([...this[name]].map((one) => before!.robot.occurrences[one].path));
      this[name] = new Set(robot.occurrences.flatMap((one, index) => (paths.has(one.path) ? [index] : [])));
    }
    this.robot = robot;
    this.geometries = geometries;
    this.within = robot.occurrences.map((one) => matrixOf(one.pose));
    this.measured = ["", ""];
    const mode = robot.modes.find((one) => one.name === before?.at.mode.name) ?? robot.modes[0];
    this.stage.furnish(robot, geometries, this, mode);
    this.enter(mode);
    if (before === null) {
      this.reset();
      this.enter(mode); // again, because the tolerances depend on the size of the robot
    }
    const same = mode.poses.find((one) => one.name === before?.at.pose?.name);
    if (same !== undefined) this.configuration.take(same);
    else if (before !== null && before.at.pose === null) this.configuration.restore(before.at.q, before.at.atHome ? null : before.at.base);
    this.notify("robot");
    this.notify("mode");
    if (before !== null && before.at.mode.name !== mode.name) { // the mode that was shown does not exist any more
      this.place();
      this.keepInView();
    }
    this.fetchBack(whole);
  }

  /** Whether the whole robot is in the view. */
  private seen(): boolean {
    this.place();
    return this.stage.shows(this.stage.bounds());
  }

  /** Fits the view if the `whole` robot was in it before and is not any more. */
  private fetchBack(whole: boolean): void {
    if (!whole || this.seen()) return;
    this.stage.frame(this.stage.from());
    this.notify("options");
  }

  /** Adapts the view to a new size of its element. */
  resize(): void {
    const whole = this.seen();
    this.stage.resize();
    this.fetchBack(whole);
  }

  /** Shows a second, transparent robot, in the same mode and at the same coordinates if it has them; null removes it. */
  against(other: { robot: Robot; geometries: BufferGeometry[] } | null): void {
    this.other = other === null ? null : { robot: other.robot, within: other.robot.occurrences.map((one) => matrixOf(one.pose)) };
    this.stage.overlay(other?.robot ?? null, other?.geometries ?? []);
    this.notify("robot");
  }

  get mode(): Mode {
    return this.configuration.mode;
  }

  get q(): Readonly<Coordinates> {
    return this.configuration.q;
  }

  get pose(): NamedPose | null {
    return this.configuration.pose;
  }

  /** The coordinates of the mode, including the joints that it cuts, in the order of the document. */
  get joints(): Joint[] {
    const here = new Set([
      ...this.mode.bodies.flatMap((body) => body.joints.map((one) => one.path)),
      ...this.mode.loops.flatMap((loop) => loop.joints.map((one) => one.path)),
    ]);
    return this.robot.joints.filter((joint) => here.has(joint.path));
  }

  private enter(mode: Mode): void {
    this.motion += 1;
    this.configuration = new Configuration(this.robot, mode, this.stage.size);
    this.bodies = this.configuration.tree.fresh();
    this.stage.face(mode.gravity);
    if (!this.configuration.closed) this.showMessage(`The loops of mode ${mode.name} are open: no pose closes them`);
  }

  /** Shows a mode in its initial pose, from the same direction. If its floor is a wall or a ceiling, the camera moves to the side of the robot. */
  setMode(name: string): void {
    const mode = this.robot.modes.find((one) => one.name === name);
    if (mode === undefined || mode === this.mode) return;
    const before = this.stage.world.quaternion.clone(), whole = this.seen();
    if (mode.collision !== this.mode.collision) this.stage.furnish(this.robot, this.geometries, this, mode);
    this.enter(mode);
    this.notify("mode");
    this.place();
    this.keepInView();
    if (before.angleTo(this.stage.world.quaternion) > 1e-6) this.stage.comeOut();
    this.fetchBack(whole);
  }

  /** The effort of gravity and springs on every coordinate of the tree [N m or N]. */
  loads(): Coordinates {
    return loads(this.robot, this.configuration);
  }

  /** The torque margins of the drives in the current configuration. */
  held(): Held {
    return held(this.robot, this.configuration);
  }

  /** Moves smoothly to a pose of the mode, with loops closed on the way. */
  setPose(name: string, motion = true): void {
    const { configuration } = this;
    const pose = this.mode.poses.find((one) => one.name === name);
    if (pose === undefined) return;
    const still = !motion || matchMedia("(prefers-reduced-motion: reduce)").matches;
    const from = { q: { ...configuration.q }, base: configuration.base.clone() };
    const to = { q: pose.q, base: pose.base === null ? configuration.tree.home : matrixOf(pose.base) };
    const way = this.wayTo(pose);
    const own = (this.motion += 1);
    const began = performance.now();
    let gone = 0;
    const step = (): void => {
      if (own !== this.motion) return;
      const part = still ? 1 : Math.min(1, (performance.now() - began) / MOTION), smooth = part * part * (3 - 2 * part);
      if (part === 1) configuration.take(pose);
      else {
        configuration.between(from, to, smooth);
        requestAnimationFrame(step);
      }
      if (way !== null) this.stage.shift(way.clone().multiplyScalar(smooth - gone));
      gone = smooth;
      this.notify("coordinates");
    };
    step();
  }

  /** Shows the configuration at `part` (0 to 1) between two others, with loops closed. */
  interpolate(from: Posture, to: Posture, part: number): void {
    this.motion += 1;
    this.configuration.between(from, to, part);
    this.notify("coordinates");
  }

  /** The displacement [m] of the camera for a robot that leaves the view in a pose, in its world; null if the robot stays in the view. */
  private wayTo(pose: NamedPose): Vector3 | null {
    const { configuration, stage } = this, { q, base, pose: here } = configuration;
    this.place();
    const before = stage.bounds();
    configuration.take(pose);
    this.place();
    const after = stage.bounds();
    Object.assign(configuration, { q, base, pose: here });
    if (!stage.shows(before) || stage.shows(after)) return null;
    return after.getCenter(new Vector3()).sub(before.getCenter(new Vector3()));
  }

  /** Moves a coordinate, and those coupled to it. Shows a message if loops stop it. */
  setCoordinate(path: string, value: number): void {
    this.motion += 1;
    if (!this.configuration.set(path, value)) this.showMessage(`${path} cannot move further: the loops of this mode cannot be closed there`);
    this.notify("coordinates");
  }

  /** Moves the base along one of its coordinates. Shows a message if holds stop it. */
  setBase(at: number, value: number): void {
    this.motion += 1;
    if (!this.configuration.setBase(at, value)) this.showMessage("The base cannot move further: the held mounts cannot stay in place");
    this.notify("coordinates");
  }

  /** Whether a coordinate follows another one. */
  follows(path: string): boolean {
    return this.configuration.couplings.follows(path);
  }

  /** The range of a coordinate, which the limits of coupled coordinates reduce. */
  range(path: string): [number, number] {
    return this.configuration.couplings.range(path);
  }

  /** Sets coordinates by path, and the base, from a permalink. Unknown paths are ignored. */
  restore(values: Coordinates, base: Matrix4 | null = null): void {
    this.motion += 1;
    this.configuration.restore(values, base);
    this.notify("coordinates");
  }

  /** The reason why a link cannot be dragged in this mode; null if it can. */
  whyFixed(link: number): string | null {
    return this.configuration.whyFixed(link);
  }

  /** Moves a point of a link (in its frame) as near to a target in the world as the joints permit. */
  pull(link: number, grip: Vector3, target: Vector3): void {
    this.motion += 1;
    this.configuration.pull(this.bodyOf(link), grip, target);
    this.notify("coordinates");
  }

  /** A point of the world in the frame of a link. */
  inLink(link: number, point: Vector3): Vector3 {
    this.place();
    return point.clone().applyMatrix4(this.bodies[this.bodyOf(link)].clone().invert());
  }

  /** The index of the body of a link. */
  bodyOf(link: number): number {
    return this.configuration.tree.bodyOf.get(link)!;
  }

  // --- selection and display ---------------------------------------------------------------------------------------

  choose(occurrences: Iterable<number>): void {
    this.choice = new Set(occurrences);
    this.notify("choice");
  }

  setVisibility(hidden: Iterable<number>, transparent: Iterable<number>): void {
    [this.hidden, this.transparent] = [new Set(hidden), new Set(transparent)];
    this.stage.furnish(this.robot, this.geometries, this, this.mode);
    this.place();
    this.notify("visibility");
  }

  /** Hides the selected parts. */
  hide(): void {
    this.setVisibility([...this.hidden, ...this.choice], this.transparent);
    this.choose([]);
  }

  /** Hides all parts that are not selected. */
  isolate(): void {
    this.setVisibility([...this.robot.occurrences.keys()].filter((index) => !this.choice.has(index)), this.transparent);
  }

  /** Makes the selected parts transparent, or opaque if all of them are transparent. */
  toggleTransparent(): void {
    this.setVisibility(this.hidden, toggled(this.transparent, [...this.choice]));
  }

  showAll(): void {
    this.setVisibility([], []);
  }

  setOptions(changed: Partial<Options>): void {
    this.options = { ...this.options, ...changed };
    this.notify("options");
  }

  /** Shows a section normal to an axis of the world that cuts away the side towards the camera; null shows none. */
  cut(axis: "x" | "y" | "z" | null): void {
    const flip = axis !== null && !this.stage.beyond("xyz".indexOf(axis));
    this.setOptions({ section: { ...this.options.section, axis, flip } });
  }

  /** Explodes the robot along its assembly graph, by 0 to 1, and moves the camera back. */
  explodeBy(explode: number): void {
    const before = this.stage.bounds();
    this.setOptions({ explode });
    this.place();
    this.stage.follow(before);
  }

  toggle(mark: Mark): void {
    const marks = new Set(this.options.marks);
    if (!marks.delete(mark)) marks.add(mark);
    this.setOptions({ marks });
  }

  /** Highlights the joint of a coordinate and the link that it moves; null highlights none. */
  hover(path: string | null): void {
    this.hovered = path;
    this.notify("hover");
  }

  measure(which: 0 | 1, mount: string): void {
    this.measured = which === 0 ? [mount, this.measured[1]] : [this.measured[0], mount];
    this.notify("measure");
  }

  /** Fits the view to the robot, seen from a direction; the default is an isometric view from the side of the floor on which the robot is. */
  reset(from?: [number, number, number]): void {
    this.place();
    this.stage.frame(from);
    if (from === undefined) this.stage.comeOut();
    this.notify("options");
  }

  /** Moves the camera to a robot that has another place in a new mode. */
  private keepInView(): void {
    const { camera, controls } = this.stage;
    this.stage.framed = this.stage.bounds();
    const centre = this.stage.world.localToWorld(this.stage.framed.getCenter(new Vector3()));
    camera.position.add(centre.clone().sub(controls.target));
    controls.target.copy(centre);
    controls.update();
    this.stage.ask();
  }

  // --- poses -----------------------------------------------------------------------------------------------------------

  /** The pose of every link in the world by name: 16 numbers, row by row. */
  links(): Record<string, number[]> {
    this.place();
    const named = this.mode.bodies.map((body, index) => [this.robot.links[body.link].name, this.bodies[index].clone().transpose().elements.slice()]);
    return Object.fromEntries(named) as Record<string, number[]>;
  }

  /** The pose of a mount in the world; if `mount` is null, of the frame of the component. */
  mountPose(at: { occurrence: number; mount: string | null }): Matrix4 {
    return this.onOccurrence(at, this.bodies[this.bodyOf(this.robot.occurrences[at.occurrence].link)].clone().multiply(this.within[at.occurrence]));
  }

  /** The same in the view, which differs if the robot is exploded. */
  mountDrawn(at: { occurrence: number; mount: string | null }): Matrix4 {
    return this.onOccurrence(at, this.drawn[at.occurrence].clone());
  }

  private onOccurrence(at: { occurrence: number; mount: string | null }, pose: Matrix4): Matrix4 {
    const mount = this.robot.occurrences[at.occurrence].mounts.find((one) => one.name === at.mount);
    return mount === undefined ? pose : pose.multiply(matrixOf(mount.pose));
  }

  /** The colours of all occurrences, with their legend. */
  get coloured(): Coloured {
    const { robot, known, options: { colouring: by } } = this;
    if (known === null || known.robot !== robot || known.by !== by) this.known = { robot, by, coloured: colouring(robot, by, this.configuration) };
    return this.known!.coloured;
  }

  /** Updates the poses of bodies and occurrences, then colours and edges. */
  private place(): void {
    const { tree, q, base } = this.configuration;
    tree.place(q, base, this.bodies);
    const poses = this.robot.occurrences.map((one, index) => new Matrix4().multiplyMatrices(this.bodies[this.bodyOf(one.link)], this.within[index]));
    const moved = this.robot.joints.find((joint) => joint.path === this.hovered)?.child;
    const colors = this.coloured.colors.map((color, index) => {
      if (this.choice.has(index)) return color.clone().lerp(CHOSEN, 0.45);
      return this.robot.occurrences[index].link === moved ? color.clone().lerp(CHOSEN, 0.25) : color;
    });
    if (this.options.explode > 0) this.explode(poses);
    this.drawn = poses;
    this.stage.arrange(poses, colors, this.bodies, this.options.colouring === "part");
    this.stage.edge([...this.choice].slice(0, EDGED), poses);
    this.placeOther();
  }

  /** Places the second robot: in the pose of the same name, else at the same coordinates. */
  private placeOther(): void {
    if (this.other === null) return;
    const { robot, within } = this.other;
    const mode = robot.modes.find((one) => one.name === this.mode.name) ?? robot.modes[0];
    const there = new Configuration(robot, mode, this.stage.size);
    const pose = mode.poses.find((one) => one.name === this.pose?.name);
    if (pose !== undefined) there.take(pose);
    else there.restore(this.q, mode.name === this.mode.name && !this.configuration.atHome ? this.configuration.base : null);
    const bodies = there.tree.place(there.q, there.base, there.tree.fresh());
    this.stage.arrangeOverlay(robot.occurrences.map((one, index) => bodies[there.tree.bodyOf.get(one.link)!].clone().multiply(within[index])), OTHER);
  }

  /** Moves every component and subassembly away from the centre of the assembly that contains it, level by level. */
  private explode(poses: Matrix4[]): void {
    const middles = new Map<string, { sum: Vector3; count: number }>();
    const paths = this.robot.occurrences.map((one) => ["", ...one.path.split("/").map((_, k, words) => words.slice(0, k + 1).join("/"))]);
    const points = poses.map((pose, index) => new Vector3(...this.robot.occurrences[index].centre).applyMatrix4(pose));
    paths.forEach((levels, index) => {
      for (const level of levels) {
        const middle = middles.get(level) ?? { sum: new Vector3(), count: 0 };
        middle.sum.add(points[index]);
        middle.count += 1;
        middles.set(level, middle);
      }
    });
    const middle = (level: string): Vector3 => middles.get(level)!.sum.clone().divideScalar(middles.get(level)!.count);
    const shift = new Matrix4();
    poses.forEach((pose, index) => {
      const away = new Vector3();
      const levels = paths[index];
      for (let k = 1; k < levels.length; k += 1) away.add(middle(levels[k])).sub(middle(levels[k - 1]));
      away.multiplyScalar(1.6 * this.options.explode);
      pose.premultiply(shift.makeTranslation(away));
    });
  }

  /** Updates everything that has changed since the last frame, and the labels. */
  private prepare(): void {
    if (this.robot === undefined) return;
    if (this.stale) this.renew();
    this.stale = false;
    this.stage.reach();
    placeLabels(this.stage, this.names);
    placeRootLabel(this.stage, this.mountDrawn(this.mode.root));
  }

  private renew(): void {
    const { options, stage } = this;
    this.place();
    stage.show(options.shown !== "collision", options.shown !== "visual");
    stage.clip(options.section.axis === null ? null : "xyz".indexOf(options.section.axis), options.section.part, options.section.flip);
    stage.lay(options.theme === "dark" ? "#4a5460" : "#c4ccd4", options.marks.has("floor"));
    stage.gravity.material.color.set(options.theme === "dark" ? "#f2f4f7" : "#1f2933");
    this.marks.begin();
    this.names = annotate(this, this.marks);
    this.marks.end();
  }

  /** The mounts of the robot by key, exported ones first. */
  mountKeys(): Map<string, string> {
    const keys = new Map<string, string>();
    const add = (key: string, words: string): void => { if (!keys.has(key)) keys.set(key, words); };
    for (const one of this.robot.mounts) add(`${one.occurrence}:${one.mount}`, one.path);
    this.robot.occurrences.forEach((one, index) => {
      for (const { name } of one.mounts) add(`${index}:${name}`, `${one.path}.${name}`);
    });
    return keys;
  }

  /** The vector from the first measured mount to the second, in the frame of the first [m], and the angle between their z axes [rad]. */
  distance(): { along: Vector3; angle: number } | null {
    const [first, second] = this.measured.map(mountOf);
    if (first === null || second === null) return null;
    this.place();
    const a = this.mountPose(first), b = this.mountPose(second);
    const along = new Vector3().setFromMatrixPosition(b).applyMatrix4(a.clone().invert());
    const angle = new Vector3().setFromMatrixColumn(a, 2).angleTo(new Vector3().setFromMatrixColumn(b, 2));
    return { along, angle };
  }

  /** The occurrence under a point of the window. */
  hit(x: number, y: number): Hit | null {
    return this.stage.hit(x, y);
  }
}

export function mountOf(key: string): (MountAt & { mount: string }) | null {
  const cut = key.indexOf(":");
  return cut < 0 ? null : { path: key, occurrence: Number(key.slice(0, cut)), mount: key.slice(cut + 1) };
}

/** A selection without `others` if it contains all of them, otherwise with them. */
export function toggled(choice: Choice, others: number[]): number[] {
  return others.every((one) => choice.has(one)) ? [...choice].filter((one) => !others.includes(one)) : [...choice, ...others];
}
