// Source locations.

import type { Place } from "../data";
import { make } from "./dom";

/** The URL that opens a file in an editor, with `{file}` and `{line}`; null if the page was not sent by `thingc view`. */
export const editor: { link: string | null } = { link: null };

/** A source location, as a link if an editor URL is set. */
export function place({ file, line }: Place): Node | null {
  if (file === null) return null;
  const words = line === null ? file : `${file}:${line}`;
  if (editor.link === null) return document.createTextNode(words);
  const href = editor.link.replaceAll("{file}", encodeURI(file)).replaceAll("{line}", String(line ?? 1));
  return make("a", { href }, words);
}
