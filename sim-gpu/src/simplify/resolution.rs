//! The resolution of a sensor on an object.

use glam::DVec3;

use crate::mesh::TriangleMesh;
use crate::mesh::unit_frame::bounding_box;
use crate::sensor::SensorProfile;

/// The number of beam footprints per step between beams.
///
/// The VLP-32C's beams diverge by 3.0 mrad horizontally and 1.5 mrad vertically, and are 3.5 mrad
/// apart: the narrow side of a footprint is 0.43 of a step. Profiles always state steps, but not
/// always a divergence, so half a step approximates the footprint.
pub const FOOTPRINTS_PER_STEP: f64 = 2.0;

/// A sensor and its positions in the object's frame.
pub struct Viewpoint<'a> {
    /// The sensor.
    pub sensor: &'a SensorProfile,
    /// Its positions.
    pub positions: Vec<DVec3>,
}

/// The radius of a beam's footprint at the point of an object nearest to any of `viewpoints`, in
/// the units of `mesh`: `units_per_m` of them are a metre. A surface displaced by less stays in its
/// beam.
///
/// The nearest distance is that to the mesh's bounding box, but at least the nearest range that the
/// sensor reports. The radius is 0 if a sensor without such a limit stands in the box, and infinite
/// for a single beam.
#[must_use]
pub fn resolved_m(mesh: &TriangleMesh, units_per_m: f64, viewpoints: &[Viewpoint<'_>]) -> f64 {
    let corners = mesh.triangles.iter().flatten().map(|&v| mesh.vertices[v as usize]);
    let (low, high) = bounding_box(corners);
    let radius = |viewpoint: &Viewpoint<'_>| {
        let step_rad = viewpoint.sensor.angular_step_rad().unwrap_or(f64::INFINITY);
        let distance = |from: &DVec3| (from.clamp(low, high) - *from).length();
        let nearest = viewpoint.positions.iter().map(distance).fold(f64::INFINITY, f64::min);
        let nearest = nearest.max(viewpoint.sensor.range.min_m * units_per_m);
        // The tangent of half an angle, which grows without bound up to a step of half a circle.
        let half_footprint_rad = 0.5 * step_rad / FOOTPRINTS_PER_STEP;
        if half_footprint_rad >= std::f64::consts::FRAC_PI_2 {
            return f64::INFINITY;
        }
        nearest * libm::tan(half_footprint_rad)
    };
    viewpoints.iter().map(radius).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_square() -> TriangleMesh {
        let vertices = vec![DVec3::ZERO, DVec3::Y, DVec3::Z, DVec3::splat(1e9)];
        TriangleMesh { vertices, triangles: vec![[0, 1, 2]] }
    }

    fn seen_from(sensor: &str, positions: Vec<DVec3>) -> f64 {
        let sensor = SensorProfile::builtin(sensor).unwrap();
        resolved_m(&unit_square(), 1.0, &[Viewpoint { sensor: &sensor, positions }])
    }

    #[test]
    fn the_nearest_place_decides_and_a_quarter_of_a_step_there() {
        let two = vec![DVec3::X * 8.0, DVec3::new(2.0, 0.5, 0.5)];
        // 0.1990656 degrees / 4 at 2 m.
        let expected = 2.0 * (0.199_065_6f64 / 4.0).to_radians().tan();
        assert!((seen_from("vlp32c", two) - expected).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_seen_nearer_than_the_sensors_least_range() {
        // The square stands in the plane x = 0, and so does its box.
        let within = vec![DVec3::new(0.0, 0.2, 0.2)];
        let at_1_m = (0.199_065_6f64 / 4.0).to_radians().tan();
        assert!((seen_from("vlp32c", within.clone()) - at_1_m).abs() < 1e-12);
        assert_eq!(seen_from("generic-static", within), 0.0, "it has no least range");
    }
}
