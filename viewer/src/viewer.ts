// The state of the page, and the one way in which it changes: what calls a method here is heard by everybody who listens.

import { type BufferGeometry, Color, Matrix4, Quaternion, Vector3 } from "three";
import { type Colouring, type Coloured, colouring } from "./colors";
import type { Joint, Mode, MountAt, NamedPose, Robot } from "./data";
import { type Coordinates, Followers, matrixOf, Tree } from "./kinematics";
import { Marks } from "./marks";
import { CHOSEN, type Hit, Stage } from "./scene";
import { CLOSED, Solver } from "./solver";

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
  section: { axis: "x" | "y" | "z" | null; part: number };
  theme: "light" | "dark";
  /** Whether there are panels beside the picture. */
  panels: boolean;
}

/** What a listener is told has changed. */
export type Change = "robot" | "mode" | "coordinates" | "choice" | "options" | "said" | "measure";

const MOTION = 450; // ms from pose to pose
const HINT = 6000; // ms that a remark stays
/** Of a robot that is shown through another. */
const OTHER = new Color("#2f7fd6");
/** Poses are those of their names to here [rad or m]. */
const SAME = 1e-9;

interface Name { words: string; at: Vector3; chosen: boolean }

export class Viewer {
  robot!: Robot;
  tree!: Tree;
  q: Coordinates = {};
  base = new Matrix4();
  /** The pose that the robot is in, as long as nothing has been moved. */
  pose: NamedPose | null = null;
  choice: Choice = new Set();
  options: Options = {
    shown: "visual", marks: new Set<Mark>(["floor"]), colouring: "part", explode: 0, section: { axis: null, part: 0.5 },
    theme: matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light", panels: true,
  };
  /** Two mounts between which is measured, `occurrence:mount`. */
  measured: [string, string] = ["", ""];
  said = "";
  readonly stage: Stage;
  private readonly marks: Marks;
  private readonly listeners: ((change: Change) => void)[] = [];
  private followers!: Followers;
  private solver!: Solver;
  private placed: Matrix4[] = [];
  private within: Matrix4[] = [];
  /** Where occurrences are drawn, apart from one another where the robot is exploded. */
  private drawn: Matrix4[] = [];
  private motion = 0;
  private saying = 0;
  private stale = true;
  private other: { robot: Robot; followers: Followers; within: Matrix4[] } | null = null;
  private known: { robot: Robot; by: Colouring; pose: NamedPose | null; coloured: Coloured } | null = null;
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
    const before = this.robot as Robot | undefined;
    const kept = before === undefined ? null : { mode: this.mode.name, q: this.q, pose: this.pose?.name, chosen: [...this.choice].map((one) => before.occurrences[one].path) };
    this.robot = robot;
    this.followers = new Followers(robot);
    this.within = robot.occurrences.map((one) => matrixOf(one.pose));
    this.stage.furnish(robot, geometries);
    this.choice = new Set(robot.occurrences.flatMap((one, index) => (kept?.chosen.includes(one.path) ? [index] : [])));
    const mode = robot.modes.find((one) => one.name === kept?.mode) ?? robot.modes[0];
    this.enter(mode);
    const same = mode.poses.find((one) => one.name === kept?.pose);
    if (same !== undefined) this.take(same);
    else if (kept !== null && kept.pose === undefined) this.restore(kept.q);
    this.tell("robot");
    this.tell("mode");
    if (before === undefined) this.reset();
  }

  /** Show another robot through this one, in the same mode and at the same coordinates where it has them. */
  against(robot: Robot, geometries: BufferGeometry[]): void {
    this.other = { robot, followers: new Followers(robot), within: robot.occurrences.map((one) => matrixOf(one.pose)) };
    this.stage.overlay(robot, geometries);
    this.tell("robot");
  }

  get mode(): Mode {
    return this.tree.mode;
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
    this.tree = new Tree(mode);
    this.solver = new Solver(this.robot, this.tree, this.followers);
    this.placed = this.tree.fresh();
    this.stage.face(mode.gravity);
    const start = mode.poses.find((pose) => pose.name === mode.start) ?? null;
    if (start !== null) this.take(start);
    else {
      this.pose = null;
      this.base = this.tree.home.clone();
      this.q = this.followers.settle(Object.fromEntries(this.robot.joints.map((joint) => [joint.path, 0])));
      if (this.solver.closes) this.close(new Set());
    }
  }

  private take(pose: NamedPose): void {
    this.q = { ...pose.q };
    this.base = pose.base === null ? this.tree.home.clone() : matrixOf(pose.base);
    this.pose = pose;
  }

  /** The mode called so, where it starts, seen from the same place. */
  setMode(name: string): void {
    const mode = this.robot.modes.find((one) => one.name === name);
    if (mode === undefined || mode === this.mode) return;
    this.enter(mode);
    this.tell("mode");
    this.place();
    this.keepInView();
  }

  /** A pose of the mode, reached in a smooth motion on which loops stay closed. */
  setPose(name: string, motion = true): void {
    const pose = this.mode.poses.find((one) => one.name === name);
    if (pose === undefined) return;
    const still = !motion || matchMedia("(prefers-reduced-motion: reduce)").matches;
    const from = { q: { ...this.q }, base: this.base.clone() };
    const to = { q: pose.q, base: pose.base === null ? this.tree.home : matrixOf(pose.base) };
    const own = (this.motion += 1);
    const began = performance.now();
    const step = (): void => {
      if (own !== this.motion) return;
      const part = still ? 1 : Math.min(1, (performance.now() - began) / MOTION);
      if (part === 1) this.take(pose);
      else {
        const eased = part * part * (3 - 2 * part);
        for (const path of Object.keys(to.q)) this.q[path] = from.q[path] + eased * (to.q[path] - from.q[path]);
        this.base = between(from.base, to.base, eased);
        this.pose = null;
        if (this.solver.closes) this.close(new Set(), 6);
        requestAnimationFrame(step);
      }
      this.tell("coordinates");
    };
    step();
  }

  /** Moves one coordinate, and what has to go with it. Says so where the loops do not close there. */
  setCoordinate(path: string, value: number): void {
    this.motion += 1;
    const before = { q: this.q, base: this.base };
    this.q = { ...this.q, [this.followers.leader(path).path]: this.led(path, value) };
    this.followers.settle(this.q);
    this.pose = null;
    if (this.solver.closes && !this.close(new Set([path]))) {
      ({ q: this.q, base: this.base } = before);
      this.say(`${path} goes no further: the loops of this mode would not close`);
    }
    this.tell("coordinates");
  }

  private led(path: string, value: number): number {
    const { factor, shift } = this.followers.leader(path);
    return factor === 0 ? 0 : (value - shift) / factor;
  }

  /** Whether another coordinate leads this one. */
  follows(path: string): boolean {
    return this.followers.follows(path);
  }

  private close(fixed: ReadonlySet<string>, rounds = 40): boolean {
    const answer = this.solver.solve(this.q, this.base, fixed, null, rounds);
    if (answer.open > 1e-5) return false;
    this.q = answer.q;
    this.base = answer.base;
    return true;
  }

  /** Coordinates by path, as a permalink has them; those that are not there are left out. */
  restore(values: Coordinates): void {
    this.motion += 1;
    const q = { ...this.q };
    for (const [path, value] of Object.entries(values)) if (path in q && Number.isFinite(value)) q[path] = value;
    this.q = this.followers.settle(q);
    this.pose = null;
    if (this.solver.closes && this.solver.openness(this.q, this.base) > CLOSED) this.close(new Set());
    const same = this.mode.poses.find((pose) => Object.entries(pose.q).every(([path, value]) => Math.abs(value - this.q[path]) < SAME));
    if (same !== undefined) this.take(same);
    this.tell("coordinates");
  }

  // --- drawing links to points -----------------------------------------------------------------------------------------

  /** Why a link cannot be drawn elsewhere in this mode, in words; null where it can. */
  kept(link: number): string | null {
    const name = this.robot.links[link].name;
    const body = this.tree.bodyOf.get(link)!;
    if (this.mode.loops.some((loop) => loop.hold && loop.child === body)) return `${name} is held in mode ${this.mode.name}: it stays where it is`;
    if (body === 0 && this.mode.base !== "free") return `the robot stands on ${name} in mode ${this.mode.name}: choose another mode to move it`;
    if (!this.tree.above(body).some((index) => this.tree.bodies[index].joints.length > 0) && !this.solver.closes) {
      return `no joint moves ${name} in mode ${this.mode.name}`;
    }
    return null;
  }

  /** Draws a point of an occurrence (in the world where the link is now) towards a target in the world, as near as the joints let it. */
  pull(link: number, grip: Vector3, target: Vector3): void {
    const body = this.tree.bodyOf.get(link)!;
    const answer = this.solver.solve(this.q, this.base, new Set(), { body, point: grip, target }, 12);
    if (this.solver.closes && answer.open > 1e-4) return;
    this.motion += 1;
    this.q = answer.q;
    this.base = answer.base;
    this.pose = null;
    this.tell("coordinates");
  }

  /** A point of the world in the frame of a link. */
  inLink(link: number, point: Vector3): Vector3 {
    this.place();
    return point.clone().applyMatrix4(this.placed[this.tree.bodyOf.get(link)!].clone().invert());
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

  toggle(mark: Mark): void {
    const marks = new Set(this.options.marks);
    if (!marks.delete(mark)) marks.add(mark);
    this.setOptions({ marks });
  }

  measure(which: 0 | 1, mount: string): void {
    this.measured = which === 0 ? [mount, this.measured[1]] : [this.measured[0], mount];
    this.tell("measure");
  }

  /** The camera where all is in the picture. */
  reset(): void {
    this.place();
    this.stage.frame();
    this.stage.ask();
  }

  /** The camera goes with a robot that is elsewhere in another mode. */
  private keepInView(): void {
    const centre = this.stage.world.localToWorld(this.stage.bounds().getCenter(new Vector3()));
    const { camera, controls } = this.stage;
    camera.position.add(centre.clone().sub(controls.target));
    controls.target.copy(centre);
    controls.update();
    this.stage.ask();
  }

  // --- where things are ------------------------------------------------------------------------------------------------

  /** The pose of every link in the world by name, 16 numbers by rows. */
  links(): Record<string, number[]> {
    this.place();
    return Object.fromEntries(this.tree.bodies.map((body, index) => [this.robot.links[body.link].name, this.placed[index].clone().transpose().elements.slice()]));
  }

  /** The pose of a mount in the world; its component's own frame without a mount. */
  mountPose(at: { occurrence: number; mount: string | null }): Matrix4 {
    const occurrence = this.robot.occurrences[at.occurrence];
    const pose = this.placed[this.tree.bodyOf.get(occurrence.link)!].clone().multiply(this.within[at.occurrence]);
    const mount = occurrence.mounts.find((one) => one.name === at.mount);
    return mount === undefined ? pose : pose.multiply(matrixOf(mount.pose));
  }

  /** The colours of all occurrences, and what they mean. */
  get coloured(): Coloured {
    const { robot, pose, known, options: { colouring: by } } = this;
    if (known === null || known.robot !== robot || known.by !== by || known.pose !== pose) {
      this.known = { robot, by, pose, coloured: colouring(robot, by, pose) };
    }
    return this.known!.coloured;
  }

  /** Bodies, then occurrences, then colours, into the picture. */
  private place(): void {
    this.tree.place(this.q, this.base, this.placed);
    const poses = this.robot.occurrences.map((one, index) =>
      new Matrix4().multiplyMatrices(this.placed[this.tree.bodyOf.get(one.link)!], this.within[index]),
    );
    const colors = this.coloured.colors.map((color, index) => (this.choice.has(index) ? color.clone().lerp(CHOSEN, 0.72) : color));
    if (this.options.explode > 0) this.explode(poses);
    this.drawn = poses;
    this.stage.arrange(poses, colors);
    this.placeOther();
  }

  /** The other robot: in the pose of the same name, else at the same coordinates, else at 0. */
  private placeOther(): void {
    if (this.other === null) return;
    const { robot, followers, within } = this.other;
    const mode = robot.modes.find((one) => one.name === this.mode.name) ?? robot.modes[0];
    const tree = new Tree(mode);
    const pose = mode.poses.find((one) => one.name === this.pose?.name);
    const q = pose?.q ?? followers.settle(Object.fromEntries(robot.joints.map((joint) => [joint.path, this.q[joint.path] ?? 0])));
    const base = pose?.base != null ? matrixOf(pose.base) : mode.name === this.mode.name && pose === undefined ? this.base : tree.home;
    const bodies = tree.place(q, base, tree.fresh());
    const poses = robot.occurrences.map((one, index) => bodies[tree.bodyOf.get(one.link)!].clone().multiply(within[index]));
    this.stage.arrangeOverlay(poses, OTHER);
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
    if (this.stale) this.renew();
    this.stale = false;
    this.stage.reach();
    this.write();
  }

  private renew(): void {
    const { options, stage } = this;
    this.place();
    stage.show(options.shown !== "collision", options.shown !== "visual");
    stage.clip(options.section.axis === null ? null : "xyz".indexOf(options.section.axis), options.section.part);
    stage.lay(options.theme === "dark" ? "#4a5460" : "#c4ccd4", options.marks.has("floor"));
    this.mark();
  }

  private mark(): void {
    const { marks, options } = this;
    const on = options.marks, size = this.stage.size;
    const ink = new Color(options.theme === "dark" ? "#f2f4f7" : "#1f2933");
    marks.begin();
    const names: Name[] = [];
    this.tree.bodies.forEach((body, index) => {
      const link = this.robot.links[body.link];
      const pose = this.placed[index];
      const centre = new Vector3(...link.centre).applyMatrix4(pose);
      if (on.has("frames")) marks.frame(pose, 0.16 * size);
      if (on.has("centres of mass") && link.mass > 0) {
        marks.ball(centre, Math.cbrt(link.mass / Math.max(this.robot.mass, 1e-12)) * 0.045 * size + 0.006 * size, new Color("#111111"));
      }
      if (on.has("inertia") && link.mass > 0) {
        const [x, y, z] = link.moments;
        const radius = (sum: number): number => Math.sqrt(Math.max(2.5 * sum, 0) / link.mass); // of a solid ellipsoid with these moments
        const own = matrixOf([0, 1, 2].flatMap((row) => [...link.axes.slice(3 * row, 3 * row + 3), link.centre[row]]));
        marks.ellipsoid(pose.clone().multiply(own), new Vector3(radius(y + z - x), radius(x + z - y), radius(x + y - z)), new Color("#3e7cb1"));
      }
      if (on.has("names")) names.push({ words: link.name, at: centre, chosen: false });
    });
    if (on.has("centres of mass")) {
      const whole = new Vector3();
      let mass = 0;
      this.tree.bodies.forEach((body, index) => {
        const link = this.robot.links[body.link];
        whole.addScaledVector(new Vector3(...link.centre).applyMatrix4(this.placed[index]), link.mass);
        mass += link.mass;
      });
      if (mass > 0) marks.ball(whole.divideScalar(mass), 0.05 * size, new Color("#e5484d"));
    }
    if (on.has("joint axes")) {
      for (const joint of this.joints) {
        const found = this.tree.frameOf(joint.path, this.q, this.placed);
        if (found === null) continue;
        const [angular, linear, anchor] = found.twist;
        const along = new Vector3(...(joint.turns ? angular : linear)).transformDirection(found.frame);
        const at = new Vector3(...anchor).applyMatrix4(found.frame);
        marks.arrow(at.clone().addScaledVector(along, -0.14 * size), along, 0.28 * size, new Color(joint.turns ? "#b14bd8" : "#0e9bb5"));
        if (on.has("names")) names.push({ words: joint.path, at: at.addScaledVector(along, 0.15 * size), chosen: false });
      }
    }
    if (on.has("mounts")) {
      this.robot.occurrences.forEach((one, index) => {
        for (const mount of one.mounts) {
          const pose = this.mountPose({ occurrence: index, mount: mount.name });
          const z = new Vector3().setFromMatrixColumn(pose, 2);
          marks.arrow(new Vector3().setFromMatrixPosition(pose), z, 0.07 * size, new Color("#0e9bb5"));
        }
      });
      for (const mount of this.robot.mounts) marks.frame(this.mountPose(mount), 0.1 * size);
      if (on.has("names")) {
        for (const mount of this.robot.mounts) {
          names.push({ words: mount.path, at: new Vector3().setFromMatrixPosition(this.mountPose(mount)), chosen: false });
        }
      }
    }
    this.markRoot(ink);
    this.measured.forEach((key) => {
      const at = mountOf(key);
      if (at !== null) marks.frame(this.mountPose(at), 0.12 * size);
    });
    for (const index of this.choice) {
      const one = this.robot.occurrences[index];
      if (this.choice.size > 1 && !on.has("names")) break;
      names.push({ words: one.path, at: new Vector3(...one.centre).applyMatrix4(this.drawn[index]), chosen: true });
      if (names.length > 200) break;
    }
    marks.end();
    this.names = names;
  }

  /** What the mode stands on, holds and pulls with, and which way gravity goes. */
  private markRoot(ink: Color): void {
    const { marks, mode } = this;
    const size = this.stage.size;
    const root = this.mountPose(mode.root);
    marks.ring(root, 0.13 * size, new Color(mode.base === "free" ? "#0e9bb5" : "#ff8a1f"));
    for (const foot of mode.feet) marks.ring(this.mountPose(foot), 0.1 * size, new Color("#30a46c"));
    for (const loop of mode.loops) {
      if (!loop.hold) continue;
      marks.ring(this.placed[loop.child].clone().multiply(matrixOf(loop.X_CB)), 0.1 * size, new Color("#ff8a1f"));
    }
    for (const magnet of this.robot.magnets) {
      if (!(magnet.path in mode.adhesion)) continue;
      const pose = this.mountPose(magnet);
      marks.arrow(new Vector3().setFromMatrixPosition(pose), new Vector3().setFromMatrixColumn(pose, 2), 0.16 * size, new Color("#d6409f"));
    }
    const pull = new Vector3(...mode.gravity);
    if (pull.length() > 0) {
      const at = this.stage.bounds().getCenter(new Vector3());
      const side = new Vector3(-0.62, -0.72, 0).applyQuaternion(this.stage.world.quaternion.clone().invert());
      marks.arrow(at.addScaledVector(side, 1.05 * size), pull.normalize(), 0.24 * size, ink);
    }
  }

  private write(): void {
    const { labels, names } = this;
    while (labels.children.length > names.length) labels.lastChild!.remove();
    while (labels.children.length < names.length) labels.append(document.createElement("span"));
    names.forEach(({ words, at, chosen }, index) => {
      const label = labels.children[index] as HTMLElement;
      const spot = this.stage.project(at);
      label.textContent = words;
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

function between(from: Matrix4, to: Matrix4, part: number): Matrix4 {
  const [p, r, s] = [new Vector3(), new Quaternion(), new Vector3()];
  const [p2, r2] = [new Vector3(), new Quaternion()];
  from.decompose(p, r, s);
  to.decompose(p2, r2, s);
  return new Matrix4().compose(p.lerp(p2, part), r.slerp(r2, part), new Vector3(1, 1, 1));
}
