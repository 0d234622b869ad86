// The clipboard and downloads.

import type { Viewer } from "../viewer";
import { make } from "./dom";

/** Copies a text to the clipboard and shows the message `done`. If the browser does not permit this, shows the text itself. */
export async function copy(viewer: Viewer, text: string, done: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    viewer.showMessage(done);
  } catch {
    viewer.showMessage(text);
  }
}

/** Downloads a file. */
export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
