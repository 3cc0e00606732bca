// Tests the page in a browser: `node test/browser.mjs PAGE TRACED`, the folders that web/build.sh and the
// example `traced` write. Screenshots of it are in PAGE/../pictures afterwards.
import assert from "node:assert/strict";
import { mkdir, readFile } from "node:fs/promises";
import { join } from "node:path";
import { faultsOf, open } from "../../assets/view/test/chromium.mjs";
import { serve } from "./server.mjs";

const [page, traced] = process.argv.slice(2);
const pictures = join(page, "../pictures");
await mkdir(pictures, { recursive: true });
const address = await serve({ page, traced });
const browser = await open(process.env.CHROMIUM);

const failures = [];
async function test(name, check) {
  try {
    const said = await check();
    console.log(`ok: ${name}${said ? `: ${said}` : ""}`);
  } catch (error) {
    failures.push(name);
    console.log(`FAILED: ${name}: ${error.stack ?? error}`);
  }
}

/** A page of the browser that fails on errors in its console, and on requests to elsewhere. */
async function tab(settings = {}) {
  const context = await browser.newContext(settings);
  const opened = await context.newPage();
  const faults = faultsOf(opened, (url) => /^(http:\/\/localhost:|blob:|data:)/.test(url));
  return { opened, done: () => context.close().then(() => assert.deepEqual(faults, [])) };
}

async function show(link, settings) {
  const { opened, done } = await tab(settings);
  await opened.goto(`${address}/page/index.html${link}`);
  await opened.waitForFunction(() => document.body.dataset.firstPictureMs);
  return { opened, done };
}

const idle = (opened) => opened.waitForFunction(() => document.body.dataset.state === "idle");
const text = (opened, id) => opened.locator(`#${id}`).textContent();

/** Runs in the browser: compares what WebAssembly and WebGPU find with what the native caster found. */
async function compare() {
  const { default: init, Simulator } = await import("/page/edgepuck_web.js");
  await init();
  const bytes = async (name) => new Uint8Array(await (await fetch(`/traced/${name}`)).arrayBuffer());
  const cases = await (await fetch("/traced/cases.json")).json();
  const [cpu, gpu] = [await Simulator.open("cpu"), await Simulator.open("")];
  const found = { rays: 0, hits: 0, points: 0, marked: 0, differ: [] };
  const differing = (a, b) => (a.length === b.length ? a.filter((x, i) => x !== b[i]).length : "the length");
  const [AMBIGUOUS, MISS] = [0x80000000, 0xffffffff];
  const isMarked = (code) => code >= AMBIGUOUS && code !== MISS;
  const bits = ({ buffer, byteOffset, length }) => new BigUint64Array(buffer, byteOffset, length);
  let taken;
  for (const { case: number, subject, is_file, settings } of cases) {
    if (taken !== subject)
      for (const simulator of [cpu, gpu])
        is_file ? simulator.take_file(subject, await bytes(subject)) : simulator.take_built_in(subject);
    taken = subject;
    const [byCpu, byGpu] = [await cpu.trace(JSON.stringify(settings)), await gpu.trace(JSON.stringify(settings))];
    const native = new Uint32Array((await bytes(`${number}.codes`)).buffer);
    const triangles = new Uint32Array((await bytes(`${number}.triangles`)).buffer);
    const ranges = new BigUint64Array((await bytes(`${number}.ranges`)).buffer);
    const points = new Uint32Array((await bytes(`${number}.scan`)).buffer);
    const scan = await cpu.scan(JSON.stringify(settings));
    const columns = new Float32Array([...scan.positions, ...scan.range, ...scan.intensity]);
    // WebGPU rounds its rays otherwise, so that it may mark others for f64 to decide: what is found is the same.
    const differ = {
      "codes of WebAssembly": differing(native, byCpu.codes),
      "triangles of WebGPU": differing(triangles, byGpu.triangles),
      "ranges of WebAssembly": differing(ranges, bits(byCpu.ranges)),
      "ranges of WebGPU": differing(ranges, bits(byGpu.ranges)),
      "points in rain and fog": differing(points, new Uint32Array(columns.buffer)),
    };
    if (Object.values(differ).some(Boolean)) found.differ.push({ subject, settings, ...differ });
    found.marked += byGpu.codes.filter(isMarked).length;
    found.rays += native.length;
    found.hits += ranges.length;
    found.points += scan.range.length;
  }
  return found;
}

