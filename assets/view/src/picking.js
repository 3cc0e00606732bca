// Finds the point under the pointer.
import { Matrix4 } from "three";

/**
 * The number of the point that the camera sees at `wished`, -1 to 1 in x and y, within `reach` pixels of a
 * picture whose half width and height are `half` pixels: of several the one nearest to the camera. -1 if
 * there is none. `world` places the points.
 */
export function pick(camera, world, position, wished, half, reach) {
  const seen = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const m = seen.multiply(world).elements;
  let [best, found] = [Number.POSITIVE_INFINITY, -1];
  for (let i = 0; i < position.length; i += 3) {
    const [x, y, z] = [position[i], position[i + 1], position[i + 2]];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    const dx = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w - wished[0]) * half[0];
    const dy = ((m[1] * x + m[5] * y + m[9] * z + m[13]) / w - wished[1]) * half[1];
    const away = dx * dx + dy * dy;
    // A point that is a little farther, but in the middle of the pointer, is meant.
    const worth = w * (1 + away / (reach * reach));
    if (w > 0 && away <= reach * reach && worth < best) [best, found] = [worth, i / 3];
  }
  return found;
}
