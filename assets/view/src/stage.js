// What is drawn of one frame: points, meshes, boxes, sensors and the grid, as objects of three.js.
import * as THREE from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import { classColour, nameOf, numberColour, scaleOf } from "./colour.js";

const VERTEX = `
  attribute vec3 tint; uniform float size; uniform float focus; uniform float ceiling; varying vec3 vTint;
  varying float vAbove;
  void main() {
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    vAbove = (modelMatrix * vec4(position, 1.0)).z - ceiling;
    gl_Position = projectionMatrix * seen;
    gl_PointSize = size * clamp(sqrt(focus / max(-seen.z, 1e-6)), 0.7, 3.0);
    vTint = tint;
  }`;
const FRAGMENT = `
  varying vec3 vTint;
  varying float vAbove;
  void main() {
    if (vAbove > 0.0) discard;
    vec2 off = 2.0 * gl_PointCoord - 1.0;
    float away = dot(off, off);
    if (away > 1.0) discard;
    gl_FragColor = vec4(vTint * (1.0 - 0.35 * away), 1.0);
  }`;

/** The material of all points: round, of `size` pixels at the distance `focus`, those above `ceiling` hidden. */
export const pointMaterial = () =>
  new THREE.ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { size: { value: 3 }, focus: { value: 10 }, ceiling: { value: 1e30 } },
  });

function drawLines(positions, colours, settings) {
  const geometry = new LineSegmentsGeometry().setPositions(positions).setColors(colours);
  return new LineSegments2(geometry, new LineMaterial({ vertexColors: true, ...settings })).computeLineDistances();
}

/** The corners that each edge of a box joins; the bits of a corner's number are its sides. */
const EDGES = [0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7];

export function corners({ centre: [x, y, z], size, yaw = 0 }) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return Array.from({ length: 8 }, (_, i) => {
    const [ahead, aside, up] = size.map((side, axis) => (((i >> axis) & 1) - 0.5) * side);
    return [x + cos * ahead - sin * aside, y + sin * ahead + cos * aside, z + up];
  });
}

export const boxColour = (box) => (box.class ? classColour(box.class) : numberColour(box.track ?? 0));

function drawBoxes(boxes, settings) {
  const [positions, colours] = [[], []];
  for (const box of boxes) {
    const at = corners(box);
    // Truth is paler.
    const colour = boxColour(box).map((x) => ((box.truth ? 0.45 * x + 140 : x) / 255) ** 2.2);
    for (const corner of EDGES) {
      positions.push(...at[corner]);
      colours.push(...colour);
    }
  }
  return drawLines(positions, colours, settings);
}

function drawMesh(mesh) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(mesh.position, 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.index, 1));
  const settings = { flatShading: true, side: THREE.DoubleSide };
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(settings));
}

/** Where a sensor is. */
export const placeOf = ({ pose }) => [pose[3], pose[7], pose[11]];

/** The ways of the tracks of these boxes of a frame in the frames before, oldest first: in the world, if poses are known. */
function drawTrails(boxes, { pose }, before) {
  const matrix = (of) => new THREE.Matrix4().set(...of);
  const seen = ({ centre }, then) =>
    pose && then.pose
      ? new THREE.Vector3(...centre).applyMatrix4(matrix(pose).invert().multiply(matrix(then.pose))).toArray()
      : centre;
  const [positions, colours] = [[], []];
  for (const box of boxes) {
    const colour = boxColour(box).map((x) => (x / 255) ** 2.2);
    let from = box.centre;
    for (const then of before.toReversed()) {
      const same = then.boxes?.find(({ track, truth }) => track === box.track && truth === box.truth);
      if (!same) continue;
      const to = seen(same, then);
      positions.push(...from, ...to);
      colours.push(...colour, ...colour);
      from = to;
    }
  }
  return drawLines(positions, colours, { linewidth: 2, transparent: true, opacity: 0.7 });
}

/** A line between two places. */
export const drawSpan = (from, to) =>
  drawLines([...from, ...to], [1, 1, 1, 1, 1, 1], { linewidth: 2, depthTest: false });

/** The body of a sensor. */
function drawBody({ pose }, length) {
  const geometry = new THREE.CylinderGeometry(0.22 * length, 0.26 * length, 0.4 * length, 24).rotateX(Math.PI / 2);
  const body = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: 0x9fd8ff }));
  body.applyMatrix4(new THREE.Matrix4().set(...pose));
  return body;
}

