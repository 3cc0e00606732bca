//! Positions and orientations of sensors and of things.
//!
//! Sensor frame: x forward, y left, z up, right-handed (ROS REP 103). World
//! frame: z up, right-handed, metres.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::error::InvalidValue;

/// The position and the orientation of a sensor, or of an instance of a mesh, in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The origin of its frame in the world, metres.
    pub position_m: DVec3,
    /// Turns vectors of its frame into the world frame; of unit length, written `[x, y, z, w]`.
    #[serde(rename = "quaternion_xyzw")]
    pub rotation: DQuat,
}

impl Pose {
    /// At the origin, not turned: a sensor looks along x.
    pub const IDENTITY: Self = Self { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// From its frame to the world's: a matrix of 4 by 4, row by row.
    #[must_use]
    pub fn matrix(&self) -> [f64; 16] {
        let matrix = DMat4::from_rotation_translation(self.rotation, self.position_m);
        matrix.transpose().to_cols_array()
    }

    /// `map` as a pose after factors along the axes, all above 0; `None` if it mirrors or shears, or
    /// flattens an axis.
    #[must_use]
    pub fn of_scaled(map: &DAffine3) -> Option<(Self, DVec3)> {
        /// Several products of transforms in f32, of which files are made.
        const ROUNDING: f64 = 1e-6;
        let axes = map.matrix3;
        let scale = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
        let rotation = axes * DMat3::from_diagonal(scale.recip());
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        let is_rotation = off.to_cols_array().into_iter().all(|off| off.abs() <= ROUNDING);
        let rotation = (is_rotation && rotation.determinant() > 0.0)
            .then(|| DQuat::from_mat3(&rotation).normalize())?;
        Some((Self { position_m: map.translation, rotation }, scale))
    }

    /// A point of its frame in the world, metres.
    #[must_use]
    pub fn to_world(&self, point_m: DVec3) -> DVec3 {
        self.rotation * point_m + self.position_m
    }

    /// A point of the world in its frame, metres.
    #[must_use]
    pub fn from_world(&self, point_m: DVec3) -> DVec3 {
        self.rotation.inverse() * (point_m - self.position_m)
    }

    /// At this position, metres, not turned.
    #[must_use]
    pub fn at(position_m: impl Into<DVec3>) -> Self {
        Self { position_m: position_m.into(), ..Self::IDENTITY }
    }

    /// At this position, metres, turned by this quaternion x, y, z, w, which becomes one of length 1.
    ///
    /// # Errors
    /// A coordinate is not finite; the square of the quaternion's length is not 1 to within 0.001, as that
    /// of rotations in f32 is.
    pub fn rigid(position_m: [f64; 3], quaternion_xyzw: [f64; 4]) -> Result<Self, InvalidValue> {
        if let Some(number) = position_m.into_iter().find(|number| !number.is_finite()) {
            let cause = format!("expected a position of finite metres, found {number}");
            return Err(InvalidValue::new("position_m", cause));
        }
        let rotation = DQuat::from_array(quaternion_xyzw);
        let length = rotation.length();
        let off = (length * length - 1.0).abs();
        if off.is_nan() || off >= 1e-3 {
            let cause = format!(
                "expected a quaternion of length 1, found {quaternion_xyzw:?} (x, y, z, w) of length {length:.4}"
            );
            return Err(InvalidValue::new("quaternion_xyzw", cause));
        }
        Ok(Self { position_m: position_m.into(), rotation: rotation.normalize() })
    }

    /// At the same position, turned by `yaw_deg` about z, then by `pitch_deg` about its own y axis
    /// (a positive angle looks down), then by `roll_deg` about its own x axis.
    #[must_use]
    pub fn turned_deg(self, yaw_deg: f64, pitch_deg: f64, roll_deg: f64) -> Self {
        let turn = DQuat::from_rotation_z(yaw_deg.to_radians())
            * DQuat::from_rotation_y(pitch_deg.to_radians())
            * DQuat::from_rotation_x(roll_deg.to_radians());
        Self { rotation: self.rotation * turn, ..self }
    }

    /// `distance_m` from the origin, looking at it; the azimuth is counterclockwise from x.
    #[must_use]
    pub fn looking_at_origin_deg(distance_m: f64, elevation_deg: f64, azimuth_deg: f64) -> Self {
        let (elevation_rad, azimuth_rad) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
        Self::view(distance_m, elevation_rad, azimuth_rad, DVec3::ZERO)
    }

    /// The sensor at `position_m` that looks at `target_m`, upright, with a level left axis.
    /// Straight above or below the target, its orientation is the limit along azimuth 0.
    ///
    /// # Errors
    /// If a coordinate is not finite, or the two points are equal or so far
    /// apart that their distance overflows.
    pub fn look_at(position_m: DVec3, target_m: DVec3) -> Result<Self, InvalidValue> {
        if !position_m.is_finite() {
            return Err(InvalidValue::new("position_m", "expected finite numbers"));
        }
        let to_target = target_m - position_m;
        if to_target == DVec3::ZERO {
            return Err(InvalidValue::new("look_at_m", "expected another point than the position"));
        }
        // Scaled first, so that squares neither overflow nor vanish.
        let to_target = to_target / to_target.abs().max_element();
        if !to_target.is_finite() {
            return Err(InvalidValue::new(
                "look_at_m",
                "expected finite numbers and a distance that f64 holds",
            ));
        }
        let level = libm::hypot(to_target.x, to_target.y);
        let azimuth_rad = if level == 0.0 { 0.0 } else { libm::atan2(-to_target.y, -to_target.x) };
        let elevation_rad = libm::atan2(-to_target.z, level);
        Ok(Self { position_m, rotation: facing_inwards(elevation_rad, azimuth_rad) })
    }

    /// The sensor that stands `distance_m` from `target_m` at this elevation
    /// and azimuth (radians, counterclockwise from world x) and looks at it.
    /// The azimuth determines the orientation even at elevation +-90 degrees.
    #[must_use]
    pub fn view(distance_m: f64, elevation_rad: f64, azimuth_rad: f64, target_m: DVec3) -> Self {
        Self {
            position_m: target_m + distance_m * outwards(elevation_rad, azimuth_rad),
            rotation: facing_inwards(elevation_rad, azimuth_rad),
        }
    }
}

/// The rotation of a sensor at this elevation and azimuth from its target that looks at the target
/// with a level left axis.
fn facing_inwards(elevation_rad: f64, azimuth_rad: f64) -> DQuat {
    let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
    let forward = -outwards(elevation_rad, azimuth_rad);
    let left = DVec3::new(sin_azimuth, -cos_azimuth, 0.0);
    DQuat::from_mat3(&DMat3::from_cols(forward, left, forward.cross(left))).normalize()
}

fn outwards(elevation_rad: f64, azimuth_rad: f64) -> DVec3 {
    let (sin_elevation, cos_elevation) = libm::sincos(elevation_rad);
    let (sin_azimuth, cos_azimuth) = libm::sincos(azimuth_rad);
    DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    use super::*;

    /// Sines, cosines and a quaternion's round trip each err by some 1e-16.
    const TOLERANCE: f64 = 2e-15;

    fn assert_near(found: DVec3, expected: DVec3) {
        assert!(found.abs_diff_eq(expected, TOLERANCE), "{found} is not {expected}");
    }

    fn axes(pose: &Pose) -> [DVec3; 3] {
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| pose.rotation * axis)
    }

