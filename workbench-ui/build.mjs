// npm run build writes the bundle that the wheel ships; npm run check compares it.
import { build } from "esbuild";
import { readFile, writeFile } from "node:fs/promises";

const target = new URL("../src/symcheck/workbench/static/app.js", import.meta.url);
const { outputFiles } = await build({
  entryPoints: [new URL("src/main.js", import.meta.url).pathname],
  bundle: true, minify: true, write: false, format: "iife", target: "es2022",
  legalComments: "eof", charset: "utf8", logLevel: "warning",
});
const [bundle] = outputFiles;
if (!process.argv.includes("--check")) await writeFile(target, bundle.text);
else if ((await readFile(target, "utf8")) !== bundle.text) {
  console.error("app.js is not what the sources give: npm run build");
  process.exit(1);
}
