import * as THREE from "three";
import { css, spanOf, varies } from "./colour.js";
import { boxesHtml, escaped, factsHtml, meshesHtml, scaleHtml, shown, titleOf } from "./legend.js";
import { Navigation } from "./navigation.js";
import { pick } from "./picking.js";
import { boxColour, columnsOf, corners, drawSpan, extentOf, placeOf, pointMaterial, Stage } from "./stage.js";
import style from "./viewer.css";

/**
 * Draws points, meshes, boxes and sensors in `element`, and returns the viewer.
 *
 *     const viewer = EdgepuckViewer.createViewer(element, data);
 *     viewer.setData(data);            // the camera and the chosen colour stay
 *     viewer.setData(data, { fit: true });
 *
 * `data` is `{ panes: [pane] }`, with one pane or two side by side. Lengths are in metres, z is up.
 * All but the names, `frames`, `position` and `columns` may be left out.
 *
 *     pane   { name, frames: [frame] }                      several frames get a slider
 *     frame  { name, points, meshes: [mesh], boxes: [box], sensors: [sensor] }
 *     points { position: Float32Array [3 n], origin: [x, y, z], columns: [column] }
 *     column { name, unit, kind: "number" | "class" | "id", values: typed array [n], names: [string] }
 *     mesh   { name, class, position: Float32Array [3 v], index: Uint32Array [3 t] }
 *     box    { class, centre: [x, y, z], size: [length, width, height], yaw: radians,
 *              score: 0 to 1, track: number, truth: boolean }
 *     sensor { name, pose: [16], 4 by 4 row by row, rays: Float32Array [6 r], start and end of each }
 *
 * Positions are relative to `origin`, by default 0. Values of a class are indices of `names`. The arrays
 * are used as they are, without a copy.
 */
export function createViewer(element, data = { panes: [] }) {
  const viewer = new Viewer(element);
  viewer.setData(data, { fit: true });
  return viewer;
}

/** The parts of these frames that can be hidden. */
function partsOf(frames) {
  const any = (name, is = () => true) => frames.some((frame) => frame[name]?.some(is));
  const [boxes, truth] = [any("boxes", (box) => !box.truth), any("boxes", (box) => box.truth)];
  const [meshes, sensors, beams] = [any("meshes"), any("sensors"), any("sensors", ({ rays }) => rays?.length)];
  const trails = frames.length > 1 && any("boxes", ({ track }) => Number.isInteger(track));
  const parts = { boxes, trails, truth, labels: boxes, meshes, beams, sensors, grid: true };
  return Object.keys(parts).filter((name) => parts[name]);
}

const USUAL_COLOURS = ["class", "cluster", "object", "ring", "range", "height"];
const MOST_LABELS = 60;
/** Frames before the shown one, through which trails go. */
const TRAIL = 20;
const PLAY_MS = 150;

const countOf = (frame) => (frame?.points?.position.length ?? 0) / 3;

