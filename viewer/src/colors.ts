// By what the parts of a robot are coloured, and what the colours mean.

import { Color } from "three";
import type { Configuration } from "./configuration";
import type { Occurrence, Robot } from "./data";
import { PLAIN } from "./scene";
import { held } from "./statics";

export const COLOURINGS = ["part", "link", "material", "mass source", "definition", "torque margin"] as const;
export type Colouring = (typeof COLOURINGS)[number];

export interface Legend { color: string; words: string }
export interface Coloured { colors: Color[]; legend: Legend[]; note: string | null }

const PALETTE = [
  "#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#edc948", "#76b7b2", "#ff9da7", "#9c755f", "#8cd17d", "#499894", "#d37295",
];

/** Colours that everybody tells apart, also who sees no red or green (Okabe and Ito, Color Universal Design, 2008). */
const SOURCES: Record<string, string> = {
  measured: "#009e73", vendor: "#0072b2", stated: "#cc79a7", derived: "#56b4e9", estimated: "#e69f00",
};

/** A margin of 1 is as much as a drive can: below red, from 3 on green. */
function ofMargin(margin: number): string {
  const part = Math.min(1, Math.max(0, (margin - 1) / 2));
  return margin < 1 ? "#d4373c" : `#${new Color("#e8a33d").lerp(new Color("#2f9e5b"), part).getHexString()}`;
}

/** The colours of all occurrences of a robot as it stands. */
export function colouring(robot: Robot, by: Colouring, at: Configuration): Coloured {
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
      return byMargin(robot, at);
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

/** What a joint moves has the colour of its drive's margin; of several drives that of the one with the least. */
function byMargin(robot: Robot, at: Configuration): Coloured {
  const { margins, note } = held(robot, at);
  const least = new Map<number, number>();
  const legend: Legend[] = [];
  for (const { path, child } of robot.joints) {
    const margin = margins[path];
    if (margin === undefined) continue;
    legend.push({ color: ofMargin(margin), words: `${path}: ${margin >= 100 ? "over 100" : margin.toFixed(2)} times` });
    least.set(child, Math.min(margin, least.get(child) ?? Infinity));
  }
  const colors = robot.occurrences.map(({ link }) => new Color(least.has(link) ? ofMargin(least.get(link)!) : PLAIN));
  return { colors, legend, note: note ?? (legend.length > 0 ? null : "no drive with a limit bears a load") };
}
