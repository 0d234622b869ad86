// The marks over the robot: root, feet, holds and magnets of the mode, and the overlays that the user has turned on.

import { Color, Matrix4, Vector3 } from "three";
import { matrixOf } from "./kinematics";
import type { Marks } from "./marks";
import { CHOSEN } from "./scene";
import { mountOf, type Viewer } from "./viewer";

/** A label at a point of the world. */
export interface Name { words: string; at: Vector3; chosen: boolean }

/** Rings and arrows and their meaning, for the help dialog. */
export const RINGS: [string, string, string][] = [
  ["#ff8a1f", "ring", "Root of the mode (base not free), and held mounts"], ["#0e9bb5", "ring", "Root of the mode (base free)"],
  ["#30a46c", "ring", "Foot"], ["#d6409f", "arrow", "Active magnet"], ["#6b7785", "arrow", "Gravity"],
  ["#b14bd8", "arrow", "Axis of rotation"], ["#0e9bb5", "arrow", "Axis of translation; z axis of a mount"],
];
const [HELD, FREE, STOOD, MAGNET] = RINGS.map(([color]) => new Color(color));
const TURN = new Color("#b14bd8"), SLIDE = new Color("#0e9bb5"), CENTRE = new Color("#e5484d");
/** The largest number of labels. */
const MOST = 300;
/** The radius of the ring around the root, as a fraction of the size of the robot. */
export const ROOT_RING = 0.13;

const origin = (pose: Matrix4): Vector3 => new Vector3().setFromMatrixPosition(pose);
const z = (pose: Matrix4): Vector3 => new Vector3().setFromMatrixColumn(pose, 2);

/** Adds all marks of the frame; returns their labels. */
export function annotate(viewer: Viewer, marks: Marks): Name[] {
  const names: Name[] = [];
  const exploded = viewer.options.explode > 0; // links have no pose in an exploded view
  if (!exploded) {
    links(viewer, marks, names);
    axes(viewer, marks, names);
  }
  mounts(viewer, marks, names);
  stand(viewer, marks, exploded);
  measured(viewer, marks);
  for (const index of viewer.choice) {
    if (viewer.choice.size > 1 && !viewer.options.marks.has("names")) break;
    const one = viewer.robot.occurrences[index];
    names.push({ words: one.path, at: new Vector3(...one.centre).applyMatrix4(viewer.drawn[index]), chosen: true });
  }
  return names.slice(-MOST);
}

function links(viewer: Viewer, marks: Marks, names: Name[]): void {
  const { robot, stage: { size }, options: { marks: on } } = viewer;
  const whole = new Vector3();
  viewer.mode.bodies.forEach((body, index) => {
    const link = robot.links[body.link];
    const pose = viewer.bodies[index];
    const centre = new Vector3(...link.centre).applyMatrix4(pose);
    whole.addScaledVector(centre, link.mass);
    if (on.has("frames")) marks.frame(pose, 0.16 * size);
    if (on.has("names")) names.push({ words: link.name, at: centre, chosen: false });
    if (link.mass === 0) return;
    if (on.has("centres of mass")) marks.ball(centre, (0.045 * Math.cbrt(link.mass / robot.mass) + 0.006) * size, new Color("#111111"));
    if (on.has("inertia")) {
      const [x, y, z] = link.moments;
      const radius = (sum: number): number => Math.sqrt(Math.max(2.5 * sum, 0) / link.mass); // of the solid ellipsoid with these moments
      const own = matrixOf([0, 1, 2].flatMap((row) => [...link.axes.slice(3 * row, 3 * row + 3), link.centre[row]]));
      marks.ellipsoid(pose.clone().multiply(own), new Vector3(radius(y + z - x), radius(x + z - y), radius(x + y - z)), new Color("#3e7cb1"));
    }
  });
  if (on.has("centres of mass") && robot.mass > 0) marks.ball(whole.divideScalar(robot.mass), 0.05 * size, CENTRE);
}

function axes(viewer: Viewer, marks: Marks, names: Name[]): void {
  const { configuration, stage: { size }, options: { marks: on } } = viewer;
  for (const joint of viewer.joints) {
    const hovered = joint.path === viewer.hovered;
    if (!on.has("joint axes") && !hovered) continue;
    const found = configuration.tree.frameOf(joint.path, configuration.q, viewer.bodies);
    if (found === null) continue;
    const [angular, linear, anchor] = found.twist;
    const along = new Vector3(...(joint.turns ? angular : linear)).transformDirection(found.frame);
    const at = new Vector3(...anchor).applyMatrix4(found.frame);
    marks.arrow(at.clone().addScaledVector(along, -0.14 * size), along, 0.28 * size, hovered ? CHOSEN : joint.turns ? TURN : SLIDE);
    if (on.has("names") || hovered) names.push({ words: joint.path, at: at.addScaledVector(along, 0.15 * size), chosen: hovered });
  }
  const own = configuration.moves.coordinates.find(({ path }) => path === viewer.hovered);
  if (own === undefined) return;
  const along = new Vector3().setFromMatrixColumn(matrixOf(viewer.mode.at), own.at % 3);
  marks.arrow(origin(viewer.mountPose(viewer.mode.root)).addScaledVector(along, -0.14 * size), along, 0.28 * size, CHOSEN);
}

function mounts(viewer: Viewer, marks: Marks, names: Name[]): void {
  const { robot, stage: { size }, options: { marks: on } } = viewer;
  if (!on.has("mounts")) return;
  robot.occurrences.forEach((one, occurrence) => {
    for (const { name } of one.mounts) {
      const pose = viewer.mountDrawn({ occurrence, mount: name });
      marks.arrow(origin(pose), z(pose), 0.07 * size, SLIDE);
    }
  });
  for (const mount of robot.mounts) {
    const pose = viewer.mountDrawn(mount);
    marks.frame(pose, 0.1 * size);
    if (on.has("names")) names.push({ words: mount.path, at: origin(pose), chosen: false });
  }
}

function stand(viewer: Viewer, marks: Marks, exploded: boolean): void {
  const { mode, robot, stage: { size } } = viewer;
  marks.ring(viewer.mountDrawn(mode.root), ROOT_RING * size, mode.base === "free" ? FREE : HELD);
  for (const foot of mode.feet) marks.ring(viewer.mountDrawn(foot), 0.1 * size, STOOD);
  for (const loop of mode.loops) {
    if (loop.hold && !exploded) marks.ring(viewer.bodies[loop.child].clone().multiply(matrixOf(loop.X_CB)), 0.1 * size, HELD);
  }
  for (const magnet of robot.magnets) {
    if (!(magnet.path in mode.adhesion)) continue;
    const pose = viewer.mountDrawn(magnet);
    marks.arrow(origin(pose), z(pose), 0.16 * size, MAGNET);
  }
}

function measured(viewer: Viewer, marks: Marks): void {
  const { size } = viewer.stage;
  const ends = viewer.measured.flatMap((key) => mountOf(key) ?? []).map((at) => viewer.mountDrawn(at));
  for (const pose of ends) marks.frame(pose, 0.12 * size);
  if (ends.length < 2) return;
  const [from, to] = ends.map(origin);
  marks.line(from, to, 0.005 * size, CHOSEN);
}
