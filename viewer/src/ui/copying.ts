// What is handed to other programs.

import type { Viewer } from "../viewer";

/** Puts words on the clipboard, and says so; where a browser does not let a page, shows them to be copied by hand. */
export async function copied(viewer: Viewer, words: string, done: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(words);
    viewer.say(done);
  } catch {
    viewer.say(words);
  }
}
