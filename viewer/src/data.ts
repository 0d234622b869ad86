// What the page is told of a robot (compiler/thingc/targets/html/viewer_data.py): SI; poses are the first three rows of a matrix.

export const VERSION = 1;

export type Vector = [number, number, number];
/** 12 numbers, the first three rows of a pose's matrix. */
export type Rows = number[];
/** Angular part (a unit vector, or 0 of a slide), linear part, and a point on the axis. */
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
}

export interface BomRow {
  number: string; name: string; definition: string; quantity: number; make: string; material: string | null; mass: number;
  source: string; supplier: string | null; cost: string | null; pieces: number[];
}

export interface Robot {
  version: number; name: string; mass: number; definitions: Definition[]; links: Link[]; occurrences: Occurrence[];
  mounts: (MountAt & { mount: string })[]; joints: Joint[]; tendons: number; magnets: MountAt[]; bom: BomRow[]; modes: Mode[];
}

/** An angle in degrees or a length in millimetres, as people read a coordinate. */
export function shownCoordinate(joint: { turns: boolean }, q: number): string {
  return `${trimmed(q * scaleOf(joint), 1)} ${unitOf(joint)}`;
}

export const unitOf = (joint: { turns: boolean }): string => (joint.turns ? "deg" : "mm");

/** How many of its unit one of SI is. */
export const scaleOf = (joint: { turns: boolean }): number => (joint.turns ? 180 / Math.PI : 1000);

export function trimmed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

/** A mass as people read it. */
export function shownMass(kilograms: number): string {
  if (kilograms >= 1) return `${trimmed(kilograms, 3)} kg`;
  return kilograms === 0 ? "no mass" : `${trimmed(kilograms * 1000, kilograms < 0.01 ? 3 : 2)} g`;
}

/** A number of things, in words. */
export const counted = (count: number, what: string): string => `${count} ${what}${count === 1 ? "" : "s"}`;
