// Which program starts the language server. It is a module of its own, without VS Code, so that tests can call it.
import { existsSync, realpathSync } from "node:fs";
import { homedir } from "node:os";
import { delimiter, isAbsolute, join, relative } from "node:path";

/**
 * The command line of thingc and the folder to run it in.
 *
 * In a trusted workspace: the configured command, else `.venv` of a workspace folder, else `thingc` of the search path.
 * In an untrusted workspace nothing inside of it is started, whatever the search path or the working folder is: the program
 * must be at an absolute path outside of all workspace folders, and it runs in the home folder.
 *
 * @param {{words: string[], trusted: boolean, folders: string[], path: string, windows: boolean}} state the words of `thingc.command`, the
 *   workspace folders, and the search path.
 * @returns {{program: string, words: string[], cwd: string | undefined} | undefined} undefined if there is no such program.
 */
export function findProgram({ words, trusted, folders, path, windows }) {
  const [name = "thingc", ...rest] = words;
  if (trusted) {
    const own = folders.map((folder) => join(folder, ".venv", windows ? "Scripts/thingc.exe" : "bin/thingc"));
    const program = words.length > 0 ? name : (own.find((place) => existsSync(place)) ?? name);
    return { program, words: rest, cwd: folders[0] };
  }
  const file = windows && !/\.exe$/i.test(name) ? `${name}.exe` : name;
  const places = isAbsolute(name) ? [name] : /[/\\]/.test(name) ? [] : path.split(delimiter).filter(isAbsolute).map((folder) => join(folder, file));
  const program = places.find((place) => existsSync(place) && !folders.some((folder) => isInside(place, folder)));
  return program === undefined ? undefined : { program, words: rest, cwd: homedir() };
}

/** Whether a file is in a folder, as it is named or after its links are followed. */
function isInside(/** @type {string} */ file, /** @type {string} */ folder) {
  const down = (/** @type {string} */ from, /** @type {string} */ to) => !/^\.\.([/\\]|$)/.test(relative(from, to)) && !isAbsolute(relative(from, to));
  return down(folder, file) || (existsSync(folder) && down(realpathSync(folder), realpathSync(file)));
}