    #[test]
    fn quaternions_of_nearly_length_1_get_it() {
        let pose = Pose::rigid([0.0; 3], [0.0, 0.0, 0.6001, 0.8001]).unwrap();
        assert!((pose.rotation.length() - 1.0).abs() < TOLERANCE);
    }

    #[test]
    fn a_level_look_is_a_turn_about_z() {
        let pose = Pose::look_at(DVec3::new(3.0, 0.0, 1.0), DVec3::new(0.0, 0.0, 1.0)).unwrap();
        let [forward, left, up] = axes(&pose);
        assert_near(forward, DVec3::NEG_X);
        assert_near(left, DVec3::NEG_Y);
        assert_near(up, DVec3::Z);
    }

    #[test]
    fn a_sensor_above_tilts_down_and_stays_level_to_the_side() {
        let pose = Pose::view(2.0, FRAC_PI_4, 0.3, DVec3::ZERO);
        let [forward, left, up] = axes(&pose);
        assert_near(forward, -pose.position_m / 2.0);
        assert!(left.z.abs() < TOLERANCE);
        assert!(up.z > 0.7);
        assert_near(forward.cross(left), up);
    }

    #[test]
    fn a_view_straight_from_above_or_below_is_turned_by_its_azimuth() {
        for elevation_rad in [FRAC_PI_2, -FRAC_PI_2] {
            for azimuth_rad in [0.0_f64, 1.0, -2.5] {
                let [forward, left, up] =
                    axes(&Pose::view(3.0, elevation_rad, azimuth_rad, DVec3::ZERO));
                let (sin_azimuth, cos_azimuth) = azimuth_rad.sin_cos();
                assert_near(forward, DVec3::new(0.0, 0.0, -elevation_rad.signum()));
                assert_near(left, DVec3::new(sin_azimuth, -cos_azimuth, 0.0));
                assert_near(forward.cross(left), up);
            }
        }
    }

