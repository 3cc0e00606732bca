//! Where a mesh or an instance is.

use super::{Instance, Mesh};
use crate::effects::Effects;
use crate::pose::Pose;
use edgepuck_mesh::unit_frame::bounding_box;
use formats::plausible::{Warning, effect_on_mesh};
use glam::DVec3;

/// A bounding box, metres.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The least coordinates.
    pub low: DVec3,
    /// The largest coordinates.
    pub high: DVec3,
}

impl Mesh {
    /// Its bounding box.
    #[doc(hidden)]
    #[must_use]
    pub fn extent(&self) -> Extent {
        let [low, high] = self.bounds_m().map(DVec3::from_array);
        Extent { low, high }
    }
}

impl Instance {
    /// Its bounding box in the world; if it moves, at time 0.
    #[doc(hidden)]
    #[must_use]
    pub fn extent(&self) -> Extent {
        let at = self.motion.as_ref().map_or(Pose::IDENTITY, |motion| motion.at(0.0));
        let vertices = self.mesh.vertices().iter().map(|vertex| {
            at.rotation * (self.pose.rotation * (self.scale * *vertex) + self.pose.position_m)
        });
        let (low, high) = bounding_box(vertices);
        Extent { low: low + at.position_m, high: high + at.position_m }
    }
}

impl Extent {
    /// The box around both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The lengths of its sides, metres.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        (self.high - self.low).to_array()
    }

    /// Why its form is not to be seen in scans with `effects`: noise or a quantum as large as it is.
    #[must_use]
    pub fn hidden_by(&self, effects: &Effects) -> Option<Warning> {
        let quantum_m = effects.quantum.and_then(|quantum| quantum.step_m);
        effect_on_mesh(self.size_m(), effects.noise.map(|noise| noise.sigma_m), quantum_m)
    }

    /// How far its bounding box is from a place, metres; 0 inside.
    #[must_use]
    pub fn distance_m(&self, place_m: DVec3) -> f64 {
        place_m.clamp(self.low, self.high).distance(place_m)
    }

    /// Whether one of `sensors_m` stands inside its bounding box: it then sees the mesh from inside.
    #[must_use]
    pub fn surrounds(&self, sensors_m: &[DVec3]) -> bool {
        let is_inside =
            |sensor: &DVec3| sensor.cmpgt(self.low).all() && sensor.cmplt(self.high).all();
        sensors_m.iter().any(is_inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(size: f64) -> Mesh {
        let corners = [[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]];
        Mesh::from_triangles(corners.to_vec(), vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
            .unwrap()
    }

    #[test]
    fn a_sensor_inside_the_bounding_box_is_found() {
        let mesh = tetrahedron(2.0);
        assert!(mesh.extent().surrounds(&[DVec3::splat(9.0), DVec3::splat(1.9)]));
        assert!(!mesh.extent().surrounds(&[DVec3::new(1.0, 1.0, 2.0), DVec3::splat(-0.1)]));
    }
}
