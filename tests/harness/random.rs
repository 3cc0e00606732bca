//! Random numbers for tests: the same on every run.

use formats::rng::StreamKey;
use glam::{DQuat, DVec3, Vec4Swizzles};

/// A sequence of random numbers.
#[derive(Clone, Debug)]
pub struct Random {
    key: StreamKey,
    next: u64,
}

impl Random {
    /// The sequence of this name.
    pub fn new(name: &str) -> Self {
        Self { key: StreamKey::new(0, name, 0), next: 0 }
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.next += 1;
        self.key.unit(self.next)
    }

    /// In [-1, 1) on each axis.
    pub fn in_cube(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// A unit vector, evenly over the sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.in_cube();
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// A rotation.
    pub fn rotation(&mut self) -> DQuat {
        let v = self.direction().extend(self.unit() - 0.5).normalize();
        DQuat::from_xyzw(v.x, v.y, v.z, v.w)
            .mul_quat(DQuat::from_axis_angle(v.xyz().normalize(), 1.0))
    }
}
