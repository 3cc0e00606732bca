//! Boxes with a level base.

use serde::{Deserialize, Deserializer};

#[cfg(feature = "poses")]
use super::pose::Pose;
#[cfg(feature = "poses")]
use glam::{DQuat, DVec3};

/// A box with a level base, in the frame of what it is around. Those of points are in f32.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrientedBox<T = f64> {
    /// Its middle, metres.
    pub centre_m: [T; 3],
    /// Length, width and height, metres.
    pub size_m: [T; 3],
    /// Direction of the length, radians counterclockwise from x.
    pub yaw_rad: T,
}

impl OrientedBox<f32> {
    /// The same box in f64.
    #[must_use]
    pub fn widened(self) -> OrientedBox {
        let [centre_m, size_m] = [self.centre_m, self.size_m].map(|of| of.map(f64::from));
        OrientedBox { centre_m, size_m, yaw_rad: self.yaw_rad.into() }
    }
}

impl OrientedBox {
    /// The nearest box in f32.
    #[must_use]
    pub fn narrowed(self) -> OrientedBox<f32> {
        let [centre_m, size_m] = [self.centre_m, self.size_m].map(|of| of.map(|x| x as f32));
        OrientedBox { centre_m, size_m, yaw_rad: self.yaw_rad as f32 }
    }

    /// An offset from its middle, metres, along its length, width and height.
    #[must_use]
    pub fn along(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = libm::sincos(self.yaw_rad);
        [cos * x + sin * y, cos * y - sin * x, z]
    }

    /// Whether `point_m` lies in the box, widened by `margin_m` on each side.
    #[must_use]
    pub fn contains(&self, point_m: [f64; 3], margin_m: f64) -> bool {
        let off_m = self.along([0, 1, 2].map(|axis| point_m[axis] - self.centre_m[axis]));
        off_m.iter().zip(self.size_m).all(|(at, size)| at.abs() <= size / 2.0 + margin_m)
    }
}

#[cfg(feature = "poses")]
impl OrientedBox {
    /// Its corners, metres: around the base and then around the top, counterclockwise.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 8] {
        let turned = DQuat::from_rotation_z(self.yaw_rad);
        let [ahead, aside, up] =
            [0, 1, 2].map(|axis| turned * DVec3::AXES[axis] * self.size_m[axis] * 0.5);
        let at = |level: f64, [x, y]: [f64; 2]| {
            DVec3::from(self.centre_m) + x * ahead + y * aside + level * up
        };
        let around = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| at(if i < 4 { -1.0 } else { 1.0 }, around[i % 4]))
    }

    /// A box of the world in the frame of a sensor with this pose.
    #[must_use]
    pub fn seen_from(self, pose: &Pose) -> Self {
        let ahead = pose.rotation.inverse() * (DQuat::from_rotation_z(self.yaw_rad) * DVec3::X);
        let centre_m = pose.from_world(self.centre_m.into()).to_array();
        Self { centre_m, yaw_rad: libm::atan2(ahead.y, ahead.x), ..self }
    }
}

/// As the programs write it in JSON: `centre_m`, `size_m` and `yaw_deg`.
impl<'de> Deserialize<'de> for OrientedBox {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        struct Written {
            centre_m: [f64; 3],
            size_m: [f64; 3],
            yaw_deg: f64,
        }
        let Written { centre_m, size_m, yaw_deg } = Written::deserialize(deserializer)?;
        Ok(Self { centre_m, size_m, yaw_rad: yaw_deg.to_radians() })
    }
}