await test("WebAssembly and WebGPU scan as the native caster does, bit for bit, also in rain and fog", async () => {
  const { opened, done } = await tab();
  await opened.goto(`${address}/page/page.css`);
  const { rays, hits, points, marked, differ } = await opened.evaluate(compare);
  assert.ok(Math.min(hits, points) > 100_000, `${hits} hits, ${points} points`);
  assert.ok(marked < 0.01 * hits, `${marked} of ${hits} hits are left to f64`);
  assert.deepEqual(differ, []);
  await done();
  return `${rays} rays, ${hits} hits, ${marked} decided in f64 for WebGPU, ${points} points in rain and fog`;
});

await test("the page names the chair that it begins with, and the link holds the settings", async () => {
  const { opened, done } = await show("");
  assert.match(await text(opened, "class"), /^\S+ \d+ %$/);
  assert.match(
    await text(opened, "facts"),
    /^[\d,]+ points · cast in .* on CPU \(no GPU here\) · named in .* on the CPU$/,
  );
  await opened.screenshot({ path: join(pictures, "desktop.png") });
  await opened.locator("#distance").focus();
  await opened.keyboard.press("ArrowRight");
  await idle(opened);
  assert.equal(new URL(opened.url()).hash, "#distance=3.1");
  await done();
});

await test("WebGPU casts where it is asked for, and is named", async () => {
  const { opened, done } = await show("#run=webgpu&mesh=airplane&noise=0.01");
  // More devices than are kept: the first ones are destroyed meanwhile.
  for (let i = 0; i < 6; i++) {
    await opened.locator("#noise").press("ArrowRight");
    await idle(opened);
    assert.match(await text(opened, "facts"), /on WebGPU \(google swiftshader\)/);
  }
  assert.equal(new URL(opened.url()).hash, "#mesh=airplane&noise=0.016&run=webgpu");
  await done();
  return text(opened, "facts").catch(() => "");
});

/** Drops a file of this name and content on the page, as a user would. */
async function drop(opened, name, content) {
  const transfer = await opened.evaluateHandle(
    ([name, content]) => {
      const dropped = new DataTransfer();
      dropped.items.add(new File([content], name));
      return dropped;
    },
    [name, content],
  );
  await opened.dispatchEvent("#drop", "drop", { dataTransfer: transfer });
  await opened.waitForTimeout(100);
  await idle(opened);
}

await test("a file that is dropped is scanned and named, and one that is no mesh is told with its line", async () => {
  const { opened, done } = await show("#mesh=bowl&elevation=35");
  const chair = await readFile(join(traced, "chair_0046.obj"), "utf8");
  await drop(opened, "chair_0046.obj", chair);
  assert.match(await text(opened, "class"), /^chair \d+ %$/);
  await drop(opened, "bad.off", "OFF\n3 1 0\n0 0 0\n1 0 zero\n");
  assert.equal(await text(opened, "error"), 'bad.off:4: expected a finite coordinate, found "zero"');
  await opened.screenshot({ path: join(pictures, "error.png") });
  await drop(opened, "chair_0046.obj", chair);
  assert.ok(await opened.locator("#error").isHidden());
  await done();
});

await test("a street is scanned, in the dark", async () => {
  const { opened, done } = await show("#mesh=street&rain=20", { colorScheme: "dark" });
  assert.equal(await text(opened, "class"), "street");
  assert.ok(await opened.locator("#distance").isHidden());
  await opened.screenshot({ path: join(pictures, "dark.png") });
  await done();
});

await test("a sensor that lacks what an effect needs is told in words", async () => {
  const { opened, done } = await show("#sensor=generic-static&returns=dual");
  assert.match(await text(opened, "error"), /footprint/);
  await done();
});

await test("a phone shows all of the page, and the object beside its legend", async () => {
  const settings = { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, isMobile: true, hasTouch: true };
  const { opened, done } = await show("#mesh=car", settings);
  const width = await opened.evaluate(() => document.documentElement.scrollWidth);
  assert.equal(width, 390);
  const [picture, bar, legend] = await Promise.all(
    ["canvas", ".bar", ".legend"].map((part) => opened.locator(part).boundingBox()),
  );
  assert.ok(legend.y - (bar.y + bar.height) > picture.height / 2, "the middle half of the picture is free");
  assert.ok(await opened.locator("input[name=meshes]").isVisible());
  await opened.screenshot({ path: join(pictures, "phone.png"), fullPage: true });
  await done();
});

await browser.close();
console.log(failures.length ? `${failures.length} failed` : "all passed");
process.exitCode = failures.length ? 1 : 0;