class Viewer {
  constructor(element) {
    this.root = document.createElement("div");
    this.root.className = "edgepuck-viewer";
    this.root.innerHTML = `<style>${style}</style><canvas tabindex="0" aria-label="Points in three dimensions"></canvas><div class="labels"></div>
      <div class="bar"></div><div class="legend"></div><div class="facts" hidden></div>
      <div class="time"><button name="play">play</button><input type="range" name="frame"><output></output></div>`;
    const part = (name) => this.root.querySelector(name);
    [this.canvas, this.labels, this.bar] = [part("canvas"), part(".labels"), part(".bar")];
    [this.legend, this.facts, this.time] = [part(".legend"), part(".facts"), part(".time")];
    // Throws without WebGL, before anything is in the page.
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true });
    element.append(this.root);
    this.renderer.setClearColor(0x12161d);
    this.renderer.autoClear = false;
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.1, 1000);
    this.camera.up.set(0, 0, 1);
    this.navigation = new Navigation(this.camera, this.canvas, () => this.invalidate());
    [this.material, this.hidden, this.panes, this.views, this.frame] = [pointMaterial(), new Set(), [], [], 0];
    this.marker = new THREE.Points(new THREE.BufferGeometry(), pointMaterial());
    this.marker.material.depthTest = false;
    this.marker.frustumCulled = false;
    this.#listen();
  }

  /** The frame to begin with: the first with boxes and a half of the most points, or else points. */
  #firstFrame() {
    const most = Math.max(0, ...this.frames.map(countOf));
    const numbers = Array.from({ length: this.nFrames }, (_, i) => i);
    const at = (number, is) => this.data.panes.some(({ frames }) => frames[number] && is(frames[number]));
    const isFull = (frame) => 2 * countOf(frame) >= most;
    const hasBoxes = (frame) => isFull(frame) && frame.boxes?.some((box) => !box.truth);
    return Math.max(0, numbers.find((i) => at(i, hasBoxes)) ?? numbers.findIndex((i) => at(i, isFull)));
  }

  #listen() {
    const { canvas } = this;
    let down = [0, 0];
    canvas.addEventListener("pointerdown", ({ offsetX, offsetY }) => {
      down = [offsetX, offsetY];
      canvas.focus();
    });
    canvas.addEventListener("pointerup", ({ offsetX, offsetY, button }) => {
      const moved = Math.hypot(offsetX - down[0], offsetY - down[1]);
      if (moved < 4 && button === 0) this.pick(offsetX, offsetY);
    });
    window.addEventListener("keydown", (event) => {
      const { key, repeat, ctrlKey, metaKey, altKey, target } = event;
      if (ctrlKey || metaKey || altKey || (repeat && !key.startsWith("Arrow"))) return;
      if (target.closest?.("select, textarea, input:not([type=checkbox]), [contenteditable]")) return;
      if (key.startsWith("Arrow") && target === canvas) event.preventDefault();
      this.#press(key.toLowerCase());
    });
    window.addEventListener("blur", () => this.navigation.pressed.clear());
    window.addEventListener("keyup", ({ key }) => this.navigation.key(key.toLowerCase(), false));
    this.root.addEventListener("input", ({ target }) => this.#change(target));
    this.root.addEventListener("click", ({ target }) => this.#press(target.name));
    new ResizeObserver(() => this.#resize()).observe(this.root);
  }

  #press(what) {
    if (what === "reset" || what === "r") this.fit();
    else if (what === "save") this.save();
    else if (what === "fly" || what === "f") {
      this.navigation.fly(!this.navigation.flies);
      this.#drawBar();
    } else if (what === "play") {
      clearInterval(this.playing);
      const next = () => this.showFrame((this.frame + 1) % this.nFrames);
      this.playing = this.playing ? undefined : setInterval(next, PLAY_MS);
      this.#drawTime();
    } else if (what === "arrowright") this.showFrame(this.frame + 1);
    else if (what === "arrowleft") this.showFrame(this.frame - 1);
    else if (what) this.navigation.key(what, true);
  }

  #change({ name, value, checked }) {
    if (name === "colour") this.colourBy(value);
    else if (name === "frame") this.showFrame(Number(value));
    else if (name === "size") this.pixels = Number(value);
    else if (name === "cut") this.#cut(Number(value));
    else this.hidden[checked ? "delete" : "add"](name);
    this.#hide();
  }

  setData(data, { fit = false } = {}) {
    [this.data, this.frames, this.spans] = [data, data.panes.flatMap(({ frames }) => frames), {}];
    this.nFrames = Math.max(1, ...data.panes.map((pane) => pane.frames.length));
    this.time.hidden = this.nFrames < 2;
    // The first turn of a capture may have only a few points.
    const fullest = (frames) => frames.reduce((a, b) => (countOf(b) > countOf(a) ? b : a), frames[0] ?? {});
    this.extents = data.panes.map(({ frames }) => extentOf(fullest(frames)));
    this.names = this.#coloursOf(this.frames);
    this.frame = fit ? this.#firstFrame() : Math.min(this.frame, this.nFrames - 1);
    this.root.dataset.panes = data.panes.length;
    this.#stageFrames();
    this.#drawBar();
    this.#resize();
    if (fit) this.fit();
  }

  #stageFrames() {
    for (const { stage } of this.panes) stage.dispose();
    this.panes = this.data.panes.map(({ name, frames }, i) => {
      const frame = frames[Math.min(this.frame, frames.length - 1)] ?? {};
      this.extents[i] = this.#extentFor(frame, this.extents[i]);
      const before = frames.slice(Math.max(0, this.frame - TRAIL), this.frame);
      const colours = this.#coloursOf(frames);
      return { name, frame, colours, stage: new Stage(frame, before, this.material, this.extents[i]) };
    });
    this.#align();
    const most = Math.max(0, ...this.panes.map(({ frame }) => countOf(frame)));
    this.pixels ??= most < 5e3 ? 5 : most < 4e4 ? 4 : most < 4e5 ? 3 : 2;
    this.unpick();
    this.#hide();
    this.#drawTime();
    this.colourBy(this.names.includes(this.colour) ? this.colour : this.#usualOf(this.names));
  }

  /** The columns by which the points of these frames can be coloured: those that vary. */
  #coloursOf(frames) {
    const varying = new Map();
    for (const { name, values } of frames.flatMap(columnsOf)) {
      const [first, is] = varying.get(name) ?? [values[0], false];
      if (!is)
        varying.set(name, [first ?? values[0], varies({ values }) || (values.length > 0 && values[0] !== first)]);
    }
    const known = [...varying.keys()];
    const found = known.filter((name) => varying.get(name)[1]);
    return found.length ? found : known.slice(0, 1);
  }

  /** The usual one of these columns. Beside meshes, points in the colours of their objects could not be seen. */
  #usualOf(names) {
    const first = this.panes.some(({ stage }) => stage.parts.meshes && stage.parts.points) ? 4 : 0;
    return USUAL_COLOURS.slice(first).find((name) => names.includes(name)) ?? names[0];
  }

  /** The extent that is shown, or that of the frame, if its points would be a speck there or cut off. */
  #extentFor(frame, extent) {
    if (extent.isSweep || !frame.points) return extent;
    const own = extentOf(frame);
    const away = Math.hypot(...own.middle.map((x, i) => x - extent.middle[i]));
    return own.radius < extent.radius / 3 || away + own.radius > 1.2 * extent.radius ? own : extent;
  }

  /** Colours the points by the column of this name. */
  colourBy(name) {
    this.colour = name;
    for (const pane of this.panes) {
      const own = pane.colours.includes(name) ? name : this.#usualOf(pane.colours);
      pane.column = pane.stage.colourBy(own, (column) => this.#spanOf(column));
    }
    const coloured = this.panes.filter(({ column }) => column);
    const columns = coloured.map(({ column }) => column);
    const scales = [...new Set(columns.map(scaleHtml))];
    const named = (scale, i) => (scales[1] ? `<small>${escaped(coloured[i].name)}</small>` : "") + scale;
    const boxes = this.panes.flatMap(({ frame }) => frame.boxes ?? []);
    const meshes = this.panes.flatMap(({ frame }) => (frame.points ? [] : (frame.meshes ?? [])));
    const steps = new Set(this.panes.map(({ stage }) => `${shown(stage.gridStep)} m`));
    const grid = `<small>grid ${[...steps].join(" and ")}</small>`;
    this.legend.innerHTML = [...scales.map(named), meshesHtml(meshes), boxesHtml(boxes, columns), grid].join("");
    this.invalidate();
  }

  /** A colour means the same in all frames and panes. */
  #spanOf({ name, kind }) {
    const isOf = (other) => other.name === name && other.kind === kind;
    if (kind === "number") this.spans[name] ??= spanOf(this.frames.flatMap((frame) => columnsOf(frame).filter(isOf)));
    return this.spans[name];
  }

  /** Shows the frame with this number of each pane. */
  showFrame(number) {
    const frame = Math.min(this.nFrames - 1, Math.max(0, number));
    if (frame === this.frame) return;
    this.frame = frame;
    const before = this.extents.slice();
    this.#stageFrames();
    const isElsewhere = this.extents.some((extent, i) => extent !== before[i]);
    if (isElsewhere) this.fit(this.camera.getWorldDirection(new THREE.Vector3()).negate());
  }

  /** Hides what is above this share of the height of what is seen. */
  #cut(share) {
    const heights = this.extents.map(({ floor, top }) => [floor, top]);
    const [low, high] = [0, 1].map((i) => heights.reduce((sum, height) => sum + height[i], 0) / heights.length);
    const ceiling = share < 1 ? low + share * (high - low) : 1e30;
    this.material.uniforms.ceiling.value = ceiling;
    this.renderer.clippingPlanes = share < 1 ? [new THREE.Plane(new THREE.Vector3(0, 0, -1), ceiling)] : [];
  }

  /** Saves what is seen, with the labels, as a PNG file. */
  save() {
    this.render();
    const { canvas } = this;
    const picture = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
    const context = picture.getContext("2d");
    context.drawImage(canvas, 0, 0);
    const ratio = this.renderer.getPixelRatio();
    context.font = `600 ${12 * ratio}px sans-serif`;
    context.textAlign = "center";
    const { left, top } = this.root.getBoundingClientRect();
    for (const label of this.labels.children) {
      const at = label.getBoundingClientRect();
      context.fillStyle = getComputedStyle(label).color;
      context.fillText(label.textContent, (at.left + at.width / 2 - left) * ratio, (at.bottom - 4 - top) * ratio);
    }
    const name = `${this.panes[0]?.name ?? "view"}.png`;
    picture.toBlob((blob) => {
      const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
    return picture;
  }

  /** Looks at all, from `back` of it. */
  fit(back) {
    const free = this.#centre();
    this.views = this.extents.map((extent) => this.navigation.viewOf(extent, free, back));
    if (!this.views.length) return;
    this.navigation.fit(this.views[0]);
    this.material.uniforms.focus.value = 0.8 * this.views[0].distance;
    this.#align();
  }

  /** Brings panes of very different sizes or places to those of the first: one camera sees all of each. */
  #align() {
    const [first] = this.views;
    this.panes.forEach(({ stage }, i) => {
      const { target, distance } = this.views[i] ?? first ?? {};
      const ratio = first ? first.distance / distance : 1;
      if (!first || (ratio < 3 && ratio > 1 / 3 && target.distanceTo(first.target) < first.distance / 2)) return;
      stage.world.scale.setScalar(ratio);
      stage.world.position.copy(first.target).addScaledVector(target, -ratio);
    });
  }

  /** Has the camera's target in the middle of what the bars leave free; returns that share of width and height. */
  #centre() {
    if (!this.size) return [1, 1];
    const [width, height] = [this.size[0] / this.panes.length, this.size[1]];
    const { bar, legend, time } = this;
    const isWide = legend.offsetWidth > this.size[0] / 2;
    const low = isWide ? legend.offsetTop : time.hidden ? height : time.offsetTop;
    const [top, bottom] = [bar.offsetTop + bar.offsetHeight, low - 36];
    this.camera.setViewOffset(width, height, 0, (height - top - bottom) / 2, width, height);
    const aside = isWide ? 0 : Math.min(legend.offsetLeft + legend.offsetWidth, width / 5);
    return [1 - (2 * aside) / width, Math.max(0.2, (bottom - top) / height)];
  }

  #hide() {
    for (const [name, objects] of this.panes.flatMap(({ stage }) => Object.entries(stage.parts))) {
      for (const object of objects) object.visible = !this.hidden.has(name);
    }
    this.invalidate();
  }

  #drawBar() {
    const toggle = (name) => {
      const checked = this.hidden.has(name) ? "" : "checked";
      return `<label><input type="checkbox" name="${name}" ${checked}>${name}</label>`;
    };
    const option = (name) => `<option ${name === this.colour ? "selected" : ""}>${escaped(name)}</option>`;
    const points = `<label>colour <select name="colour">${this.names.map(option).join("")}</select></label>
      <label>size <input type="range" name="size" min="1" max="10" step="0.5" value="${this.pixels}"></label>`;
    const cut = `<label class="wide" title="Hide what is high">cut <input type="range" name="cut" min="0.02" max="1" step="0.02" value="1"></label>`;
    const title = "F: turntable (drag, wheel) or flight (drag to look; keys W A S D Q E)";
    const html = `${this.names.length ? points : ""}${cut}${partsOf(this.frames).map(toggle).join("")}
      <button name="fly" title="${title}">${this.navigation.flies ? "fly" : "turntable"}</button>
      <button name="reset" title="R: look at all">reset</button><button class="wide" name="save" title="Save a PNG file">save</button>`;
    // A list of colours that is open stays open while data change.
    if (html !== this.shownBar) this.bar.innerHTML = html;
    this.shownBar = html;
  }

  #drawTime() {
    const [play, slider, text] = this.time.children;
    play.textContent = this.playing ? "pause" : "play";
    [slider.max, slider.value] = [this.nFrames - 1, this.frame];
    const name = this.panes.find(({ frame }) => frame.name)?.frame.name ?? "";
    text.textContent = `${name} (${this.frame + 1} of ${this.nFrames})`.trim();
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.size = [width, height];
    if (this.panes.length) this.#centre();
    this.invalidate();
  }

  /** Draws soon, once for all changes until then. */
  invalidate() {
    this.request ??= requestAnimationFrame((now) => {
      this.request = undefined;
      const seconds = Math.min(0.1, (now - (this.drawnAt ?? now)) / 1000);
      this.drawnAt = now;
      if (this.navigation.advance(seconds)) this.invalidate();
      this.render();
    });
  }

  /** Draws now. */
  render() {
    if (!this.size || !this.panes.length) return;
    const { renderer, camera } = this;
    const [width, height] = [this.size[0] / this.panes.length, this.size[1]];
    camera.updateMatrixWorld();
    const [all, one, ratio] = [this.material.uniforms, this.marker.material.uniforms, renderer.getPixelRatio()];
    all.size.value = this.pixels * ratio;
    one.size.value = (this.pixels + 7) * ratio;
    one.focus.value = all.focus.value;
    renderer.setScissorTest(true);
    this.panes.forEach(({ stage }, i) => {
      renderer.setViewport(i * width, 0, width, height);
      renderer.setScissor(i * width, 0, width, height);
      renderer.clear();
      renderer.render(stage.scene, camera);
    });
    this.#placeLabels(width, height);
    this.firstPictureMs ??= performance.now();
  }

  #placeLabels(width, height) {
    const made = [];
    const project = (pane, place) =>
      new THREE.Vector3(...place).applyMatrix4(this.panes[pane].stage.world.matrixWorld).project(this.camera);
    const add = (pane, place, className, text, onclick, colour = "", above = []) => {
      const at = project(pane, place);
      // Over the highest corner in the picture.
      at.y = Math.max(at.y, ...above.map((corner) => project(pane, corner).y).filter((y) => y < 1));
      if (at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1) return;
      const label = Object.assign(document.createElement("span"), { className, textContent: text, onclick });
      const [x, y] = [(pane + (at.x + 1) / 2) * width, ((1 - at.y) / 2) * height];
      label.style = `left:${x.toFixed(1)}px; top:${y.toFixed(1)}px; color:${colour}`;
      made.push({ label, depth: at.z, x, y, half: 4 + 3.6 * text.length });
    };
    this.panes.forEach(({ name, frame }, pane) => {
      for (const box of this.hidden.has("labels") || this.hidden.has("boxes") ? [] : (frame.boxes ?? [])) {
        if (box.truth) continue;
        const { centre, size, yaw, score, track } = box;
        // The score of an unknown object is that of the class that it resembles.
        const sure = box.class === "unknown" ? undefined : score?.toFixed(2);
        const words = [box.class, Number.isInteger(track) && `#${track}`, sure].filter(Boolean).join(" ");
        const known = {
          "centre (m)": centre,
          "size (m)": size,
          "yaw (°)": (yaw * 180) / Math.PI,
          score: sure && score,
          track,
        };
        const facts = () => this.#showFacts(box.class ?? "box", Object.entries(known));
        add(pane, centre, "box", words, facts, css(boxColour(box)), corners(box));
      }
      for (const { name, pose } of this.hidden.has("sensors") ? [] : (frame.sensors ?? [])) {
        add(pane, placeOf({ pose }), "sensor", name);
      }
      const count = frame.points ? `, ${countOf(frame).toLocaleString("en")} points` : "";
      const className = this.panes.length > 1 ? "title" : "title only";
      const label = Object.assign(document.createElement("span"), { className, textContent: name + count });
      label.style.left = `${(pane + 0.5) * width}px`;
      made.push({ label, depth: -1 });
    });
    made.sort((a, b) => a.depth - b.depth);
    // Of labels at one place, the nearest is shown.
    const hides = (one, other) => Math.abs(one.x - other.x) < one.half + other.half && Math.abs(one.y - other.y) < 16;
    const kept = [];
    for (const one of made) if (!kept.some((other) => hides(one, other))) kept.push(one);
    this.labels.replaceChildren(...kept.slice(0, MOST_LABELS).map(({ label }) => label));
  }

  /** Picks the point that is drawn at this place, pixels of the element, and returns its number, or -1. */
  pick(x, y) {
    const width = this.size[0] / this.panes.length;
    const { frame, stage } = this.panes[Math.min(this.panes.length - 1, Math.floor(x / width))];
    const wished = [(2 * (x % width)) / width - 1, 1 - (2 * y) / this.size[1]];
    const half = [width / 2, this.size[1] / 2];
    const before = this.picked >= 0 && this.pickedAt;
    this.unpick();
    const { matrixWorld } = stage.world;
    this.picked = pick(this.camera, matrixWorld, frame.points?.position ?? [], wished, half, Math.max(8, this.pixels));
    if (this.picked >= 0) this.#showPoint(frame.points, stage, before);
    this.invalidate();
    return this.picked;
  }

  unpick() {
    this.marker.removeFromParent();
    this.span?.removeFromParent();
    this.facts.hidden = true;
    this.picked = -1;
  }

  /** Shows what is known of the picked point, and how far it is from the point that was picked before it. */
  #showPoint({ position, origin = [0, 0, 0], step = 0 }, stage, before) {
    const number = this.picked;
    const at = position.slice(3 * number, 3 * number + 3);
    this.marker.geometry.setAttribute("position", new THREE.BufferAttribute(at, 3));
    this.marker.geometry.setAttribute("tint", new THREE.BufferAttribute(new Float32Array([1, 1, 1]), 3));
    stage.world.add(this.marker);
    this.pickedAt = { at, stage };
    const away = [];
    if (before && before.stage === stage) {
      away.push(["from the point before (m)", Math.hypot(...at.map((x, i) => x - before.at[i])).toFixed(3)]);
      this.span = drawSpan(at, before.at);
      stage.world.add(this.span);
    }
    const digits = step > 1e-3 ? 2 : 4;
    const place = ["x (m)", "y (m)", "z (m)"].map((name, i) => [name, (at[i] + origin[i]).toFixed(digits)]);
    const columns = stage.columns.map((column) => {
      const value = column.values[number];
      return [titleOf(column), column.names?.[value] ?? value];
    });
    this.#showFacts(`point ${number}`, [...away, ...place, ...columns]);
  }

  #showFacts(title, facts) {
    this.facts.innerHTML = factsHtml(title, facts);
    this.facts.hidden = false;
  }
}
