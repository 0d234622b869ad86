// Bundles the extension and its client into one file, for VS Code's own node.
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { licenceComment } from "../../viewer/licences.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));
const made = await build({
  entryPoints: ["src/extension.ts"], outfile: "dist/extension.js", bundle: true, minify: true, format: "cjs", platform: "node",
  target: "node20", external: ["vscode"], legalComments: "inline", metafile: true, absWorkingDir: here,
});
const bundle = `${here}dist/extension.js`;
writeFileSync(bundle, licenceComment(made.metafile, here) + readFileSync(bundle, "utf8"));
