//! Upright boxes around objects.

use glam::{DQuat, DVec3};
use sim_gpu::glam;

/// The corners of the box around its base and then around its top, counterclockwise, metres. `yaw_rad` is the
/// direction of the length, counterclockwise from x.
pub fn corners(centre_m: DVec3, size_m: DVec3, yaw_rad: f64) -> [DVec3; 8] {
    let turned = DQuat::from_rotation_z(yaw_rad);
    let [ahead, aside, up] = [0, 1, 2].map(|axis| turned * DVec3::AXES[axis] * size_m[axis] * 0.5);
    let at = |level: f64, [x, y]: [f64; 2]| centre_m + x * ahead + y * aside + level * up;
    let around = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i| at(if i < 4 { -1.0 } else { 1.0 }, around[i % 4]))
}
