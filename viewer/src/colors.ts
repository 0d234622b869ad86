// Colours of parts and their legends.

import { Color } from "three";
import type { Configuration } from "./configuration";
import type { Occurrence, Robot } from "./data";
import { PLAIN } from "./scene";
import { held } from "./statics";

export const COLOURINGS = ["part", "link", "material", "mass source", "definition", "torque margin"] as const;
export type Colouring = (typeof COLOURINGS)[number];

export interface Legend { color: string; words: string }
/** The colour of each occurrence, and the legend with its title. */
export interface Coloured { colors: Color[]; title: string; legend: Legend[]; note: string | null }

const PALETTE = [
  "#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#edc948", "#76b7b2", "#ff9da7", "#9c755f", "#8cd17d", "#499894", "#d37295",
];

/** Colours that colour-blind people can distinguish (Okabe and Ito, Color Universal Design, 2008). */
const SOURCES: Record<string, string> = {
  measured: "#009e73", vendor: "#0072b2", stated: "#cc79a7", derived: "#56b4e9", estimated: "#e69f00",
};

/** The legend title of torque margins. */
const MARGIN = "Torque margin: effort limit of the drive / effort required to hold the robot";

/** Red below 1, where the drive is too weak; from orange at 1 to green at 3 and above. */
function ofMargin(margin: number): string {
  const part = Math.min(1, Math.max(0, (margin - 1) / 2));
  return margin < 1 ? "#d4373c" : `#${new Color("#e8a33d").lerp(new Color("#2f9e5b"), part).getHexString()}`;
}

/** The colours of all occurrences of a robot in a configuration. */
export function colouring(robot: Robot, by: Colouring, at: Configuration): Coloured {
  switch (by) {
    case "part":
      return { colors: robot.occurrences.map(({ color }) => new Color((color ?? PLAIN).slice(0, 7))), title: "", legend: [], note: null };
    case "link":
      return grouped(robot, "Link", (one) => robot.links[one.link].name);
    case "material":
      return grouped(robot, "Material", (one) => one.material ?? "no material");
    case "definition":
      return grouped(robot, "Definition", (one) => robot.definitions[one.definition].label);
    case "mass source":
      return grouped(robot, "Mass source", (one) => (one.mass === 0 ? "no mass" : one.source), (words) => SOURCES[words] ?? PLAIN);
    case "torque margin":
      return byMargin(robot, at);
  }
}

function grouped(robot: Robot, title: string, of: (one: Occurrence) => string, tint?: (words: string) => string): Coloured {
  const met = new Map<string, string>();
  const colors = robot.occurrences.map((one) => {
    const words = of(one);
    if (!met.has(words)) met.set(words, tint?.(words) ?? PALETTE[met.size % PALETTE.length]);
    return new Color(met.get(words)!);
  });
  return { colors, title, legend: [...met].map(([words, color]) => ({ color, words })), note: null };
}

/** The child link of a joint has the colour of the smallest margin of its drives. */
function byMargin(robot: Robot, at: Configuration): Coloured {
  const { margins, note } = held(robot, at);
  const least = new Map<number, number>();
  const legend: Legend[] = [];
  for (const { path, child } of robot.joints) {
    const margin = margins[path];
    if (margin === undefined) continue;
    legend.push({ color: ofMargin(margin), words: `${path}: ${margin >= 100 ? "over 100" : margin.toFixed(2)}` });
    least.set(child, Math.min(margin, least.get(child) ?? Infinity));
  }
  const colors = robot.occurrences.map(({ link }) => new Color(least.has(link) ? ofMargin(least.get(link)!) : PLAIN));
  return { colors, title: MARGIN, legend, note: note ?? (legend.length > 0 ? null : "No drive with an effort limit carries a load.") };
}
