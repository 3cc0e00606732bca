// Measures the page in Chromium: `node test/measure.mjs PAGE`, the folder that web/build.sh wrote. Times are
// the least of 41, on one thread: other programs only add to them.
import { readdir, readFile } from "node:fs/promises";
import { join } from "node:path";
import { brotliCompressSync } from "node:zlib";
import { open } from "../../assets/view/test/chromium.mjs";
import { serve } from "./server.mjs";

const [page] = process.argv.slice(2);
const address = await serve({ page });
const browser = await open(process.env.CHROMIUM);

/** Runs in the browser: the milliseconds of a scan and of a classification. */
async function times([adapter, mesh]) {
  const { default: init, Simulator } = await import("/page/edgepuck_web.js");
  await init();
  const simulator = await Simulator.open(adapter);
  simulator.take_built_in(mesh);
  const model = await (await fetch("/page/edge-64.safetensors")).arrayBuffer();
  simulator.take_model(new Uint8Array(model));
  const settings = JSON.stringify({
    ...{ sensor: "vlp32c", distance_m: 3, elevation_deg: 20, azimuth_deg: 215 },
    ...{ noise_m: 0, rain_mm_h: 0, fog_m: 0, returns: null },
  });
  const least = async (work) => {
    const found = [];
    for (let i = 0; i < 41; i++) {
      const start = performance.now();
      await work();
      found.push(performance.now() - start);
    }
    return Math.min(...found);
  };
  let scanned = await simulator.scan(settings);
  const castMs = await least(async () => {
    scanned.free();
    scanned = await simulator.scan(settings);
  });
  const classMs = await least(() => simulator.classify(scanned)?.free());
  return { castMs, classMs, points: scanned.range.length };
}

for (const [adapter, mesh] of [
  ["cpu", "chair"],
  ["cpu", "street"],
  ["", "chair"],
  ["", "street"],
]) {
  const tab = await browser.newPage();
  await tab.goto(`${address}/page/page.css`);
  const { castMs, classMs, points } = await tab.evaluate(times, [adapter, mesh]);
  const named = mesh === "street" ? "" : `, edge-64 names it in ${classMs.toFixed(2)} ms`;
  const place = adapter ? "CPU in WebAssembly" : "WebGPU (SwiftShader)";
  console.log(`${mesh}, a VLP-32C's turn, ${place}: ${castMs.toFixed(1)} ms, ${points} points${named}`);
  await tab.close();
}

const pictures = [];
for (let i = 0; i < 5; i++) {
  const context = await browser.newContext();
  const tab = await context.newPage();
  await tab.goto(`${address}/page/index.html`);
  await tab.waitForFunction(() => document.body.dataset.firstPictureMs);
  pictures.push(await tab.evaluate(() => Number(document.body.dataset.firstPictureMs)));
  await context.close();
}
console.log(`first picture after ${(pictures.sort((a, b) => a - b)[2] / 1000).toFixed(2)} s, the median of 5`);
await browser.close();

// The network for scans is only loaded where it is chosen.
const files = (await readdir(page)).filter((file) => !file.endsWith("rotational-64.safetensors"));
const contents = await Promise.all(files.map((file) => readFile(join(page, file))));
const total = contents.reduce((sum, content) => sum + brotliCompressSync(content).length, 0);
console.log(`${files.join(", ")}: ${(total / 1e6).toFixed(2)} MB by brotli -q 11`);
