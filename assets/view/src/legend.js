// The words of the viewer as HTML: what colours mean, and what is known of a point or a box.
import { classColour, css, nameOf, rampCss } from "./colour.js";

const MOST_ENTRIES = 14;
const MARKS = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };

export const escaped = (text) => `${text}`.replace(/[&<>"]/g, (mark) => MARKS[mark]);

export const shown = (value) =>
  typeof value !== "number" || Number.isInteger(value) ? `${value}` : `${Number(value.toPrecision(5))}`;

const entry = (colour, name, count = "") =>
  `<div class="entry"><i style="background:${css(colour)}"></i>${escaped(name)}<small>${count}</small></div>`;

export const titleOf = ({ name, unit }) => (unit ? `${name} (${unit})` : name);

/** The legend of a coloured column. */
export function scaleHtml(column) {
  const { scale } = column;
  const title = `<b>${escaped(titleOf(column))}</b>`;
  if (!scale.entries) {
    const { low, high, hasLess, hasMore } = scale;
    const signs = [hasLess ? "≤ " : "", "", hasMore ? "≥ " : ""];
    const marks = [low, (low + high) / 2, high].map((x, i) => signs[i] + Number(x.toPrecision(3)));
    const ramp = `<div class="ramp" style="background:${rampCss}"></div>`;
    return `${title}<div>${ramp}<div class="marks"><span>${marks.join("</span><span>")}</span></div></div>`;
  }
  const entries = scale.entries.slice(0, MOST_ENTRIES).map(({ value, count }) => {
    return entry(scale.look(value), nameOf(column, value), count.toLocaleString("en"));
  });
  const more = scale.entries.length - entries.length;
  return title + entries.join("") + (more > 0 ? `<small>and ${more} more</small>` : "");
}

/** The legend of boxes, without the classes that that of points has. */
export function boxesHtml(boxes, columns) {
  const isColumn = (name) => columns.some(({ kind, names }) => kind === "class" && names?.includes(name));
  const classes = [...new Set(boxes.map((box) => box.class))].filter((name) => name && !isColumn(name)).sort();
  const [found, truth] = [boxes.some((box) => !box.truth), boxes.some((box) => box.truth)];
  const kinds = [found && "lines: found", truth && "dashes: truth"].filter(Boolean).join(", ");
  const entries = classes.map((name) => entry(classColour(name), name)).join("");
  return boxes.length ? `<b>boxes</b>${entries}<small>${kinds}</small>` : "";
}

/** The legend of meshes without points. */
export function meshesHtml(meshes) {
  const named = new Map(meshes.map((mesh) => [mesh.class ?? mesh.name, mesh.colour]));
  const entries = [...named].slice(0, MOST_ENTRIES).map(([name, colour]) => entry(colour, name));
  const more = named.size - entries.length;
  return entries.length > 1
    ? `<b>meshes</b>${entries.join("")}${more > 0 ? `<small>and ${more} more</small>` : ""}`
    : "";
}

/** A table of names and values. */
export function factsHtml(title, facts) {
  const text = (value) => escaped(Array.isArray(value) ? value.map(shown).join(", ") : shown(value));
  const known = facts.filter(([, value]) => value !== null && value !== undefined);
  const rows = known.map(([name, value]) => `<tr><th>${escaped(name)}</th><td>${text(value)}</td></tr>`);
  return `<b>${escaped(title)}</b><table>${rows.join("")}</table>`;
}
