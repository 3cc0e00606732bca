// Colours of points and boxes. The one table is colours.json, which the Rust programs read, too.
import table from "../colours.json";

const rgb = (hex) => [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));
const ramp = table.ramp.map(rgb);
const palette = table.palette.map(rgb);
const GREY = [150, 150, 150];
const SHADES = 256;
const MOST_SAMPLED = 20000;

export const css = ([red, green, blue]) => `rgb(${red}, ${green}, ${blue})`;
export const rampCss = `linear-gradient(to right, ${table.ramp.join(", ")})`;

/** The colour of the object, cluster or track with this number. */
export const numberColour = (number) => palette[number % palette.length];

/** The colour of a class, the same in all pictures: of one that the table lacks, by its name. */
export function classColour(name) {
  const known = table.classes[name];
  // FNV-1a, as in Rust.
  const mix = (hash, byte) => Math.imul(hash ^ byte, 0x01000193) >>> 0;
  return known ? rgb(known) : numberColour(new TextEncoder().encode(name).reduce(mix, 0x811c9dc5));
}

export const nameOf = ({ names }, value) => names?.[value] || (value === 0xffffffff ? "air" : `${value}`);

/** How a column's values become colours, by `look`: from `low` to `high`, or each of `entries` its own. */
export const scaleOf = (column, span) => (column.kind === "number" ? rampOf(span) : entriesOf(column));

function entriesOf(column) {
  const counts = new Map();
  for (const value of column.values) counts.set(value, (counts.get(value) ?? 0) + 1);
  const entries = [...counts].sort((a, b) => b[1] - a[1]).map(([value, count]) => ({ value, count }));
  const colour = (value) => {
    if (column.kind === "class") return classColour(nameOf(column, value));
    return value === 0xffffffff ? classColour("air") : numberColour(value);
  };
  const colours = new Map(entries.map(({ value }) => [value, colour(value)]));
  return { entries, look: (value) => colours.get(value) };
}

/** Whether colours by this column would differ. */
export const varies = ({ values }) => values.some((value) => value !== values[0] && !Number.isNaN(value));

/** The span of the colours of these columns without the least and the greatest values: a few far ones would
 * take all colours. Then, whether there are lesser and greater ones. */
export function spanOf(columns) {
  const step = Math.ceil(columns.reduce((sum, { values }) => sum + values.length, 0) / MOST_SAMPLED);
  const isSampled = (value, i) => i % step === 0 && Number.isFinite(value);
  const sample = Float64Array.from(columns.flatMap(({ values }) => [...values.filter(isSampled)])).sort();
  const [low, high] = [0.02, 0.96].map((share) => sample[Math.round(share * (sample.length - 1))] ?? 0);
  return high > low ? [low, high, sample[0] < low, sample.at(-1) > high] : [low - 0.5, low + 0.5];
}

function rampOf([low, high, hasLess, hasMore]) {
  const shades = Array.from({ length: SHADES }, (_, i) => {
    const place = (i / (SHADES - 1)) * (ramp.length - 1);
    const [left, right] = [ramp[Math.floor(place)], ramp[Math.ceil(place)]];
    return left.map((x, j) => Math.round(x + (right[j] - x) * (place % 1)));
  });
  const factor = (SHADES - 1) / (high - low);
  const look = (value) => shades[Math.min(SHADES - 1, Math.max(0, Math.round((value - low) * factor)))] ?? GREY;
  return { low, high, hasLess, hasMore, look };
}