    #[test]
    fn looking_straight_down_is_the_view_along_azimuth_0() {
        for z in [5.0, -5.0] {
            let looked = Pose::look_at(DVec3::new(1.0, 2.0, z), DVec3::new(1.0, 2.0, 0.0)).unwrap();
            let viewed = Pose::view(5.0, FRAC_PI_2.copysign(z), 0.0, DVec3::ZERO);
            for (a, b) in axes(&looked).into_iter().zip(axes(&viewed)) {
                assert_near(a, b);
            }
        }
    }

    #[test]
    fn a_view_equals_looking_at_its_target() {
        for azimuth_rad in [0.1, 1.0, 1.9, 2.8, 3.7, 4.6, 5.5] {
            let view = Pose::view(3.0, 0.35, azimuth_rad, DVec3::ZERO);
            let looked = Pose::look_at(view.position_m, DVec3::ZERO).unwrap();
            for (a, b) in axes(&view).into_iter().zip(axes(&looked)) {
                assert_near(a, b);
            }
        }
    }

    #[test]
    fn a_far_target_turns_no_view() {
        let target_m = DVec3::new(1e7, -1e7, 1e7);
        for azimuth_rad in [0.0, FRAC_PI_2, 3.0, -FRAC_PI_2] {
            let [near, far] = [DVec3::ZERO, target_m]
                .map(|target_m| Pose::view(3.0, 0.35, azimuth_rad, target_m));
            assert_eq!(near.rotation, far.rotation);
            // Half a unit in the last place at 1e7 is 9.3e-10 m.
            assert!((far.position_m - target_m).abs_diff_eq(near.position_m, 1e-9));
        }
    }

    #[test]
    fn look_at_refuses_what_has_no_direction() {
        let huge = DVec3::splat(f64::MAX);
        for (position_m, target_m, key) in [
            (DVec3::ONE, DVec3::ONE, "look_at_m"),
            (DVec3::NAN, DVec3::ONE, "position_m"),
            (DVec3::ONE, DVec3::new(f64::INFINITY, 0.0, 0.0), "look_at_m"),
            (huge, -huge, "look_at_m"),
        ] {
            assert_eq!(Pose::look_at(position_m, target_m).unwrap_err().key, key);
        }
        let tiny = DVec3::new(0.0, f64::MIN_POSITIVE / 4.0, 0.0);
        let [forward, ..] = axes(&Pose::look_at(DVec3::ZERO, tiny).unwrap());
        assert_near(forward, DVec3::Y);
    }

    #[test]
    fn poses_survive_a_round_trip_through_json() {
        let pose = Pose::view(3.0, 0.3, 0.7, DVec3::ONE);
        let json = serde_json::to_string(&pose).unwrap();
        assert!(json.contains("quaternion_xyzw"), "{json}");
        assert_eq!(serde_json::from_str::<Pose>(&json).unwrap(), pose);
    }
}
