// The parts of the viewer that pages call, as EdgepuckViewer.
import { createViewer } from "./viewer.js";

export { createViewer };

const TYPES = { f32: Float32Array, u8: Uint8Array, u16: Uint16Array, u32: Uint32Array };

/** The latter is slower, and for browsers before 2025. */
const bytesOf = (base64) =>
  Uint8Array.fromBase64?.(base64) ?? Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));

/** The data of a page of `edgepuck view`: JSON in which `{ "f32": "…" }` has numbers in base64. */
export function decode(json) {
  return JSON.parse(json, (_, value) => {
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
