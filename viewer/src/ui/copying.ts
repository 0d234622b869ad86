// The clipboard.

import type { Viewer } from "../viewer";

/** Copies a text to the clipboard and shows the message `done`. If the browser does not permit this, shows the text itself. */
export async function copy(viewer: Viewer, text: string, done: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    viewer.showMessage(done);
  } catch {
    viewer.showMessage(text);
  }
}
