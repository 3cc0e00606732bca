// Opens pages of `edgepuck view` in Chromium: node test/browser.mjs PROGRAM CHROMIUM [FOLDER for pictures]
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { faultsOf, open } from "./chromium.mjs";

const [program, executablePath, pictures] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "edgepuck-view-"));
const run = (words) => execFileSync(program, words.split(" "), { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });

const SCENE = `attributes = ["ring", "range", "object"]
[[object]]
mesh = "meshes/chair/train/chair_0001.off"
label = "chair"
[[object]]
mesh = "meshes/table/train/table_0001.off"
position_m = [-1.2, -0.6, 0.0]
[[sensor]]
name = "left"
profile = "vlp16"
position_m = [3.0, 1.0, 1.0]
look_at_m = [0.0, 0.0, 0.5]
`;

const browser = await open(executablePath);
const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
let nChecks = 0;

/** Shows these files in a page, which may ask for nothing and report no error, and checks it. */
async function check(name, words, test) {
  run(`view ${words} --out ${name}.html`);
  const page = await context.newPage();
  const url = pathToFileURL(join(folder, `${name}.html`)).href;
  const faults = faultsOf(page, (requested) => requested === url);
  await page.goto(url);
  await page.waitForFunction(() => viewer.firstPictureMs > 0);
  await test(page);
  if (pictures) await page.screenshot({ path: join(pictures, `${name}.png`) });
  assert.deepEqual(faults, [], name);
  await page.close();
  nChecks += 1;
}

/** Writes a million points on hills as NPY. */
function writeMillion(file) {
  const points = new Float32Array(3e6);
  for (let i = 0; i < 3e6; i += 3) {
    const [x, y] = [(i / 3) % 1000, Math.floor(i / 3000)].map((step) => 0.1 * step - 50);
    points.set([x, y, 3 * Math.sin(x / 9) * Math.cos(y / 7)], i);
  }
  const header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 3), }".padEnd(117);
  const start = Buffer.from("934e554d505901007600", "hex");
  writeFileSync(file, Buffer.concat([start, Buffer.from(`${header}\n`), Buffer.from(points.buffer)]));
}

/** The time to the first picture, frames a second, and the most memory of the page's process. */
async function measure(page) {
  const [firstMs, frameMs] = await page.evaluate(() => {
    const gl = viewer.renderer.getContext();
    const times = Array.from({ length: 11 }, () => {
      const start = performance.now();
      viewer.camera.position.x += 0.01;
      viewer.render();
      // It waits until all is drawn.
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      return performance.now() - start;
    });
    return [viewer.firstPictureMs, times.sort((a, b) => a - b)[5]];
  });
  const { processInfo } = await (await browser.newBrowserCDPSession()).send("SystemInfo.getProcessInfo");
  const peaks = processInfo.map(({ id }) => /VmHWM:\s+(\d+)/.exec(readFileSync(`/proc/${id}/status`, "utf8"))?.[1]);
  const [first, rate, most] = [firstMs / 1e3, 1e3 / frameMs, Math.max(...peaks.map(Number)) / 1e3];
  console.log(`first picture ${first.toFixed(1)} s, ${rate.toFixed(1)} frames/s, ${most.toFixed(0)} MB`);
}

const legend = (page) => page.textContent(".legend");
const tints = (page) => page.evaluate(() => Array.from(viewer.panes[0].stage.tints.array.slice(0, 300)).join());

