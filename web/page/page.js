// The page: its settings, the link that holds them, and what the worker answers.

/* global EdgepuckViewer */

const $ = (id) => document.getElementById(id);

function tag(name, properties = {}, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

const worker = new Worker("worker.js", { type: "module" });

/** The worker's answer to a request, of which there is one at a time; an error in words if it has none. */
function ask(request) {
  return new Promise((resolve, reject) => {
    worker.onmessage = ({ data }) => (data.error === undefined ? resolve(data.reply) : reject(data.error));
    worker.onerror = ({ message }) => reject(`This browser cannot run the page: ${message ?? "no WebAssembly"}`);
    worker.postMessage(request);
  });
}

const RETURNS = {
  "": "ideal beams",
  strongest: "strongest",
  first: "first",
  last: "last",
  dual: "dual: last and strongest",
};
const MODELS = {
  "edge-64": "edge-64: whole objects, 40 classes",
  "shapes-rotational-64": "shapes-rotational-64: scans, 10 classes",
};
const RUNS = { auto: "GPU, or else the CPU", webgpu: "WebGPU", cpu: "CPU" };

/** The settings: a name in the link, a label, and choices, or a range with its unit. */
function fields({ sensors, subjects }) {
  const same = (names) => Object.fromEntries(names.map((name) => [name, name]));
  return [
    { name: "mesh", label: "Object", value: "chair", options: same(subjects) },
    { name: "sensor", label: "Sensor", value: "vlp32c", options: same(sensors) },
    { name: "distance", label: "Distance, in the object's radii", value: 3, min: 1.2, max: 40, step: 0.1, unit: "" },
    { name: "elevation", label: "Elevation", value: 20, min: -80, max: 80, step: 1, unit: "°" },
    { name: "azimuth", label: "Azimuth", value: 215, min: 0, max: 359, step: 1, unit: "°" },
    { name: "noise", label: "Noise of the range", value: 0, min: 0, max: 0.1, step: 0.001, unit: " m" },
    { name: "rain", label: "Rain", value: 0, min: 0, max: 100, step: 1, unit: " mm/h" },
    { name: "fog", label: "Visibility in fog", value: 0, min: 0, max: 300, step: 5, unit: " m", zero: "no fog" },
    { name: "returns", label: "Returns", value: "", options: RETURNS },
    { name: "model", label: "Network", value: "edge-64", options: MODELS },
    { name: "run", label: "Cast on", value: "auto", options: RUNS },
  ];
}

/** The file of the user, in place of the mesh that is built in. */
let file;
const controls = {};

const chosen = (name) => controls[name].value;
const settings = () => ({
  sensor: chosen("sensor"),
  distance_m: Number(chosen("distance")),
  elevation_deg: Number(chosen("elevation")),
  azimuth_deg: Number(chosen("azimuth")),
  noise_m: Number(chosen("noise")),
  rain_mm_h: Number(chosen("rain")),
  fog_m: Number(chosen("fog")),
  returns: chosen("returns") || null,
});

const choices = (options) =>
  Object.entries(options).map(([value, textContent]) => tag("option", { value, textContent }));

function drawFields(all) {
  const link = new URLSearchParams(location.hash.slice(1));
  const rows = all.map(({ name, label, value, options, unit, zero, ...range }) => {
    const control = options ? tag("select", {}, ...choices(options)) : tag("input", { type: "range", ...range });
    Object.assign(control, { id: name, name, value });
    control.dataset.usual = control.value;
    const wished = link.get(name);
    // What the link asks for and is not there stays as usual.
    if (wished !== null && (options || Number.isFinite(Number.parseFloat(wished)))) control.value = wished;
    if (control.value === "" && wished !== "") control.value = control.dataset.usual;
    controls[name] = control;
    const text = tag("output", { htmlFor: name });
    const show = () => {
      text.value = options ? "" : zero && Number(control.value) === 0 ? zero : `${control.value}${unit}`;
    };
    control.addEventListener("input", show);
    show();
    return tag("div", { className: "field" }, tag("label", { htmlFor: name, textContent: label }), text, control);
  });
  $("fields").replaceChildren(...rows);
}

/** Shows the settings of objects, which scenes lack: their sensors have places of their own. */
function showFields(isObject) {
  for (const name of ["distance", "elevation", "azimuth", "model"]) {
    controls[name].closest(".field").hidden = !isObject;
  }
}

/** The link: what differs from the usual settings. */
function link() {
  const isChanged = ({ name, value, dataset }) => value !== dataset.usual && !(name === "mesh" && file);
  const changed = Object.entries(controls).filter(([, control]) => isChanged(control));
  const words = new URLSearchParams(changed.map(([name, control]) => [name, control.value])).toString();
  return words ? `#${words}` : location.pathname + location.search;
}

const data = { scan: undefined, mesh: undefined };

/** What the viewer shows: the points with their columns, the mesh, and the sensor. */
function pane({ scan }, name, sensor) {
  const { positions, range, ring, intensity, object, pose } = scan;
  const columns = [
    { name: "range", unit: "m", kind: "number", values: range },
    { name: "intensity", kind: "number", values: intensity },
    { name: "ring", kind: "number", values: ring },
  ];
  const names = [...new Set(scan.labels)];
  if (names.length > 1) {
    const place = scan.labels.map((label) => names.indexOf(label));
    names.push("air");
    const values = object.map((number) => place[number] ?? names.length - 1);
    columns.unshift({ name: "class", kind: "class", values, names: names.map((label) => label || "ground") });
  }
  const points = { position: positions, columns };
  const meshes = data.mesh?.index.length ? [data.mesh] : [];
  // Beside an object, its sensor would make it small.
  const sensors = meshes.length ? [] : [{ name: sensor, pose: Array.from(pose) }];
  return { name, frames: [{ name, points, sensors, meshes }] };
}

let viewer;
function draw(reply, { subject: { name }, settings: { sensor } }, isNew) {
  if (isNew) data.mesh = reply.scan.mesh;
  const shown = { panes: [pane(reply, name, sensor)] };
  if (viewer) viewer.setData(shown, { fit: isNew });
  else viewer = EdgepuckViewer.createViewer($("viewer"), shown);
}

const whole = (number) => number.toLocaleString("en");
const ms = (number) => `${number.toFixed(number < 10 ? 1 : 0)} ms`;

function say({ scan, answer, castMs, classMs, place }, name) {
  const nPoints = scan.range.length;
  const found = answer && `${answer.class} ${(100 * answer.probability).toFixed(0)} %`;
  $("class").textContent = found ?? (nPoints ? name : "no point: nothing is in view");
  const facts = [`${whole(nPoints)} points`, `cast in ${ms(castMs)} on ${place}`];
  if (answer) facts.push(`named in ${ms(classMs)} on the CPU`);
  $("facts").textContent = facts.join(" · ");
}

function fail(words) {
  $("error").textContent = words ?? "";
  $("error").hidden = !words;
}

let shownSubject;
let isBusy = false;
let isStale = false;

/** Scans by the current settings; once more afterwards if they change meanwhile. */
async function update() {
  isStale = true;
  if (isBusy) return;
  isBusy = true;
  document.body.dataset.state = "busy";
  while (isStale) {
    isStale = false;
    const subject = file ?? { name: chosen("mesh"), key: chosen("mesh") };
    const isNew = shownSubject !== subject.key;
    const request = { runs: chosen("run"), model: chosen("model"), subject, settings: settings(), wantsMesh: isNew };
    try {
      const reply = await ask(request);
      shownSubject = subject.key;
      fail(reply.warnings.join("\n"));
      if (isNew) showFields(reply.scan.mesh.index.length > 0);
      say(reply, subject.name);
      draw(reply, request, isNew);
    } catch (error) {
      fail(`${error}`);
      if (shownSubject === subject.key && !(typeof error === "string")) continue;
      $("class").textContent = "not scanned";
      $("facts").textContent = "";
    }
  }
  isBusy = false;
  document.body.dataset.state = "idle";
}

let nFiles = 0;
async function take(given) {
  if (!given) return;
  file = { name: given.name, bytes: new Uint8Array(await given.arrayBuffer()), key: `file ${nFiles++}` };
  // The same file can be chosen again, and a mesh that is built in after it.
  $("file").value = "";
  controls.mesh.value = "";
  await update();
}

function listen() {
  // A GPU opens a device for each value of these, so that only the one that is chosen counts.
  const areEffects = [controls.noise, controls.rain, controls.fog];
  $("controls").addEventListener("input", ({ target }) => {
    if (target === $("file") || areEffects.includes(target)) return;
    if (target === controls.mesh) file = undefined;
    update();
  });
  $("controls").addEventListener("change", ({ target }) => {
    // Not at each step of a slider: browsers limit how often.
    history.replaceState(null, "", link());
    if (areEffects.includes(target)) update();
  });
  $("controls").addEventListener("submit", (event) => event.preventDefault());
  $("file").addEventListener("change", () => take($("file").files[0]));
  for (const kind of ["dragenter", "dragover", "dragleave", "drop"]) {
    document.addEventListener(kind, (event) => {
      event.preventDefault();
      $("drop").classList.toggle("over", kind === "dragenter" || kind === "dragover");
    });
  }
  document.addEventListener("drop", ({ dataTransfer }) => take(dataTransfer.files[0]));
  addEventListener("hashchange", () => location.reload());
  $("copy").addEventListener("click", async () => {
    await navigator.clipboard.writeText(new URL(link(), location.href).href);
    $("copy").textContent = "Copied";
  });
}

try {
  drawFields(fields(await ask({ lists: true })));
  listen();
  await update();
  document.body.dataset.firstPictureMs = performance.now();
} catch (error) {
  $("class").textContent = "The page does not run here";
  fail(`${error}`);
}
