// Colours of points and boxes. The one table is colours.json, which the Rust programs read, too.
import table from "../colours.json";

const rgb = (hex) => [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));
const ramp = table.ramp.map(rgb);
const palette = table.palette.map(rgb);

export const css = ([red, green, blue]) => `rgb(${red}, ${green}, ${blue})`;
export const rampCss = `linear-gradient(to right, ${table.ramp.join(", ")})`;

/** The colour of the object, cluster or track with this number. */
export const numberColour = (number) => palette[number % palette.length];

/** The colour of a class, the same in all pictures: of one that the table lacks, by its name. */
export function classColour(name) {
  const known = table.classes[name];
  if (known) return rgb(known);
  // FNV-1a, as in Rust.
  let hash = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(name)) {
    hash = Math.imul(hash ^ byte, 0x01000193) >>> 0;
  }
  return numberColour(hash);
}

/** What a column's values look like: limits of a ramp, or entries of a legend. */
export function scaleOf(column) {
  const { values } = column;
  if (column.kind === "number") {
    const sample = [];
    const step = Math.max(1, Math.floor(values.length / 20000));
    for (let i = 0; i < values.length; i += step) {
      if (Number.isFinite(values[i])) sample.push(values[i]);
    }
    sample.sort((a, b) => a - b);
    const at = (share) => sample[Math.round(share * (sample.length - 1))] ?? 0;
    const [low, high] = [at(0.01), at(0.99)];
    return high > low ? { low, high } : { low: low - 0.5, high: low + 0.5 };
  }
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) ?? 0) + 1);
  const entries = [...counts].sort((a, b) => b[1] - a[1]);
  return { entries: entries.map(([value, count]) => ({ value, count })) };
}

export const nameOf = (column, value) => column.names?.[value] ?? `${value}`;

/** The colour of one value on a scale. */
export function colourOf(column, scale, value) {
  if (column.kind === "class") return classColour(nameOf(column, value));
  if (column.kind === "id") return value === 0xffffffff ? classColour("air") : numberColour(value);
  if (!Number.isFinite(value)) return [150, 150, 150];
  const share = Math.min(1, Math.max(0, (value - scale.low) / (scale.high - scale.low)));
  const place = share * (ramp.length - 1);
  const [left, right] = [ramp[Math.floor(place)], ramp[Math.ceil(place)]];
  return left.map((x, i) => Math.round(x + (right[i] - x) * (place % 1)));
}

/** Fills `out`, three bytes a point, with the colours of a column. */
export function paint(column, scale, out) {
  const { values } = column;
  const known = new Map();
  const steps = 255;
  const table =
    scale.entries ??
    Array.from({ length: steps + 1 }, (_, i) =>
      colourOf(column, scale, scale.low + (i / steps) * (scale.high - scale.low)),
    );
  if (scale.entries) for (const { value } of table) known.set(value, colourOf(column, scale, value));
  const grey = [150, 150, 150];
  const factor = steps / (scale.high - scale.low);
  for (let i = 0; i < values.length; i++) {
    const place = Math.round((values[i] - scale.low) * factor);
    const found = scale.entries ? known.get(values[i]) : table[Math.min(steps, Math.max(0, place))];
    const [red, green, blue] = found ?? grey;
    out[3 * i] = red;
    out[3 * i + 1] = green;
    out[3 * i + 2] = blue;
  }
}
