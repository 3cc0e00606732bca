// Scans and classifies beside the page, so that the page answers meanwhile.
import init, { Simulator } from "./edgepuck_web.js";

const ready = init();
let simulator;
/** What the simulator has: the processor, the subject and the network that were asked for. */
let has = {};

/** Opens what casts: WebGPU, or the CPU where there is none. Returns what to call it. */
async function open(runs) {
  const adapter = runs === "cpu" ? undefined : await navigator.gpu?.requestAdapter();
  const { description, vendor, architecture, isFallbackAdapter } = adapter?.info ?? {};
  const name = description || `${vendor} ${architecture}`;
  if (adapter && (runs === "webgpu" || !isFallbackAdapter)) {
    try {
      simulator = await Simulator.open("");
      return `WebGPU (${name})`;
    } catch (error) {
      simulator = await Simulator.open("cpu");
      return `CPU (WebGPU failed: ${error})`;
    }
  }
  simulator = await Simulator.open("cpu");
  const why = { cpu: "as chosen", auto: "no GPU here", webgpu: "no WebGPU here" }[runs];
  return `CPU (${why})`;
}

async function take({ runs, subject, model }) {
  if (has.runs !== runs) {
    has = {};
    simulator?.free();
    simulator = undefined;
    has = { place: await open(runs), runs };
  }
  if (has.subject !== subject.key) {
    has.subject = undefined;
    const { name, bytes } = subject;
    has.warnings = bytes ? simulator.take_file(name, bytes) : simulator.take_built_in(name);
    has.subject = subject.key;
  }
  if (has.model !== model) {
    const file = await fetch(`${model}.safetensors`).catch(() => undefined);
    if (!file?.ok) throw `${model}: the server answers ${file?.status ?? "nothing"}`;
    simulator.take_model(new Uint8Array(await file.arrayBuffer()));
    has.model = model;
  }
}

/** The time of `work` in milliseconds, and its result. */
async function timed(work) {
  const start = performance.now();
  return [await work(), performance.now() - start];
}

async function answer(request) {
  await take(request);
  const [scanned, castMs] = await timed(() => simulator.scan(JSON.stringify(request.settings)));
  const [found, classMs] = await timed(() => simulator.classify(scanned));
  const columns = ["positions", "range", "ring", "object", "intensity", "pose"];
  const scan = Object.fromEntries(columns.map((name) => [name, scanned[name]]));
  scan.labels = scanned.labels.split(",");
  if (request.wantsMesh) scan.mesh = { position: simulator.mesh_positions(), index: simulator.mesh_indices() };
  const answer = found && { class: found.class, probability: found.probability };
  found?.free();
  scanned.free();
  return { scan, answer, castMs, classMs, place: has.place, warnings: has.warnings ?? [] };
}

addEventListener("message", async ({ data: request }) => {
  await ready;
  try {
    const lists = request.lists && { sensors: Simulator.sensors(), subjects: Simulator.built_ins() };
    const reply = lists ?? (await answer(request));
    const arrays = Object.values(reply.scan ?? {}).filter(ArrayBuffer.isView);
    const transfer = arrays.map((array) => array.buffer);
    postMessage({ reply }, transfer);
  } catch (error) {
    postMessage({ error: typeof error === "string" ? error : `This page has a fault: ${error}` });
    // After a panic, or a device that was lost, nothing of it can be used.
    if (typeof error !== "string" || error.startsWith("adapter ")) [has, simulator] = [{}, undefined];
  }
});
// Where it fails, the page hears of it as an error of the worker.
await ready;
