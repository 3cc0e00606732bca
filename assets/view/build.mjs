// Bundles the viewer and three.js into one file, viewer.js, or into the file that is named.
import { readFileSync } from "node:fs";
import { build } from "esbuild";

const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();

await build({
  entryPoints: ["src/main.js"],
  outfile: process.argv[2] ?? "viewer.js",
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
