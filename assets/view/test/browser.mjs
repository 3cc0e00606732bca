// Opens pages of `edgepuck view` in Chromium: node test/browser.mjs PROGRAM CHROMIUM [FOLDER for pictures]
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { faultsOf, open } from "./chromium.mjs";

const [program, executablePath, pictures] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "edgepuck-view-"));
/** Runs the program; returns its exit code, its output, and what it says. */
function attempt(words) {
  const { status, stdout, stderr } = spawnSync(program, words.split(" "), { cwd: folder, maxBuffer: 1e9 });
  return { code: status, out: `${stdout}`, said: `${stderr}` };
}
function run(words) {
  const ran = attempt(words);
  assert.equal(ran.code, 0, `${words}: ${ran.said}`);
  return ran;
}
const text = (file) => readFileSync(join(folder, file), "utf8");
const write = (file, content) => writeFileSync(join(folder, file), content);

const SCENE = `attributes = ["ring", "range", "object"]
[[object]]
mesh = "meshes/chair/train/chair_0001.off"
name = "near_chair"
label = "chair"
[[object]]
mesh = "meshes/table/train/table_0001.off"
name = "far_table"
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
async function check(name, words, test, of = context) {
  run(`view ${words} --out ${name}.html`);
  const page = await of.newPage();
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

/** The points of the frame with this number of the first pane, with their columns by name. */
const pointsOf = (page, number) =>
  page.evaluate((number) => {
    const { position, columns } = viewer.data.panes[0].frames[number].points;
    const named = columns.map(({ name, values, names }) => [
      name,
      Array.from(values, (value) => names?.[value] ?? value),
    ]);
    return { position: Array.from(position), ...Object.fromEntries(named) };
  }, number);

/** Whether numbers are equal to `most`, one by one. */
function assertNear(found, expected, most, what) {
  assert.equal(found.length, expected.length, what);
  const off = Math.max(0, ...found.map((x, i) => Math.abs(x - expected[i])));
  assert.ok(off <= most, `${what}: ${off} apart`);
}

/** The width, the height and the pixels (red, green, blue, opacity) of a PNG file that `view` draws. */
async function picture(words) {
  run(`view ${words} --overwrite --out picture.png`);
  const page = await context.newPage();
  const drawn = await page.evaluate(
    async (base64) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      return { width: image.width, height: image.height, pixels: Array.from(data) };
    },
    readFileSync(join(folder, "picture.png"), "base64"),
  );
  await page.close();
  return drawn;
}

/** The shares of a picture's pixels that are nearly of this colour. */
const shareOf = ({ pixels }, colour, near = 60) => {
  const is = (i) => colour.every((x, channel) => Math.abs(pixels[4 * i + channel] - x) <= near);
  return Array.from({ length: pixels.length / 4 }, (_, i) => i).filter(is).length / (pixels.length / 4);
};

/** Where the middle of the first sensor is in the picture, -1 to 1, and whether the camera is behind and above it. */
const sensorIn = (page) =>
  page.evaluate(() => {
    const { pose } = viewer.panes[0].frame.sensors[0];
    const { sensor, heading, middle } = viewer.extents[0];
    const camera = viewer.camera.position.toArray();
    const at = viewer.camera.position.clone().fromArray([pose[3], pose[7], pose[11]]).project(viewer.camera);
    const isSweep = viewer.extents[0].isSweep;
    const ahead = isSweep ? heading : [0, 1].map((axis) => middle[axis] - sensor[axis]);
    const along = [0, 1].reduce((sum, axis) => sum + (camera[axis] - sensor[axis]) * ahead[axis], 0);
    return { x: at.x, y: at.y, isBehind: along < 0, isAbove: camera[2] > sensor[2] };
  });

function assertAtSensor({ x, y, isBehind, isAbove }) {
  assert.ok(Math.abs(x) < 1 && Math.abs(y) < 1, `the sensor is in the picture, found at ${x}, ${y}`);
  assert.ok(isBehind && isAbove, "the camera is behind and above the sensor");
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
    assertAtSensor(await sensorIn(page));
    // The class of each point is that of its object in the description beside the sweep.
    const { objects: described } = JSON.parse(text("street/sweeps/000000.json"));
    const found = await pointsOf(page, 0);
    const classes = found.object.map((object) => (object ? described[object - 1].class : "ground"));
    assert.deepEqual(found.class, classes);
    assert.ok(new Set(classes).size > 5);
    // A car that was found stands where one was drawn, within the size of a person.
    const boxes = await page.evaluate(() => viewer.panes[0].frame.boxes);
    const cars = boxes.filter((box) => box.class === "car");
    const [car] = cars.filter((box) => !box.truth);
    const off = ({ centre }) => centre.map((x, axis) => x - car.centre[axis]);
    const isAt = (box) => box.truth && Math.hypot(...off(box).slice(0, 2)) < 0.7 && Math.abs(off(box)[2]) < 0.4;
    assert.ok(cars.some(isAt), JSON.stringify(cars));
    // Boxes are drawn as they stand: each has a line from its corner ahead on the left.
    const away = await page.evaluate(() => {
      const { instanceStart } = viewer.panes[0].stage.parts.boxes[0].geometry.attributes;
      const starts = Array.from({ length: instanceStart.count }, (_, i) => [
        instanceStart.getX(i),
        instanceStart.getY(i),
      ]);
      const found = viewer.panes[0].frame.boxes.filter((box) => !box.truth);
      const toCorner = ({ centre: [x, y], size: [length, width], yaw }) => {
        const [cos, sin] = [Math.cos(yaw) / 2, Math.sin(yaw) / 2];
        const corner = [x + cos * length - sin * width, y + sin * length + cos * width];
        return Math.min(...starts.map((at) => Math.hypot(at[0] - corner[0], at[1] - corner[1])));
      };
      return found.map(toCorner);
    });
    assert.ok(Math.max(...away) < 0.01, away.join());
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
    // The distance between two points that are picked.
    const [one, other] = await page.evaluate(() => {
      const { position } = viewer.panes[0].frame.points;
      const at = (i) =>
        viewer.camera.position
          .clone()
          .fromArray(position, 3 * i)
          .project(viewer.camera);
      const isSeen = (i) => Math.abs(at(i).x) < 0.5 && Math.abs(at(i).y) < 0.5;
      const seen = Array.from({ length: position.length / 3 }, (_, i) => i).filter(isSeen);
      const pick = (i) => viewer.pick(((at(i).x + 1) / 2) * viewer.size[0], ((1 - at(i).y) / 2) * viewer.size[1]);
      return [pick(seen[0]), pick(seen.at(-1))];
    });
    const apart = Math.hypot(
      ...[0, 1, 2].map((axis) => found.position[3 * one + axis] - found.position[3 * other + axis]),
    );
    assert.match(await page.textContent(".facts"), new RegExp(`before \\(m\\)${apart.toFixed(3)}`));
    // Nothing above the cut is seen.
    const drawn = () => page.evaluate(() => viewer.save().toDataURL().length);
    const all = await drawn();
    await page.fill("input[name=cut]", "0.1");
    assert.ok((await drawn()) < all);
    const saved = page.waitForEvent("download");
    await page.click("button[name=save]");
    assert.equal((await saved).suggestedFilename(), "000000.npz.png");
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
  for (const extension of ["npz", "csv"]) run(`scan meshes/chair/train/chair_0001.off --out chair.${extension}`);
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
    assertAtSensor(await sensorIn(page));
    assert.match(await legend(page), /^ring/, "what varies has colours");
    assert.doesNotMatch(await page.textContent("select[name=colour]"), /object/, "one object has no colours");
    // The numbers are those of the file: 1 / 256 m, or a 65,535th of a column's span.
    const [header, ...lines] = text("chair.csv").trim().split("\n");
    const rows = lines.map((line) => line.split(",").map(Number));
    const column = (name) => rows.map((row) => row[header.split(",").indexOf(name)]);
    const found = await pointsOf(page, 0);
    ["x", "y", "z"].forEach((name, axis) => {
      const axisOf = found.position.filter((_, i) => i % 3 === axis);
      assertNear(axisOf, column(name), 0.004, name);
    });
    for (const name of ["ring", "beam"]) assertNear(found[name], column(name), 0, name);
    assert.deepEqual([...new Set(found.object)], ["chair_0001"]);
    for (const name of ["time", "intensity"]) assertNear(found[name], column(name), 1e-5, name);
    const range = await page.evaluate(() =>
      Array.from(viewer.panes[0].stage.columns.find(({ name }) => name === "range").values),
    );
    assertNear(range, column("range"), 0.012, "range");
    // R returns to the fit.
    const camera = () =>
      page.evaluate(() =>
        [...viewer.camera.position, ...viewer.navigation.orbit.target].map((x) => x.toFixed(6)).join(),
      );
    const fitted = await camera();
    await page.mouse.move(600, 400);
    await page.mouse.down();
    await page.mouse.move(700, 450);
    await page.mouse.up();
    assert.notEqual(await camera(), fitted);
    await page.keyboard.press("r");
    assert.equal(await camera(), fitted);
  });
  const phone = await browser.newContext({ viewport: { width: 390, height: 844 } });
  await check(
    "phone",
    "chair.npz",
    async (page) => {
      const places = await page.evaluate(() => {
        const { position } = viewer.panes[0].frame.points;
        const at = (i) =>
          viewer.camera.position
            .clone()
            .fromArray(position, 3 * i)
            .project(viewer.camera);
        return Array.from({ length: position.length / 3 }, (_, i) => ((1 - at(i).y) / 2) * viewer.size[1]);
      });
      const { y } = await page.locator(".legend").boundingBox();
      assert.ok(Math.max(...places) < y, "the legend does not cover the object");
    },
    phone,
  );
  // Bytes of every count modulo 3 are decoded, from files of 1 to 12 points; an empty one stops nothing.
  mkdirSync(join(folder, "few"));
  const few = Array.from({ length: 12 }, (_, n) =>
    Array.from({ length: 3 * (n + 1) }, (_, i) => ((7 * i * i + n) % 50) / 8),
  );
  few.forEach((numbers, n) => {
    const lines = numbers.flatMap((x, i) => (i % 3 ? [] : [`${x} ${numbers[i + 1]} ${numbers[i + 2]}\n`]));
    write(`few/${String(n).padStart(2, "0")}.xyz`, lines.join(""));
  });
  write("few/05a.xyz", "");
  few.splice(6, 0, []);
  await check("few", "few", async (page) => {
    assert.equal(await page.evaluate(() => viewer.nFrames), few.length);
    for (const [n, numbers] of few.entries()) {
      assertNear((await pointsOf(page, n)).position, numbers, 0.004, `frame ${n}`);
    }
  });
  // Facts of a point are those of its file, also in a map's frame.
  write("map.xyz", "691000.5 5336000.25 515\n691001.5 5336000.25 515\n691000.5 5336001.25 516\n");
  await check("map", "map.xyz", async (page) => {
    const at = await page.evaluate(() => {
      const { position } = viewer.panes[0].frame.points;
      const { x, y } = viewer.camera.position.clone().fromArray(position).project(viewer.camera);
      return [((x + 1) / 2) * viewer.size[0], ((1 - y) / 2) * viewer.size[1]];
    });
    await page.mouse.click(at[0], at[1]);
    assert.match(await page.textContent(".facts"), /x \(m\)691000\.50?.*y \(m\)5336000\.25.*z \(m\)515/s);
  });
  run("gen-scenes --drive 0.5 --seed 3 --out drive.pcap");
  write("live.jsonl", run("live --pcap drive.pcap --poses drive.tum --json --mcap drive.mcap").out);
  await check("live", "drive.pcap live.jsonl", async (page) => {
    assert.match(await page.textContent("output"), /^turn \d+ \(\d+ of [56]\)$/);
    assert.ok((await page.evaluate(() => viewer.panes[0].frame.boxes.length)) > 3, "it opens on a frame with boxes");
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowRight");
    // What stands has no trail, although the sensor drives.
    const steps = await page.evaluate(() => {
      const { instanceStart, instanceEnd } = viewer.panes[0].stage.parts.trails[0].geometry.attributes;
      return Array.from({ length: instanceStart.count }, (_, i) =>
        Math.hypot(...["getX", "getY"].map((of) => instanceStart[of](i) - instanceEnd[of](i))),
      ).sort((a, b) => a - b);
    });
    assert.ok(steps.length > 3 && steps[Math.floor(steps.length / 2)] < 0.25, steps.join());
    assert.match(await legend(page), /^ring[^≤]*≥ \d/, "a few of the highest rings have the last colour");
    const columns = await pointsOf(page, 1);
    for (const name of ["reflectivity", "ring", "time"]) assert.ok(new Set(columns[name]).size > 9, name);
  });
  const bytes = text("live.html").length;
  assert.ok(bytes < 0.7e6 + 14e6 / 10, `5 s of a drive take 15 MB at most: 0.5 s takes ${bytes}`);
  // A recording has the points of the capture, and the boxes of the lines that have a class.
  const hasClass = (box) => box.class && box.class !== "unknown";
  const of = (name) => {
    const { panes } = JSON.parse(text(`${name}.html`).split('id="data">')[1].split("</script>")[0]);
    return panes[0].frames.map((frame) => ({ ...frame, boxes: frame.boxes.filter(hasClass) }));
  };
  await check("mcap", "drive.mcap", async (page) => {
    const countOf = (frame) => frame.points.columns[0] && frame.boxes.length;
    const sums = [of("mcap"), of("live")].map((frames) => frames.reduce((sum, frame) => sum + countOf(frame), 0));
    assert.equal(sums[0], sums[1]);
    const boxes = ["mcap", "live"].map((name) => of(name).flatMap((frame) => frame.boxes));
    const [here, there] = boxes.map((list) => new Map(list.map((box) => [box.track, box])));
    for (const [track, { centre, yaw }] of here) {
      assertNear(centre, there.get(track).centre, 0.6, `track ${track}`);
      assert.ok(Math.abs(Math.sin(yaw - there.get(track).yaw)) < 0.05, `track ${track}`);
    }
    const column = (await pointsOf(page, 1)).ring;
    assert.ok(new Set(column).size > 20);
  });
  // The points of a drive lie in the boxes of its truth, which are in the world's frame.
  await check("truth", "drive.pcap --truth drive.truth.jsonl", async (page) => {
    const truth = text("drive.truth.jsonl")
      .trim()
      .split("\n")
      .map((line) => JSON.parse(line));
    const { position } = await pointsOf(page, 1);
    const boxes = await page.evaluate(() => viewer.data.panes[0].frames[1].boxes);
    assert.ok(boxes.length > 10);
    for (const { centre, size, yaw, track } of boxes) {
      const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
      let inside = 0;
      for (let i = 0; i < position.length; i += 3) {
        const [x, y, z] = centre.map((middle, axis) => position[i + axis] - middle);
        const own = [cos * x + sin * y, cos * y - sin * x, z];
        if (own.every((off, axis) => Math.abs(off) < 0.5 * size[axis] + 0.5)) inside += 1;
      }
      const { points } = truth.find(({ turn, object }) => turn === 1 && object === track);
      assert.ok(inside >= points, `${track}: ${inside} of ${points}`);
    }
  });
  // A mesh in millimetres lies under its scan in metres.
  const corner = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
    [i & 1, (i >> 1) & 1, i >> 2].map((x, axis) => x * [900, 600, 400][axis]).join(" "),
  );
  const quads = ["0 2 3 1", "4 5 7 6", "0 1 5 4", "2 6 7 3", "0 4 6 2", "1 3 7 5"];
  write("part.off", `OFF\n8 6 0\n${corner.join("\n")}\n4 ${quads.join("\n4 ")}\n`);
  run("scan part.off --units mm --out part.ply");
  await check("part", "part.off part.ply", async (page) => {
    const panes = await page.evaluate(() =>
      viewer.data.panes.map(({ frames: [{ meshes, points }] }) => [meshes.length, points.position.length]),
    );
    assert.equal(panes.length, 1);
    assert.ok(panes[0][0] === 1 && panes[0][1] > 300);
    const most = await page.evaluate(() => Math.max(...viewer.panes[0].frame.meshes[0].position));
    assert.ok(Math.abs(most - 0.9) < 1e-6, `${most}`);
    assert.match(await legend(page), /^range/);
  });
  const drawn = await picture("part.off part.ply");
  assert.ok(shareOf(drawn, [255, 255, 255], 0) < 0.8, "the mesh fills the picture");
  // Folders of meshes and of data sets have a frame for each file, by its name.
  run("gen-dataset meshes --out set --views 2 --noise 0.01");
  for (const name of ["meshes", "set"]) {
    await check(name, name, async (page) => {
      const names = await page.evaluate(() => viewer.data.panes[0].frames.map(({ name }) => name));
      assert.ok(names.length >= 20 && names.every((name) => name.includes("/")), names.join());
    });
  }
  // A packed set is viewed unless it is damaged.
  await check("set-packed", "set/packed/static-noisy-train.npz", async (page) =>
    assert.ok(await page.evaluate(() => viewer.nFrames > 1)),
  );
  const packed = readFileSync(join(folder, "set/packed/static-noisy-train.npz"));
  for (let at = packed.indexOf("points.npy"); at >= 0; at = packed.indexOf("points.npy", at)) packed[at] = 106;
  write("damaged.npz", packed);
  const refused = attempt("view damaged.npz --out damaged.html");
  assert.ok(refused.code === 1 && /expected a packed set of labelled clouds/.test(refused.said), refused.said);
  assert.throws(() => text("damaged.html"));
  // A label ends no element of a page.
  const sensor = '[[sensor]]\nprofile = "vlp16"\nposition_m = [3, 0, 1]\nlook_at_m = [0, 0, 0]\n';
  write("tag.toml", `[[object]]\nmesh = "part.off"\nunits = "mm"\nlabel = "</script>"\n${sensor}`);
  await check("tag", "tag.toml", async (page) => {
    assert.equal(await page.evaluate(() => viewer.panes[0].frame.meshes[0].class), "</script>");
  });
  // A picture shows the first of what a page shows, or the first with boxes.
  const nBoxes = of("truth")[0].boxes.length;
  for (const [words, expected] of [
    ["part.off", /1 mesh: p\.png/],
    ["part.off part.ply", / points, 1 mesh: p\.png/],
    [
      "drive.truth.jsonl",
      new RegExp(`${text("drive.truth.jsonl").match(/"turn":0,/g)?.length ?? nBoxes} boxes: p\\.png`),
    ],
    ["drive.pcap drive.truth.jsonl", / points, \d+ boxes: p\.png/],
    ["drive.pcap live.jsonl", / points, \d+ boxes: p\.png/],
    ["drive.mcap", / points, \d+ boxes: p\.png/],
  ]) {
    assert.match(run(`view ${words} --overwrite --out p.png`).said, expected);
  }
  // Boxes that are far outside change nothing, and of any few points there is a picture, always the same.
  const bytesOf = (words) => {
    run(`view ${words} --overwrite --out p.png`);
    return readFileSync(join(folder, "p.png"), "base64");
  };
  const boxAt = (x) => {
    const box = { position_m: [x, 0, 0], size_m: [4, 2, 1.5], yaw_deg: 30 };
    write("box.json", JSON.stringify({ objects: [box] }));
    return bytesOf("street/sweeps/000000.npz box.json");
  };
  assert.equal(boxAt(9000), bytesOf("street/sweeps/000000.npz"));
  assert.notEqual(boxAt(4), boxAt(9000));
  for (const points of ["1 2 3\n", "1 2 3\n4 5 6\n", "0 0 0\n1e30 1e30 1e30\n-1e30 -1e30 -1e30\n"]) {
    write("any.xyz", points);
    assert.equal(bytesOf("any.xyz"), bytesOf("any.xyz"));
    const { width, height } = await picture("any.xyz");
    assert.ok(width >= 300 && width <= 1000 && height >= 300 && height <= 800);
  }
  // Boxes in the world's frame need the motion of the sensor in this drive, and not in another.
  run("gen-scenes --drive 0.5 --seed 4 --out other.pcap");
  write("drive.tum", text("other.tum"));
  assert.match(
    attempt("view drive.pcap drive.truth.jsonl --out a.html").said,
    /boxes of drive\.pcap, whose poses in drive\.tum are from .* are the boxes or the poses of another/,
  );
  rmSync(join(folder, "drive.tum"));
  assert.match(
    attempt("view drive.pcap drive.truth.jsonl --out a.html").said,
    /no poses of the sensor in drive\.tum: copy them/,
  );
  // A picture shows what is there: a yard of 10 m or one of 100 m fill it alike.
  for (const size of [10, 100]) {
    const rows = Array.from({ length: 900 }, (_, i) => [(i % 30) - 14.5, Math.floor(i / 30) - 14.5, 0.02 * (i % 7)]);
    write("yard.xyz", `${rows.map(([x, y, z]) => `${(x * size) / 29} ${(y * size) / 29} ${z}`).join("\n")}\n`);
    const { width, height, pixels } = await picture("yard.xyz");
    const inked = Array.from({ length: width * height }, (_, i) => i).filter(
      (i) => pixels[4 * i] < 250 || pixels[4 * i + 1] < 250,
    );
    const columns = inked.map((i) => i % width);
    const span =
      columns.reduce((most, x) => Math.max(most, x), 0) - columns.reduce((least, x) => Math.min(least, x), width);
    assert.ok((width === 1000 || height === 800) && span > 0.85 * width, `${size} m: ${span} of ${width} pixels`);
  }
  await check("clusters", "clusters", async (page) => assert.match(await legend(page), /cluster/));
  await check("scene", "scene.toml", async (page) => {
    const parts = await page.evaluate(() => Object.keys(viewer.panes[0].stage.parts).sort());
    assert.deepEqual(parts, ["beams", "grid", "meshes", "points", "sensors"]);
    assertAtSensor(await sensorIn(page));
    await page.selectOption("select[name=colour]", "object");
    assert.match(await legend(page), /near_chair.*far_table|far_table.*near_chair/s);
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
