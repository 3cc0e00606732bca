// Bundles the viewer and three.js into one file, viewer.js, or with --check compares it with what is there.
import { readFileSync } from "node:fs";
import { build } from "esbuild";

const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();

const checks = process.argv.includes("--check");
const { outputFiles } = await build({
  write: !checks,
  entryPoints: ["src/main.js"],
  outfile: "viewer.js",
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "EdgepuckViewer",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  loader: { ".css": "text" },
  banner: { js: `/*! Edgepuck's viewer, with three.js:\n\n${licence}\n*/` },
});

if (checks && readFileSync("viewer.js", "utf8") !== outputFiles[0].text) {
  throw new Error(
    "assets/view/viewer.js is not what its sources make: `npm ci && npm run build` in assets/view makes it",
  );
}
