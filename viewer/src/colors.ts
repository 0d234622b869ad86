// By what the parts of a robot are coloured, and what the colours mean.

import { Color } from "three";
import type { NamedPose, Occurrence, Robot } from "./data";
import { PLAIN } from "./scene";

export const COLOURINGS = ["part", "link", "material", "mass source", "definition", "torque margin"] as const;
export type Colouring = (typeof COLOURINGS)[number];

export interface Legend { color: string; words: string }
export interface Coloured { colors: Color[]; legend: Legend[]; note: string | null }

const PALETTE = [
  "#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#edc948", "#76b7b2", "#ff9da7", "#9c755f", "#8cd17d", "#499894", "#d37295",
];

const SOURCES: Record<string, string> = {
  measured: "#2f8f7a", vendor: "#3e7cb1", stated: "#7a5ba6", derived: "#59a14f", estimated: "#e0a030",
};

/** A margin of 1 is as much as a drive can: below red, from 3 on green. */
function ofMargin(margin: number): string {
  const part = Math.min(1, Math.max(0, (margin - 1) / 2));
  return margin < 1 ? "#d4373c" : `#${new Color("#e8a33d").lerp(new Color("#2f9e5b"), part).getHexString()}`;
}

/** The colours of all occurrences; `pose` is the one that the robot is in, if it is in any. */
export function colouring(robot: Robot, by: Colouring, pose: NamedPose | null): Coloured {
  switch (by) {
    case "part":
      return { colors: robot.occurrences.map(({ color }) => new Color((color ?? PLAIN).slice(0, 7))), legend: [], note: null };
    case "link":
      return grouped(robot, (one) => robot.links[one.link].name);
    case "material":
      return grouped(robot, (one) => one.material ?? "no material");
    case "definition":
      return grouped(robot, (one) => robot.definitions[one.definition].label);
    case "mass source":
      return grouped(robot, (one) => (one.mass === 0 ? "no mass" : one.source), (words) => SOURCES[words] ?? PLAIN);
    case "torque margin":
      return byMargin(robot, pose);
  }
}

function grouped(robot: Robot, of: (one: Occurrence) => string, tint?: (words: string) => string): Coloured {
  const met = new Map<string, string>();
  const colors = robot.occurrences.map((one) => {
    const words = of(one);
    if (!met.has(words)) met.set(words, tint?.(words) ?? PALETTE[met.size % PALETTE.length]);
    return new Color(met.get(words)!);
  });
  return { colors, legend: [...met].map(([words, color]) => ({ color, words })), note: null };
}

function byMargin(robot: Robot, pose: NamedPose | null): Coloured {
  const plain = robot.occurrences.map(() => new Color(PLAIN));
  if (pose === null) return { colors: plain, legend: [], note: "known of named poses: choose one" };
  if (Object.keys(pose.margins).length === 0) return { colors: plain, legend: [], note: "no drive with a limit bears a load in this pose" };
  const legend: Legend[] = [];
  const colors = plain.slice();
  for (const [path, margin] of Object.entries(pose.margins)) {
    const joint = robot.joints.find((one) => one.path === path);
    if (joint === undefined) continue;
    const color = ofMargin(margin);
    legend.push({ color, words: `${path}: ${margin >= 100 ? "over 100" : margin.toFixed(2)} times` });
    robot.occurrences.forEach((one, index) => {
      if (one.link === joint.child) colors[index] = new Color(color);
    });
  }
  return { colors, legend, note: null };
}
