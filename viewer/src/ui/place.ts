// Where things are written.

import type { Place } from "../data";
import { make } from "./dom";

/** How a server that knows the folder opens files in an editor: a URL with `{file}` and `{line}`; null without one. */
export const editor: { link: string | null } = { link: null };

/** Where something is written; a link where an editor can be opened. */
export function place({ file, line }: Place): Node | null {
  if (file === null) return null;
  const words = line === null ? file : `${file}:${line}`;
  if (editor.link === null) return document.createTextNode(words);
  const href = editor.link.replaceAll("{file}", encodeURI(file)).replaceAll("{line}", String(line ?? 1));
  return make("a", { href }, words);
}
