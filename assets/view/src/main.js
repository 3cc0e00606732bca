// The parts of the viewer that pages call, as EdgepuckViewer.
import { unzlibSync } from "three/addons/libs/fflate.module.js";
import { createViewer } from "./viewer.js";

export { createViewer };

const TYPES = { f32: Float32Array, u8: Uint8Array, u16: Uint16Array, u32: Uint32Array };

/** The latter is slower, and for browsers before 2025. */
const bytesOf = (base64) =>
  Uint8Array.fromBase64?.(base64) ?? Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));

/**
 * The numbers `low + step * n` of whole numbers n, in turn for each `low`, or bits of f32 if the step is 0. Of the
 * whole numbers, `z` has the differences, the lowest bytes of all first. The number `i` goes to the place `order[i]`.
 */
function unpacked({ low, step, z }, order) {
  const bytes = unzlibSync(bytesOf(z));
  const [count, axes] = [bytes.length / 4, low.length];
  const each = count / axes;
  const isWhole = axes === 1 && (step === 0 || (step === 1 && low[0] === 0));
  const values = new (isWhole ? Uint32Array : Float32Array)(count);
  let last = 0;
  for (let i = 0; i < count; i++) {
    const folded = bytes[i] | (bytes[count + i] << 8) | (bytes[2 * count + i] << 16) | (bytes[3 * count + i] << 24);
    last = (last + ((folded >>> 1) ^ -(folded & 1))) >>> 0;
    const axis = Math.floor(i / each);
    const place = order ? order[i - axis * each] : i - axis * each;
    values[axes * place + axis] = isWhole ? last : low[axis] + step * last;
  }
  return step === 0 ? new Float32Array(values.buffer) : values;
}

/** Points whose numbers are in the order of their rings. */
function unpackPoints(points) {
  const ring = points.columns.find((column) => column.name === "ring");
  if (ring) ring.values = unpacked(ring.values);
  const order = ring && Uint32Array.from(ring.values.keys()).sort((a, b) => ring.values[a] - ring.values[b] || a - b);
  for (const column of points.columns) if (column !== ring) column.values = unpacked(column.values, order);
  return { ...points, position: unpacked(points.position, order), step: points.position.step };
}

/** The data of a page of `edgepuck view`: JSON in which `{ "f32": "…" }` has numbers in base64. */
export function decode(json) {
  return JSON.parse(json, (_, value) => {
    if (value?.columns && value.position?.z) return unpackPoints(value);
    const type = value && Object.keys(TYPES).find((name) => typeof value[name] === "string");
    return type ? new TYPES[type](bytesOf(value[type]).buffer) : value;
  });
}

/** Shows the data in the element `dataId` of this page, in the element `id`. */
export function show(id, dataId) {
  const [element, holder] = [id, dataId].map((name) => document.getElementById(name));
  try {
    const data = decode(holder.textContent);
    holder.remove();
    return createViewer(element, data);
  } catch (error) {
    element.style = "color: white; padding: 1em; font: 16px sans-serif";
    element.textContent = `This browser cannot show the page: ${error}`;
  }
}
