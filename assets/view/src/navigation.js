// Moves the camera: a turntable around a target, or flight with the keys W A S D Q E.
import { Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const BACK = new Vector3(-0.82, -0.55, 0.62).normalize();
/** A sensor this many radii away would make what it sees small. */
const FAR = 8;

/** The direction from what is seen to who sees it: behind the sensor, and above it. */
function behind({ middle, isSweep, sensor, heading }) {
  if (isSweep) return new Vector3(-heading[0], -heading[1], 0.62).normalize();
  const away = sensor && new Vector3(...sensor.map((x, i) => x - middle[i]));
  if (!away?.length()) return BACK;
  // A little aside, so that the sensor does not hide what it sees.
  away.applyAxisAngle(new Vector3(0, 0, 1), 0.12);
  const level = Math.hypot(away.x, away.y);
  const rise = Math.min(1.1, Math.max(0.25, Math.atan2(away.z, level) + 0.15));
  return level > 0 ? new Vector3(away.x, away.y, level * Math.tan(rise)).normalize() : away.normalize();
}
const KEYS = { w: [0, 1], s: [0, -1], a: [1, -1], d: [1, 1], q: [2, -1], e: [2, 1] };

export class Navigation {
  constructor(camera, canvas, changed) {
    this.camera = camera;
    this.changed = changed;
    this.pressed = new Set();
    this.orbit = new OrbitControls(camera, canvas);
    this.orbit.addEventListener("change", changed);
    this.flies = false;
    this.radius = 10;
    canvas.addEventListener("pointermove", (event) => {
      if (this.flies && event.buttons) this.#look(event.movementX, event.movementY);
    });
  }

  /**
   * The target and the distance from which an extent is seen, from behind and above its sensor, or from `back` of it:
   * all of an object within the shares `free` of the picture's width and height, and its sensor unless that is far; of
   * a sweep what is low and near.
   */
  viewOf(
    { middle, half, radius, floor, isSweep, sensor, heading },
    free,
    back = behind({ middle, isSweep, sensor, heading }),
  ) {
    const { up, fov, aspect } = this.camera;
    const target = new Vector3(...middle);
    if (isSweep) {
      target.fromArray(sensor).setZ(Math.max(floor, sensor[2] - radius / 8));
      target.add(new Vector3(...heading, 0).multiplyScalar(radius / 4));
    }
    const right = new Vector3().crossVectors(up, back).normalize();
    const above = new Vector3().crossVectors(back, right);
    const slope = Math.tan((fov * Math.PI) / 360);
    const corners = Array.from({ length: 8 }, (_, i) => half.map((x, axis) => ((i >> axis) & 1 ? x : -x)));
    const ofSensor = sensor?.map((x, axis) => x - middle[axis]);
    // With room for its body.
    if (sensor && Math.hypot(...ofSensor) < FAR * radius) corners.push(ofSensor.map((x) => 1.07 * x));
    const needed = corners.map((at) => {
      const corner = new Vector3(...at);
      const [wide, high] = [corner.dot(right) / aspect / free[0], corner.dot(above) / free[1]].map(Math.abs);
      return corner.dot(back) + Math.max(wide, high) / slope;
    });
    const distance = isSweep ? (1.5 * radius) / Math.min(1, aspect) : 1.03 * Math.max(radius, ...needed);
    return { target, back, distance };
  }

  /** Looks at what `viewOf` has found. */
  fit({ target, back, distance }) {
    this.radius = distance / 2;
    this.camera.near = distance / 1000;
    this.camera.far = distance * 100;
    this.camera.position.copy(target).addScaledVector(back, distance);
    this.orbit.target.copy(target);
    this.camera.updateProjectionMatrix();
    this.orbit.update();
    this.changed();
  }

  fly(flies) {
    const ahead = this.camera.getWorldDirection(new Vector3());
    this.orbit.target.copy(this.camera.position).addScaledVector(ahead, this.radius);
    this.flies = flies;
    this.orbit.enabled = !flies;
    this.pressed.clear();
  }

  #look(x, y) {
    const { camera } = this;
    const ahead = camera.getWorldDirection(new Vector3());
    const right = new Vector3().crossVectors(ahead, camera.up).normalize();
    ahead.applyAxisAngle(camera.up, -x * 0.004).applyAxisAngle(right, -y * 0.004);
    if (Math.abs(ahead.z) < 0.99) camera.lookAt(ahead.add(camera.position));
    this.changed();
  }

  key(key, isDown) {
    if (!this.flies || !KEYS[key]) return;
    if (isDown) this.pressed.add(key);
    else this.pressed.delete(key);
    this.changed();
  }

  /** Moves by the pressed keys for this time; returns whether any is pressed. */
  advance(seconds) {
    const ahead = this.camera.getWorldDirection(new Vector3());
    const axes = [ahead, new Vector3().crossVectors(ahead, this.camera.up).normalize(), this.camera.up];
    for (const key of this.pressed) {
      const [axis, sign] = KEYS[key];
      this.camera.position.addScaledVector(axes[axis], sign * seconds * this.radius * 0.5);
    }
    return this.pressed.size > 0;
  }
}
