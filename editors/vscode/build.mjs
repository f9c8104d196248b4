// Bundles the extension, and copies the grammar, whose only source is beside this folder.
import { copyFileSync, mkdirSync } from "node:fs";
import { build } from "esbuild";

mkdirSync("dist", { recursive: true });
copyFileSync("../prism.tmLanguage.json", "dist/prism.tmLanguage.json");
copyFileSync("../../LICENSE", "LICENSE");
await build({
  entryPoints: ["extension.js"],
  outfile: "dist/extension.js",
  bundle: true,
  minify: true,
  platform: "node",
  target: "node18",
  external: ["vscode"],
});
