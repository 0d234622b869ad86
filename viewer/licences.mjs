// The licences of the packages that esbuild put into a bundle. Most licences require their text in every copy, so it goes into the bundle itself.
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";

/** A JavaScript comment with the name, version and licence text of each bundled package. Throws if a package has no licence file. */
export function licenceComment(metafile, here) {
  const folders = new Set();
  for (const input of Object.keys(metafile.inputs)) {
    const match = input.match(/^.*node_modules\/(?:@[^/]+\/)?[^/]+/);
    if (match) folders.add(match[0]);
  }
  const texts = [...folders].sort().map((folder) => {
    const path = join(here, folder);
    const { name, version } = JSON.parse(readFileSync(join(path, "package.json"), "utf8"));
    const file = readdirSync(path).find((one) => /^licen[cs]e/i.test(one));
    if (file === undefined) throw new Error(`${name} ${version} has no licence file in ${path}`);
    return `${name} ${version}\n\n${readFileSync(join(path, file), "utf8").trim()}\n`;
  });
  return `/*!\nThis file contains the following packages.\n\n${texts.join("\n---\n\n").replaceAll("*/", "* /")}*/\n`;
}