try {
  if (pictures) mkdirSync(pictures, { recursive: true });
  run("gen-scenes street --sweeps 1 --save 1 --seed 3 --adapter cpu --out street");
  run("detect street/sweeps/000000.npz --out objects.json");
  run("detect street/sweeps/000000.npz --segment-only --out clusters");
  run("gen-dataset --save-meshes meshes --train 1 --test 1");
  run("gen-scenes --drive 0.5 --layout semantickitti --out drive");
  writeFileSync(join(folder, "scene.toml"), SCENE);
  await check("sweep", "street/sweeps/000000.npz objects.json", async (page) => {
    assert.match(await legend(page), /class.*ground.*boxes.*lines: found, dashes: truth/s);
    const before = await tints(page);
    await page.selectOption("select[name=colour]", "range");
    assert.match(await legend(page), /range \(m\)/);
    assert.notEqual(await tints(page), before);
    const { objects } = JSON.parse(readFileSync(join(folder, "objects.json")));
    assert.equal(
      await page.evaluate(() => viewer.panes[0].frame.boxes.filter((box) => !box.truth).length),
      objects.length,
    );
    await page.uncheck("input[name=truth]");
    assert.equal(await page.evaluate(() => viewer.panes[0].stage.parts.truth[0].visible), false);
    await page.click(".labels .box >> nth=0", { force: true });
    assert.match(await page.textContent(".facts"), /score0\.\d/);
    // The point that is drawn nearest to the middle of the picture is picked there.
    const at = await page.evaluate(() => {
      const [w, h] = viewer.size;
      for (let i = 0; i < 400; i++) {
        const [x, y] = [w / 2 + 5 * (i % 20), h / 2 + 5 * Math.floor(i / 20)];
        if (viewer.pick(x, y) >= 0) return [x, y, viewer.picked];
      }
    });
    await page.evaluate(() => viewer.unpick());
    await page.mouse.click(at[0], at[1]);
    assert.match(await page.textContent(".facts"), new RegExp(`point ${at[2]}.*x \\(m\\).*range \\(m\\)`, "s"));
  });
  await check("drive", "drive street/sweeps/000000.npz", async (page) => {
    assert.match(await page.textContent("output"), /1 of 5/);
    await page.selectOption("select[name=colour]", "range");
    const marks = await page.locator(".marks").allTextContents();
    assert.equal(marks.length, 1, "the files side by side have one scale");
    const first = await page.evaluate(() => viewer.panes[0].frame.name);
    await page.keyboard.press("ArrowRight");
    assert.match(await page.textContent("output"), /2 of 5/, "keys work before a click");
    await page.fill("input[name=frame]", "3");
    assert.match(await page.textContent("output"), /4 of 5/);
    assert.notEqual(await page.evaluate(() => viewer.panes[0].frame.name), first);
    assert.deepEqual(await page.locator(".marks").allTextContents(), marks, "all frames have one scale");
    await page.selectOption("select[name=colour]", "class");
    assert.match(await legend(page), /class.*(car|building)/s);
  });
  run("scan meshes/chair/train/chair_0001.off --out chair.npz");
  await check("object", "chair.npz", async (page) => {
    // The highest and the lowest pixel that a point takes.
    const [top, bottom] = await page.evaluate(() => {
      const [{ frame, stage }] = viewer.panes;
      const at = (i) => stage.world.position.clone().fromArray(frame.points.position, i).project(viewer.camera).y;
      const heights = Array.from(
        frame.points.position.keys().filter((i) => i % 3 === 0),
        at,
      ).sort((a, b) => b - a);
      return [heights[0], heights.at(-1)].map((y) => ((1 - y) / 2) * viewer.size[1]);
    });
    const bar = await page.locator(".bar").boundingBox();
    assert.ok(top > bar.y + bar.height && bottom < 800, `the points are from ${top} to ${bottom}`);
  });
  await check("clusters", "clusters", async (page) => assert.match(await legend(page), /cluster/));
  await check("scene", "scene.toml", async (page) => {
    const parts = await page.evaluate(() => Object.keys(viewer.panes[0].stage.parts).sort());
    assert.deepEqual(parts, ["beams", "grid", "meshes", "points", "sensors"]);
    const camera = () => page.evaluate(() => viewer.camera.position.toArray().join());
    const before = await camera();
    await page.click("button[name=fly]");
    await page.focus("canvas");
    await page.keyboard.press("w", { delay: 200 });
    assert.notEqual(await camera(), before);
    await page.click("button[name=reset]");
    assert.equal(await camera(), before);
  });
  await check("two", "meshes/lamp/train/lamp_0001.off street/sweeps/000000.npz", async (page) => {
    assert.equal(await page.locator(".labels .title").count(), 2);
  });
  writeMillion(join(folder, "million.npy"));
  await check("million", "million.npy", measure);
  console.log(`${nChecks} pages are as expected`);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