/** The axes of a sensor: x red, y green, z blue. */
function drawSensor({ pose }, length) {
  const at = placeOf({ pose });
  const [positions, colours] = [[], []];
  for (const axis of [0, 1, 2]) {
    positions.push(...at, ...at.map((x, row) => x + length * pose[4 * row + axis]));
    const colour = [0.25, 0.3, 0.35].with(axis, 0.95);
    colours.push(...colour, ...colour);
  }
  return drawLines(positions, colours, { linewidth: 3 });
}

function drawRays(rays) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(rays, 3));
  const settings = { color: 0x6fd3ff, transparent: true, opacity: 0.14, depthWrite: false };
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(settings));
}

function drawGrid({ middle, floor, radius }) {
  const step = 10 ** Math.round(Math.log10(Math.max(radius, 1e-3) / 6));
  const n = 2 * Math.ceil((2.2 * radius) / step);
  const grid = new THREE.GridHelper(n * step, n, 0x4a5568, 0x2a313d);
  grid.rotation.x = Math.PI / 2;
  grid.position.set(...middle.map((x) => Math.round(x / step) * step).with(2, floor));
  grid.material.depthWrite = false;
  return { grid, step };
}

/** The direction in which a sensor looks, level: to its points, or along its x axis if they are all around it. */
function headingOf({ pose }, position = []) {
  const [x, y] = placeOf({ pose });
  const step = 3 * Math.max(1, Math.floor(position.length / 3 / 5000));
  const sum = [0, 0, 0];
  for (let i = 0; i + 2 < position.length; i += step) {
    const [ahead, aside] = [position[i] - x, position[i + 1] - y];
    const away = Math.hypot(ahead, aside);
    if (!(away > 0)) continue;
    [sum[0], sum[1], sum[2]] = [sum[0] + ahead / away, sum[1] + aside / away, sum[2] + 1];
  }
  const [ahead, aside] = Math.hypot(sum[0], sum[1]) > 0.3 * sum[2] && sum[2] ? sum : [pose[0], pose[4]];
  const length = Math.hypot(ahead, aside);
  return length > 1e-6 ? [ahead / length, aside / length] : [1, 0];
}

/**
 * The middle, the radius and the floor of what most of a frame's points, meshes and boxes span; where the first sensor
 * is, if it is known, and in which direction it looks.
 */
export function extentOf(frame) {
  const axes = [[], [], []];
  const add = (positions) => {
    const step = Math.max(1, Math.floor(positions.length / 3 / 20000));
    for (let i = 0; i + 2 < positions.length; i += 3 * step) {
      if (Number.isFinite(positions[i] + positions[i + 1] + positions[i + 2])) {
        for (const axis of [0, 1, 2]) axes[axis].push(positions[i + axis]);
      }
    }
  };
  add(frame.points?.position ?? []);
  for (const mesh of frame.meshes ?? []) add(mesh.position);
  for (const box of axes[0].length ? [] : (frame.boxes ?? [])) add(corners(box).flat());
  if (!axes[0].length) return { middle: [0, 0, 0], half: [3, 3, 3], radius: 5, floor: 0, top: 3, isSweep: false };
  for (const axis of axes) axis.sort((a, b) => a - b);
  const at = (axis, share) => axes[axis][Math.round(share * (axes[axis].length - 1))];
  const middleOf = (axis, low, high) => (at(axis, low) + at(axis, high)) / 2;
  const halfOf = (axis, low, high) => (at(axis, high) - at(axis, low)) / 2;
  const isAt = (axis, { pose }) => Math.abs(pose[4 * axis + 3] - middleOf(axis, 0, 1)) <= 1.25 * halfOf(axis, 0, 1);
  // Of a sweep, in or at which the sensor is, the near part matters; of an object all.
  const isSweep = !frame.meshes?.length && frame.sensors?.some((sensor) => isAt(0, sensor) && isAt(1, sensor));
  const [low, high] = isSweep ? [0.1, 0.9] : [0, 1];
  const [middle, half] = [middleOf, halfOf].map((of) => [0, 1, 2].map((axis) => of(axis, low, high)));
  const [first] = frame.sensors ?? [];
  const known = first && { sensor: placeOf(first), heading: headingOf(first, frame.points?.position) };
  return {
    middle,
    half,
    radius: Math.max(Math.hypot(...half), 1e-3),
    floor: at(2, 0.01),
    top: at(2, 1),
    isSweep,
    ...known,
  };
}

