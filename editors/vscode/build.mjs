// Bundles the extension and its client into one file, for VS Code's own node.
import { build } from "esbuild";

await build({
  entryPoints: ["src/extension.ts"], outfile: "dist/extension.js", bundle: true, minify: true, format: "cjs", platform: "node",
  target: "node20", external: ["vscode"], legalComments: "inline",
});
