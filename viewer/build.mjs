// Bundles src/ and three.js into one script without imports, for a page that is opened as a file.
// Its first line contains the hash of the sources, with which a test checks that the bundle is up to date.
import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { join } from "node:path";
import { build } from "esbuild";
import { licenceComment } from "./licences.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));
const target = join(here, "../compiler/thingc/targets/html/page/viewer.js");

const digest = createHash("sha256");
const sources = readdirSync(join(here, "src"), { recursive: true }).filter((name) => name.endsWith(".ts"));
for (const name of [...sources.map((name) => `src/${name}`), "package-lock.json"].sort()) {
  digest.update(`${name}\n`).update(readFileSync(join(here, name)));
}

const made = await build({
  entryPoints: [join(here, "src/main.ts")], bundle: true, minify: true, format: "iife", target: "es2022", write: false,
  legalComments: "inline", charset: "utf8", metafile: true, absWorkingDir: here,
});
// `</script` and `<!--` would end the script element of the page
const text = (licenceComment(made.metafile, here) + made.outputFiles[0].text).replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
writeFileSync(target, `// thingc viewer, with three.js (MIT, https://threejs.org). Made from viewer/ by \`make viewer\`; sources ${digest.digest("hex")}\n${text}`);
console.log(`${target}: ${(text.length / 1024).toFixed(0)} KiB`);
