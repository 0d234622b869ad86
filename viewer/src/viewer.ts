// The state of the page, and the one way in which it changes: what calls a method here is heard by everybody who listens.

import { type BufferGeometry, Color, Matrix4, Vector3 } from "three";
import { annotate, type Name } from "./annotate";
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

/** What is chosen: single occurrences, by number. */
export type Choice = ReadonlySet<number>;

/** How the robot is shown; with mode and coordinates what a permalink restores. */
export interface Options {
  shown: (typeof SHOWN)[number];
  marks: Set<Mark>;
  colouring: Colouring;
  explode: number;
  /** What is beyond the plane is cut away, else (`flip`) what is before it. */
  section: { axis: "x" | "y" | "z" | null; part: number; flip: boolean };
  theme: "light" | "dark";
  /** Whether there are panels beside the picture. */
  panels: boolean;
}

/** What a listener is told has changed. */
export type Change = "robot" | "mode" | "coordinates" | "choice" | "options" | "said" | "measure" | "hover";

const MOTION = 450; // ms from pose to pose
const HINT = 6000; // ms that a remark stays
/** Of a robot that is shown through another. */
const OTHER = new Color("#2f7fd6");
/** As many chosen occurrences have their edges drawn. */
const EDGED = 24;

/** The theme that the person has for all pages. */
export const preferred = (): Options["theme"] => (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");

export class Viewer {
  robot!: Robot;
  configuration!: Configuration;
  choice: Choice = new Set();
  options: Options = {
    shown: "visual", marks: new Set<Mark>(["floor"]), colouring: "part", explode: 0, section: { axis: null, part: 0.5, flip: false },
    theme: preferred(), panels: true,
  };
  /** Two mounts between which is measured, `occurrence:mount`. */
  measured: [string, string] = ["", ""];
  /** The coordinate that a pointer is over in a panel, of a joint or of the base. */
  hovered: string | null = null;
  said = "";
  readonly stage: Stage;
  /** Where bodies are in the world, and occurrences in the picture: apart from one another where the robot is exploded. */
  bodies: Matrix4[] = [];
  drawn: Matrix4[] = [];
  private readonly marks: Marks;
  private readonly listeners: ((change: Change) => void)[] = [];
  private within: Matrix4[] = [];
  private motion = 0;
  private saying = 0;
  private stale = true;
  private other: { robot: Robot; within: Matrix4[] } | null = null;
  private known: { robot: Robot; by: Colouring; coloured: Coloured } | null = null;
  private names: Name[] = [];

  constructor(canvas: HTMLCanvasElement, private readonly labels: HTMLElement) {
    this.stage = new Stage(canvas);
    this.marks = new Marks(this.stage);
    this.stage.prepare = () => this.prepare();
  }

  /** Hear of every change. */
  listen(heard: (change: Change) => void): void {
    this.listeners.push(heard);
  }

  private tell(change: Change): void {
    this.stale = true;
    if (this.known?.by === "torque margin" && (change === "coordinates" || change === "mode")) this.known = null;
    for (const heard of this.listeners) heard(change);
    this.stage.ask();
  }

  /** Say something to whoever looks, for a while. */
  say(words: string): void {
    this.said = words;
    clearTimeout(this.saying);
    if (words !== "") this.saying = window.setTimeout(() => this.say(""), HINT);
    this.tell("said");
  }

  // --- the robot ---------------------------------------------------------------------------------------------------

  /** Show a robot; one that was shown before keeps mode, coordinates, camera and choice as far as they are there again. */
  load(robot: Robot, geometries: BufferGeometry[]): void {
    const before = this.robot === undefined ? null : { robot: this.robot, at: this.configuration };
    const whole = before !== null && this.seen();
    const chosen = new Set([...this.choice].map((one) => before!.robot.occurrences[one].path));
    this.robot = robot;
    this.within = robot.occurrences.map((one) => matrixOf(one.pose));
    this.stage.furnish(robot, geometries);
    this.choice = new Set(robot.occurrences.flatMap((one, index) => (chosen.has(one.path) ? [index] : [])));
    this.measured = ["", ""];
    const mode = robot.modes.find((one) => one.name === before?.at.mode.name) ?? robot.modes[0];
    this.enter(mode);
    if (before === null) {
      this.reset();
      this.enter(mode); // now that its size is known, which says how exact is exact enough
    }
    const same = mode.poses.find((one) => one.name === before?.at.pose?.name);
    if (same !== undefined) this.configuration.take(same);
    else if (before !== null && before.at.pose === null) this.configuration.restore(before.at.q, before.at.atHome ? null : before.at.base);
    this.tell("robot");
    this.tell("mode");
    if (before !== null && before.at.mode.name !== mode.name) { // the one that was shown is gone
      this.place();
      this.keepInView();
    }
    this.fetchBack(whole);
  }

  /** Whether all that is there is in the picture. */
  private seen(): boolean {
    this.place();
    return this.stage.shows(this.stage.bounds());
  }

  /** Goes back as far as all is in the picture that was there as a `whole` before. */
  private fetchBack(whole: boolean): void {
    if (!whole || this.seen()) return;
    this.stage.frame(this.stage.from());
    this.tell("options");
  }

  /** The picture has another size. */
  resize(): void {
    const whole = this.seen();
    this.stage.resize();
    this.fetchBack(whole);
  }

  /** Show another robot through this one, in the same mode and at the same coordinates where it has them; null shows none. */
  against(other: { robot: Robot; geometries: BufferGeometry[] } | null): void {
    this.other = other === null ? null : { robot: other.robot, within: other.robot.occurrences.map((one) => matrixOf(one.pose)) };
    this.stage.overlay(other?.robot ?? null, other?.geometries ?? []);
    this.tell("robot");
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

  /** Coordinates of the mode's tree, and of the joints that it cuts, in the document's order. */
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
    if (!this.configuration.closed) this.say(`the loops of mode ${mode.name} are open: it has no pose in which they close`);
  }

  /** The mode called so, where it starts, seen from the same direction; a wall or a ceiling that it comes to from the side of the robot. */
  setMode(name: string): void {
    const mode = this.robot.modes.find((one) => one.name === name);
    if (mode === undefined || mode === this.mode) return;
    const before = this.stage.world.quaternion.clone(), whole = this.seen();
    this.enter(mode);
    this.tell("mode");
    this.place();
    this.keepInView();
    if (before.angleTo(this.stage.world.quaternion) > 1e-6) this.stage.comeOut();
    this.fetchBack(whole);
  }

  /** What gravity and springs do on every coordinate of the mode's tree [N m or N]. */
  loads(): Coordinates {
    return loads(this.robot, this.configuration);
  }

  /** How many times over each drive holds what it has to where the robot is. */
  held(): Held {
    return held(this.robot, this.configuration);
  }

  /** A pose of the mode, reached in a smooth motion on which loops stay closed. */
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
      this.tell("coordinates");
    };
    step();
  }

  /** How far [m] the camera goes with a robot, in its world, that would leave the picture on the way to a pose; null where it stays. */
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

  /** Moves one coordinate, and what has to go with it. Says so where the loops let it go no further. */
  setCoordinate(path: string, value: number): void {
    this.motion += 1;
    if (!this.configuration.set(path, value)) this.say(`${path} goes no further: the loops of this mode would not close`);
    this.tell("coordinates");
  }

  /** The base by one of its coordinates, and what has to go with it. Says so where what the mode holds lets it go no further. */
  setBase(at: number, value: number): void {
    this.motion += 1;
    if (!this.configuration.setBase(at, value)) this.say("the base goes no further: what this mode holds would not stay");
    this.tell("coordinates");
  }

  /** Whether another coordinate leads this one. */
  follows(path: string): boolean {
    return this.configuration.couplings.follows(path);
  }

  /** How far a coordinate goes, with all that is coupled to it. */
  range(path: string): [number, number] {
    return this.configuration.couplings.range(path);
  }

  /** Coordinates by path and a base, as a permalink has them; those that are not there are left out. */
  restore(values: Coordinates, base: Matrix4 | null = null): void {
    this.motion += 1;
    this.configuration.restore(values, base);
    this.tell("coordinates");
  }

  /** Why a link cannot be drawn elsewhere in this mode, in words; null where it can. */
  kept(link: number): string | null {
    return this.configuration.kept(link);
  }

  /** Draws a point of a link (in its frame) towards a target in the world, as near as the joints let it. */
  pull(link: number, grip: Vector3, target: Vector3): void {
    this.motion += 1;
    this.configuration.pull(this.bodyOf(link), grip, target);
    this.tell("coordinates");
  }

  /** A point of the world in the frame of a link. */
  inLink(link: number, point: Vector3): Vector3 {
    this.place();
    return point.clone().applyMatrix4(this.bodies[this.bodyOf(link)].clone().invert());
  }

  /** Where a link is among the bodies. */
  bodyOf(link: number): number {
    return this.configuration.tree.bodyOf.get(link)!;
  }

  // --- choosing and showing ----------------------------------------------------------------------------------------

  choose(occurrences: Iterable<number>): void {
    this.choice = new Set(occurrences);
    this.tell("choice");
  }

  setOptions(changed: Partial<Options>): void {
    this.options = { ...this.options, ...changed };
    this.tell("options");
  }

  /** A section normal to an axis of the world, which cuts away what is towards the camera; null is none. */
  cut(axis: "x" | "y" | "z" | null): void {
    const flip = axis !== null && !this.stage.beyond("xyz".indexOf(axis));
    this.setOptions({ section: { ...this.options.section, axis, flip } });
  }

  /** How far the robot is exploded along its assembly graph, 0 to 1; the camera goes back as far as it has to. */
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

  /** Marks the joint of a coordinate, and what it moves; null none. */
  hover(path: string | null): void {
    this.hovered = path;
    this.tell("hover");
  }

  measure(which: 0 | 1, mount: string): void {
    this.measured = which === 0 ? [mount, this.measured[1]] : [this.measured[0], mount];
    this.tell("measure");
  }

  /** The camera where all is in the picture, seen from a direction; without one from above, or from where the robot is on a wall. */
  reset(from?: [number, number, number]): void {
    this.place();
    this.stage.frame(from);
    if (from === undefined) this.stage.comeOut();
    this.tell("options");
  }

  /** The camera goes with a robot that is elsewhere in another mode. */
  private keepInView(): void {
    const { camera, controls } = this.stage;
    this.stage.framed = this.stage.bounds();
    const centre = this.stage.world.localToWorld(this.stage.framed.getCenter(new Vector3()));
    camera.position.add(centre.clone().sub(controls.target));
    controls.target.copy(centre);
    controls.update();
    this.stage.ask();
  }

  // --- where things are ------------------------------------------------------------------------------------------------

  /** The pose of every link in the world by name, 16 numbers by rows. */
  links(): Record<string, number[]> {
    this.place();
    const named = this.mode.bodies.map((body, index) => [this.robot.links[body.link].name, this.bodies[index].clone().transpose().elements.slice()]);
    return Object.fromEntries(named) as Record<string, number[]>;
  }

  /** The pose of a mount in the world; its component's own frame without a mount. */
  mountPose(at: { occurrence: number; mount: string | null }): Matrix4 {
    return this.onOccurrence(at, this.bodies[this.bodyOf(this.robot.occurrences[at.occurrence].link)].clone().multiply(this.within[at.occurrence]));
  }

  /** The same in the picture, where an exploded robot has its components elsewhere. */
  mountDrawn(at: { occurrence: number; mount: string | null }): Matrix4 {
    return this.onOccurrence(at, this.drawn[at.occurrence].clone());
  }

  private onOccurrence(at: { occurrence: number; mount: string | null }, pose: Matrix4): Matrix4 {
    const mount = this.robot.occurrences[at.occurrence].mounts.find((one) => one.name === at.mount);
    return mount === undefined ? pose : pose.multiply(matrixOf(mount.pose));
  }

  /** The colours of all occurrences, and what they mean. */
  get coloured(): Coloured {
    const { robot, known, options: { colouring: by } } = this;
    if (known === null || known.robot !== robot || known.by !== by) this.known = { robot, by, coloured: colouring(robot, by, this.configuration) };
    return this.known!.coloured;
  }

  /** Bodies, then occurrences, then colours, into the picture. */
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

  /** The other robot: in the pose of the same name, else at the same coordinates, else at 0. */
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

  /** Moves what is one assembly away from the middle of that in which it is, level by level. */
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

  /** Before a picture: all that has changed, and where names are in it. */
  private prepare(): void {
    if (this.robot === undefined) return;
    if (this.stale) this.renew();
    this.stale = false;
    this.stage.reach();
    this.write();
  }

  private renew(): void {
    const { options, stage } = this;
    this.place();
    stage.show(options.shown !== "collision", options.shown !== "visual");
    stage.clip(options.section.axis === null ? null : "xyz".indexOf(options.section.axis), options.section.part, options.section.flip);
    stage.lay(options.theme === "dark" ? "#4a5460" : "#c4ccd4", options.marks.has("floor"));
    this.marks.begin();
    this.names = annotate(this, this.marks);
    this.marks.end();
  }

  /** Names at their places: all are worked out before the first is written, so that the page is laid out once. */
  private write(): void {
    const { labels, names } = this;
    const spots = this.stage.project(names.map(({ at }) => at));
    while (labels.children.length > names.length) labels.lastChild!.remove();
    while (labels.children.length < names.length) labels.append(document.createElement("span"));
    names.forEach(({ words, chosen }, index) => {
      const label = labels.children[index] as HTMLElement;
      const spot = spots[index];
      if (label.textContent !== words) label.textContent = words;
      label.className = chosen ? "chosen" : "";
      label.hidden = spot === null;
      if (spot !== null) label.style.transform = `translate(${spot.x.toFixed(1)}px, ${spot.y.toFixed(1)}px) translate(-50%, -130%)`;
    });
  }

  /** The mounts of the robot by key, those that it shows first. */
  mountKeys(): Map<string, string> {
    const keys = new Map<string, string>();
    const add = (key: string, words: string): void => { if (!keys.has(key)) keys.set(key, words); };
    for (const one of this.robot.mounts) add(`${one.occurrence}:${one.mount}`, one.path);
    this.robot.occurrences.forEach((one, index) => {
      for (const { name } of one.mounts) add(`${index}:${name}`, `${one.path}.${name}`);
    });
    return keys;
  }

  /** From one measured mount to the other, in the frame of the first [m], and the angle between their z axes [rad]. */
  distance(): { along: Vector3; angle: number } | null {
    const [first, second] = this.measured.map(mountOf);
    if (first === null || second === null) return null;
    this.place();
    const a = this.mountPose(first), b = this.mountPose(second);
    const along = new Vector3().setFromMatrixPosition(b).applyMatrix4(a.clone().invert());
    const angle = new Vector3().setFromMatrixColumn(a, 2).angleTo(new Vector3().setFromMatrixColumn(b, 2));
    return { along, angle };
  }

  /** What of the robot is under a point of the window. */
  hit(x: number, y: number): Hit | null {
    return this.stage.hit(x, y);
  }
}

export function mountOf(key: string): (MountAt & { mount: string }) | null {
  const cut = key.indexOf(":");
  return cut < 0 ? null : { path: key, occurrence: Number(key.slice(0, cut)), mount: key.slice(cut + 1) };
}


/** A choice without others that are in it already, else with them. */
export function toggled(choice: Choice, others: number[]): number[] {
  return others.every((one) => choice.has(one)) ? [...choice].filter((one) => !others.includes(one)) : [...choice, ...others];
}
