// The data of a robot, written by compiler/thingc/targets/html/viewer_data.py: SI units; poses are the first three rows of a matrix.

export const VERSION = 1;

export type Vector = [number, number, number];
/** 12 numbers: the first three rows of the matrix of a pose. */
export type Rows = number[];
/** The angular part (a unit vector; 0 for a slide), the linear part, and a point on the axis. */
export type Twist = [Vector, Vector, Vector];

export interface Place { file: string | null; line: number | null }

export interface Definition extends Place {
  text: string; label: string; kind: "part" | "file" | "link" | "frame" | "assembly"; mirrors: string | null;
  parameters: [string, string][];
}

export interface Link { name: string; mass: number; centre: Vector; moments: Vector; axes: number[] }

export type Shape =
  | { shape: "mesh"; mesh: number; pose: Rows | null }
  | { shape: "box" | "cylinder" | "capsule" | "sphere" | "ellipsoid" | "plane"; size: number[]; pose: Rows };

export type Drawn = Shape & { color: string | null };

export interface Mount { name: string; pose: Rows; interface: string | null }

export interface Occurrence extends Place {
  path: string; definition: number; link: number; pose: Rows; mass: number; centre: Vector; source: string; estimate: string | null;
  material: string | null; color: string | null; make: string | null; visual: Drawn[]; collides: string; collision: Shape[];
  mounts: Mount[];
}

export interface MountAt { path: string; occurrence: number; mount: string | null }

/** A mount as documents refer to it: `foot.sole`, or `foot` for the frame of the component. */
export const referenceOf = ({ path, mount }: MountAt): string => (mount === null ? path.replace(/\/origin$/, "") : path).replaceAll("/", ".");

export interface Joint extends Place {
  path: string; joint: string; kind: string; turns: boolean; axis: string; parent: number; child: number; lower: number | null; upper: number | null;
  cone: number | null; offset: number; effort: number | null; velocity: number | null;
  stiffness: number | null; rest: number | null; mimic: { joint: string; multiplier: number; offset: number; higher: number[] } | null; drive: string | null; drive_axis: Vector | null;
}

export interface Moving { path: string; twist: Twist }

export interface Body { link: number; parent: number | null; X: Rows; at_once: boolean; joints: Moving[] }

export interface Loop {
  path: string; hold: boolean; parent: number | null; child: number; turns: boolean; at_once: boolean; X_PA: Rows; X_CB: Rows; joints: Moving[];
}

export interface NamedPose { name: string; q: Record<string, number>; base: Rows | null; margins: Record<string, number>; falls: boolean; unheld: string | null }

export interface Mode extends Place {
  name: string; root: MountAt; base: "fixed" | "held" | "free" | "planar" | "ball"; at: Rows; gravity: Vector; bodies: Body[]; loops: Loop[];
  feet: MountAt[]; adhesion: Record<string, number>; driven: string[]; start: string | null; poses: NamedPose[]; unclosed: string[];
  /** The collision shapes that the mode replaces, by occurrence. */
  collision?: Record<number, Shape[]>;
}

/** A motion: the positions of all joints at its times [s]. Unless it is smooth, the robot rests at each time. */
export interface Motion { name: string; times: number[]; q: Record<string, number[]>; smooth: boolean }

export interface BomRow {
  number: string; name: string; definition: string; quantity: number; make: string; material: string | null; mass: number;
  source: string; supplier: string | null; cost: string | null; total: string | null; link: string | null; picture: string | null;
  image: string | null; pieces: number[];
}

export interface Robot {
  version: number; name: string; mass: number; definitions: Definition[]; links: Link[]; occurrences: Occurrence[];
  mounts: (MountAt & { mount: string })[]; joints: Joint[]; tendons: number; magnets: MountAt[]; bom: BomRow[]; modes: Mode[]; motions?: Motion[];
}

/** A coordinate with its unit, in degrees or millimetres. */
export function shownCoordinate(joint: { turns: boolean }, q: number): string {
  return `${trimmed(q * scaleOf(joint), 1)} ${unitOf(joint)}`;
}

export const unitOf = (joint: { turns: boolean }): string => (joint.turns ? "deg" : "mm");

/** The factor from SI to the displayed unit. */
export const scaleOf = (joint: { turns: boolean }): number => (joint.turns ? 180 / Math.PI : 1000);

export function trimmed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

/** A mass with its unit, in kilograms or grams. */
export function shownMass(kilograms: number): string {
  if (kilograms >= 1) return `${trimmed(kilograms, 3)} kg`;
  return kilograms === 0 ? "no mass" : `${trimmed(kilograms * 1000, kilograms < 0.01 ? 3 : 2)} g`;
}

/** A count with a noun: `1 link`, `2 links`. */
export const counted = (count: number, what: string): string => `${count} ${what}${count === 1 ? "" : "s"}`;