/** The columns by which points can be coloured: those of the file, the height and the range. */
export function columnsOf(frame) {
  const { points, sensors } = frame;
  if (!points) return [];
  const columns = points.columns.slice();
  const { position } = points;
  const add = (name, of) => {
    if (columns.some((column) => column.name === name)) return;
    const values = new Float32Array(position.length / 3);
    for (let i = 0; i < values.length; i++) values[i] = of(3 * i);
    columns.push({ name, unit: "m", kind: "number", values });
  };
  add("height", (i) => position[i + 2]);
  const [x, y, z] = [3, 7, 11].map((i) => sensors?.[0]?.pose[i] ?? 0);
  add("range", (i) => Math.hypot(position[i] - x, position[i + 1] - y, position[i + 2] - z));
  return columns;
}

/** One frame as a scene of three.js, with those before it. `world` has all but the lights. */
export class Stage {
  constructor(frame, before, material, extent) {
    this.frame = frame;
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x445566, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(-1, -2, 4);
    this.world = new THREE.Group();
    this.scene.add(sun, this.world);
    this.columns = columnsOf(frame);
    this.parts = {};
    if (frame.points) {
      const geometry = new THREE.BufferGeometry();
      const { position } = frame.points;
      this.tints = new THREE.BufferAttribute(new Uint8Array(position.length), 3, true);
      geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
      geometry.setAttribute("tint", this.tints);
      this.#add("points", new THREE.Points(geometry, material));
      this.parts.points[0].frustumCulled = false;
    }
    const { meshes = [], boxes = [], sensors = [] } = frame;
    for (const mesh of meshes) this.#add("meshes", drawMesh(mesh));
    const [truth, found] = [boxes.filter((box) => box.truth), boxes.filter((box) => !box.truth)];
    if (found.length) this.#add("boxes", drawBoxes(found, { linewidth: 2.5 }));
    const tracked = found.filter(({ track }) => Number.isInteger(track));
    if (tracked.length && before.length) this.#add("trails", drawTrails(tracked, frame, before));
    const dashes = { linewidth: 1.5, dashed: true, dashSize: 0.35, gapSize: 0.25, transparent: true };
    if (truth.length) this.#add("truth", drawBoxes(truth, { ...dashes, opacity: 0.9 }));
    for (const sensor of sensors) {
      const away = Math.hypot(...placeOf(sensor).map((x, i) => x - extent.middle[i]));
      const length = Math.max(extent.radius, Math.min(away, 4 * extent.radius)) / 14;
      this.#add("sensors", drawSensor(sensor, length));
      this.#add("sensors", drawBody(sensor, length));
      if (sensor.rays?.length) this.#add("beams", drawRays(sensor.rays));
    }
    const { grid, step } = drawGrid(extent);
    this.#add("grid", grid);
    this.gridStep = step;
  }

  #add(name, object) {
    this.parts[name] ??= [];
    this.parts[name].push(object);
    this.world.add(object);
  }

  /**
   * Colours the points by the column of this name, with the span of its colours; returns it and its scale. Without the
   * column, they are grey.
   */
  colourBy(name, spanOf) {
    const column = this.columns.find((one) => one.name === name);
    this.#colourMeshes(this.frame.points && name, column);
    if (!column) {
      this.tints?.array.fill(150);
      if (this.tints) this.tints.needsUpdate = true;
      return undefined;
    }
    const scale = scaleOf(column, spanOf(column));
    const { array } = this.tints;
    column.values.forEach((value, i) => {
      [array[3 * i], array[3 * i + 1], array[3 * i + 2]] = scale.look(value);
    });
    this.tints.needsUpdate = true;
    return { ...column, scale };
  }

  /** Beside points, the colours of meshes mean what those of the points do, or nothing. */
  #colourMeshes(name, column) {
    this.frame.meshes?.forEach((mesh, i, meshes) => {
      const own = () => (column?.names ? classColour(nameOf(column, i)) : numberColour(i));
      const tint = name === "object" || (!name && meshes.length > 1) ? own() : [176, 190, 205];
      const colour = mesh.class && (!name || name === "class") ? classColour(mesh.class) : tint;
      mesh.colour = colour;
      this.parts.meshes[i].material.color.setRGB(...colour.map((x) => x / 255), THREE.SRGBColorSpace);
    });
  }

  dispose() {
    this.scene.traverse((object) => {
      object.geometry?.dispose();
      if (!object.isPoints) object.material?.dispose();
    });
  }
}
